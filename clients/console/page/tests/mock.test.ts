import {spawn, type ChildProcess} from 'node:child_process';
import {fileURLToPath} from 'node:url';
import {signal} from '@preact/signals';
import {afterAll, beforeAll, expect, it} from 'vitest';
import {WebSocket} from 'ws';
import {length} from '../src/model/sample';
import {kSubprotocols, type Socket} from '../src/protocol/client';
import {App} from '../src/store/app';
import {Link} from '../src/store/link';

/** The page's stores beside the mock, over a real connection. */

let mock: ChildProcess;
let app: App;

function until(isTrue: () => boolean): Promise<void> {
  return new Promise((resolve) => {
    const timer = setInterval(() => {
      if (!isTrue()) return;
      clearInterval(timer);
      resolve();
    }, 10);
  });
}

beforeAll(async () => {
  const path = fileURLToPath(new URL('../mock/server.mjs', import.meta.url));
  mock = spawn(process.execPath, [path, '0'], {stdio: ['ignore', 'pipe', 'inherit', 'ipc']});
  const port = await new Promise<string>((resolve) =>
    mock.stdout?.on('data', (text: Buffer) => resolve(/:(\d+)\//.exec(text.toString())?.[1] ?? '')),
  );
  const link = new Link({
    open: () =>
      new WebSocket(`ws://127.0.0.1:${port}/?token=mock`, kSubprotocols) as unknown as Socket,
    nowMs: () => performance.now(),
  });
  app = new App(link, signal({view: 'live', subject: ''}), () => performance.now());
  link.start();
  await until(() => app.state.value !== null);
});

afterAll(() => {
  app.link.stop();
  mock.kill();
});

it('sees devices, their motion and what they touch', async () => {
  expect(app.mayCommand.value).toBe(true);
  expect(app.devices.value.map((one) => one.name)).toContain('lab/arm0');
  const track = () => app.live.track('lab/arm0');
  await until(() => (track()?.series.size ?? 0) > 30 && (track()?.touch ?? null) !== null);
  expect(track()?.touch?.shape).toBe('sphere');
  expect(app.live.track('lab/biometric0')?.sample?.analogs[0]).toBeCloseTo(1.2, 0);
});

it('takes no samples while the page is hidden', async () => {
  app.setVisible(false);
  await until(() => app.link.isLive);
  const before = app.live.track('lab/arm0')?.sampleMs;
  const seen = app.state.value;
  await until(() => app.state.value !== seen);
  expect(app.live.track('lab/arm0')?.sampleMs).toBe(before);
  app.setVisible(true);
  await until(() => app.live.track('lab/arm0')?.sampleMs !== before);
});

it('changes a parameter, and the force follows', async () => {
  const form = app.form('lab/servo');
  await form.refresh();
  const stiffness = form.list.value?.parameters[0];
  if (stiffness === undefined) throw new Error('no parameter');
  form.type(stiffness, '0');
  await form.apply();
  expect(form.verdict.value?.isGood).toBe(true);
  await until(() => length(app.live.track('lab/arm0')?.sample?.forceNewton ?? [1, 1, 1]) === 0);
});

it('runs a calibration to its end', async () => {
  const calibration = app.calibration('lab/arm0');
  await calibration.open();
  await calibration.start(calibration.offers.value[0]?.name ?? '');
  expect(calibration.run.value?.phase).toBe('Prompt');
  await calibration.answer('continue');
  await until(() => calibration.run.value?.phase === 'Done');
  await calibration.keep();
  expect(calibration.run.value?.phase).toBe('Kept');
  // Kept means kept: it is there after the next start of the server, too.
  expect(calibration.isSaved.value).toBe(true);
  expect(calibration.problem.value).toBe('');
});

it('says that a result which is not saved is lost at the next start', async () => {
  const calibration = app.calibration('lab/arm0');
  mock.send({refuses_save: true});
  await calibration.open();
  await calibration.start(calibration.offers.value[0]?.name ?? '');
  await calibration.answer('continue');
  await until(() => calibration.run.value?.phase === 'Done');
  await calibration.keep();
  expect(calibration.run.value?.phase).toBe('Kept');
  expect(calibration.isSaved.value).toBe(false);
  expect(calibration.problem.value).toContain('not saved');
});

it('stops, shows it latched, and rearms', async () => {
  await app.stop.press();
  expect(app.stop.report.value.phase).toBe('done');
  await until(() => app.stopped.value.length === 4);
  await app.commands.run('rearm', 'lab/arm0');
  await until(() => app.stopped.value.length === 3);
});

it('is refused while another browser operates the device, unless forced', async () => {
  mock.send({device: 'lab/arm0', is_operated_elsewhere: true});
  await until(() => app.state.value !== null);
  expect(await app.commands.run('take_over', 'lab/arm0')).toBe(false);
  expect(app.commands.refusals.value.get('lab/arm0')).toMatchObject({isForceable: true});
  expect(await app.commands.run('take_over', 'lab/arm0', true)).toBe(true);
});

it('records a session, replays and seeks', async () => {
  const session = {
    participant: 'P07',
    experiment: 'touch',
    condition: '',
    notes: '',
    pattern: '',
    devices: [],
    media: [],
  };
  expect(await app.recordings.startSession(session)).toBe(true);
  await until(() => app.state.value?.recording.session?.participant === 'P07');
  await app.recordings.stop();
  const made = app.recordings.entries.value?.[0];
  expect(await app.recordings.open('run-1.mcap')).toBe(true);
  app.showsReplay.value = true;
  await until(() => (app.shown.track('lab/arm0')?.series.size ?? 0) > 5);
  const replay = app.state.value?.replay;
  await app.recordings.seek((replay?.beginNs ?? 0) + 20e9);
  await until(() => (app.state.value?.replay?.timeNs ?? 0) >= (replay?.beginNs ?? 0) + 20e9);
  await app.recordings.close();
  await until(() => app.state.value?.replay === null);
  expect(app.showsReplay.value).toBe(false);
  expect(made?.isComplete).toBe(true);
});

it('points at what is wrong with a filter', async () => {
  await app.log.set('type(a) and force.zz > 2');
  expect(app.log.fault.value).toMatchObject({offset: 12});
  await app.log.set('all');
  expect(app.log.filter.value).toBe('all');
  expect(app.log.fault.value).toBeNull();
});

it('marks moments and trials, and gets them back with their length', async () => {
  await until(() => app.link.services.value.has('console/mark'));
  expect(await app.markers.mark({label: 'yawns'})).toBe(true);
  expect(await app.markers.mark({phase: 'begin', number: 1, condition: 'soft'})).toBe(true);
  expect(await app.markers.mark({phase: 'end', number: 1, response: 'left'})).toBe(true);
  await until(() => app.markers.live.rows.value.length === 3);
  expect(app.markers.live.trials.value).toMatchObject([{number: 1, response: 'left'}]);
  expect(app.markers.nextNumber.value).toBe(2);
});
