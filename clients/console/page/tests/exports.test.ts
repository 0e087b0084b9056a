import {signal} from '@preact/signals';
import {expect, it} from 'vitest';
import type {Json, JsonObject} from '../src/protocol/json';
import {Exports, kWhole} from '../src/store/exports';
import type {Link} from '../src/store/link';

/** A console that answers as told, and notes what it was asked. */
function exportsOf(answer: (service: string) => Json | Promise<Json>) {
  const asked: {service: string; request: JsonObject}[] = [];
  const link = {
    call: async (service: string, request: JsonObject) => {
      asked.push({service, request});
      return answer(service);
    },
  } as unknown as Link;
  const tell = {problem: signal(''), done: signal('')};
  const fetched: string[] = [];
  const made = new Exports(link, tell, (path, name) => fetched.push(`${path} ${name}`));
  return {made, asked, tell, fetched};
}

const kReply = {
  path: '/download/t1/run.csv',
  name: 'run.csv',
  left_out: [],
};

it('asks for the chosen table, and lets the browser fetch it', async () => {
  const {made, asked, fetched} = exportsOf(() => kReply);
  await made.table('run.mcap', {
    isJoined: true,
    rateHz: 100,
    columns: ['position_m.*'],
    topics: ['lab/arm0/sampled'],
    part: {kind: 'marks', first: 'a', second: 'b'},
  });
  expect(asked).toHaveLength(1);
  expect(asked[0]?.service).toBe('console/download');
  expect(asked[0]?.request).toMatchObject({
    file: 'run.mcap',
    format: 'csv',
    joined: true,
    rate_hz: 100,
    columns: ['position_m.*'],
    topics: ['lab/arm0/sampled'],
    between: ['a', 'b'],
  });
  expect(fetched).toEqual(['/download/t1/run.csv run.csv']);
  expect(made.making.value.size).toBe(0);
});

it('shows the progress, and cancels', async () => {
  let end: (reply: Json) => void = () => undefined;
  const {made, asked} = exportsOf((service) =>
    service === 'console/download' ? new Promise<Json>((resolve) => (end = resolve)) : {part: 0.25},
  );
  const done = made.table('run.mcap', kWhole);
  await new Promise((resolve) => setTimeout(resolve, 600));
  const making = made.making.value.get('run.mcap');
  expect(making?.part).toBe(0.25);
  await made.table('run.mcap', kWhole);
  expect(asked.filter(({service}) => service === 'console/download')).toHaveLength(1);
  made.cancel('run.mcap');
  expect(asked.at(-1)).toEqual({service: 'console/download_cancel', request: {id: making?.id}});
  end(kReply);
  await done;
});

it('tells why there is no table, and what a table lacks', async () => {
  const refused = exportsOf(() => {
    throw new Error('no column is like x');
  });
  await refused.made.table('run.mcap', kWhole);
  expect(refused.tell.problem.value).toBe('no column is like x');
  expect(refused.fetched).toEqual([]);
  const partly = exportsOf(() => ({...kReply, left_out: [{topic: 'lab/odd'}]}));
  await partly.made.table('run.mcap', kWhole);
  expect(partly.tell.problem.value).toContain('lab/odd');
  expect(partly.fetched).toHaveLength(1);
});
