import {describe, expect, it} from 'vitest';
import {configNames, Form} from '../src/forms/form';
import {readParameterList, type Parameter} from '../src/forms/parameter';
import {check, lockOf, rangeText, valueText} from '../src/forms/validate';
import {parseJson, type Json, type JsonObject} from '../src/protocol/json';
import {fixture} from './recorded';

/** The list of the simulated arm, as `rtpm call lab/arm0/config list --json` printed it. */
const kList = parseJson(fixture('arm_config_list.json'));

function parameter(name: string): Parameter {
  const found = readParameterList(kList).parameters.find((one) => one.name === name);
  if (found === undefined) throw new Error(name);
  return found;
}

/** A server that answers `list` with `list`, and all else as it is told. */
class Server {
  readonly requests: {method: string; request: Json}[] = [];
  list = kList;
  reply: Json = {answer: {}};

  readonly call = (method: string, request: Json): Promise<Json> => {
    if (method === 'list') return Promise.resolve(this.list);
    this.requests.push({method, request});
    return Promise.resolve(this.reply);
  };

  set(name: string, real: number, revision: bigint): void {
    const list = this.list as JsonObject;
    const parameters = (list['parameters'] as JsonObject[]).map((one) =>
      one['name'] === name ? {...one, value: {type: 'Real', real}} : one,
    );
    this.list = {...list, revision, parameters};
  }
}

async function opened(): Promise<{form: Form; server: Server}> {
  const server = new Server();
  const form = new Form('lab/arm0', server.call);
  await form.refresh();
  return {form, server};
}

describe('descriptions of parameters', () => {
  it('are read as the server sends them', () => {
    expect(readParameterList(kList).revision).toBe(17259269746184945665n);
    expect(parameter('encoder.resolution_m').high).toBe(Infinity);
    expect(parameter('safety.watchdog').choices).toEqual(['ramp', 'off']);
    expect(valueText(parameter('workspace.low_m').value)).toBe('-0.1, -0.1, -0.1');
  });

  it('may leave out what is the default of FlatBuffers', () => {
    const list = readParameterList({parameters: [{name: 'is_on', default_value: {}, value: {}}]});
    expect(list.parameters[0]).toMatchObject({
      type: 'Bool',
      value: false,
      mutability: 'AnyTime',
      low: 0,
    });
    expect(list.isActive).toBe(false);
  });
});

describe('what is typed', () => {
  it.each([
    ['safety.ramp_s', '0.01', 0.01],
    ['safety.ramp_s', ' 2e-3 ', 0.002],
    ['safety.ramp_s', '0', 0],
    ['velocity.cycle_count', '8', 8],
    ['workspace.low_m', '-0.1 -0.05, 0', [-0.1, -0.05, 0]],
    ['safety.watchdog', 'off', 'off'],
  ])('is taken: %s %s', (name, draft, value) => {
    expect(check(parameter(name), draft)).toEqual({isValid: true, value});
  });

  it.each([
    ['safety.ramp_s', '0.021', '0.021 is above the range: 0 to 0.02 s.'],
    ['safety.ramp_s', '-1', '-1 is below the range: 0 to 0.02 s.'],
    ['safety.ramp_s', '', 'Type a number.'],
    ['safety.ramp_s', '1,500', 'is not a number'],
    ['safety.ramp_s', '0x1', 'is not a number'],
    ['safety.ramp_s', '1e999', 'too large'],
    ['velocity.cycle_count', '2.5', 'Type a whole number.'],
    ['velocity.cycle_count', '9', 'above the range: 1 to 8'],
    ['workspace.low_m', '0 0', 'Type 3 numbers; there are 2.'],
    ['workspace.low_m', '0 0.2 0', 'Number 2: 0.2 is above'],
    ['safety.watchdog', 'maybe', 'Choose one of: ramp, off.'],
  ])('is refused with a reason: %s "%s"', (name, draft, reason) => {
    const checked = check(parameter(name), draft);
    expect(checked.isValid ? '' : checked.problem).toContain(reason);
  });

  it('has its range said as people read it', () => {
    expect(rangeText(parameter('safety.power_watt_max'))).toBe('0.09 to 9 W');
    expect(rangeText(parameter('encoder.resolution_m'))).toBe('at least 0 m');
    expect(rangeText(parameter('safety.watchdog'))).toBe('');
  });

  it('is not taken where the parameter is locked', () => {
    expect(lockOf(parameter('encoder.resolution_m'), false)).toContain('Read only');
    expect(lockOf(parameter('velocity.cycle_count'), true)).toContain('deactivate');
    expect(lockOf(parameter('velocity.cycle_count'), false)).toBeNull();
  });
});

describe('Form', () => {
  it('applies all changes at once, on the revision that it saw', async () => {
    const {form, server} = await opened();
    form.type(parameter('safety.ramp_s'), '0.01');
    form.type(parameter('safety.watchdog'), 'off');
    await form.apply();
    expect(server.requests).toEqual([
      {
        method: 'apply',
        request: {
          revision: 17259269746184945665n,
          settings: [
            {name: 'safety.ramp_s', value: {type: 'Real', real: 0.01}},
            {name: 'safety.watchdog', value: {type: 'Text', text: 'off'}},
          ],
        },
      },
    ]);
    expect(form.drafts.value.size).toBe(0);
    expect(form.verdict.value).toEqual({isGood: true, words: 'Applied 2 changes to lab/arm0.'});
  });

  it('sends nothing that is out of range', async () => {
    const {form, server} = await opened();
    form.type(parameter('safety.ramp_s'), '3');
    expect(form.changes.value).toEqual([]);
    expect(form.invalidCount.value).toBe(1);
    await form.apply();
    expect(server.requests).toEqual([]);
  });

  it("shows the server's refusal at the field, and keeps the draft", async () => {
    const {form, server} = await opened();
    server.reply = {
      answer: {
        outcome: 'RefusedByDevice',
        parameter: 'safety.ramp_s',
        what: 'safety.ramp_s',
        why: 'too short for this arm',
        remedy: 'choose 5 ms or more.',
      },
    };
    form.type(parameter('safety.ramp_s'), '0.001');
    await form.apply();
    expect(form.refusals.value.get('safety.ramp_s')).toBe(
      'safety.ramp_s: too short for this arm. Choose 5 ms or more.',
    );
    expect(form.draftOf(parameter('safety.ramp_s'))).toBe('0.001');
    form.type(parameter('safety.ramp_s'), '0.005');
    expect(form.refusals.value.size).toBe(0);
  });

  it('shows a refusal of several together at each of them', async () => {
    const {form, server} = await opened();
    server.reply = {
      answer: {
        outcome: 'RefusedByDevice',
        what: 'workspace.low_m is above workspace.high_m in a direction',
      },
    };
    form.type(parameter('workspace.low_m'), '0.09 0.09 0.09');
    form.type(parameter('workspace.high_m'), '-0.09 -0.09 -0.09');
    await form.apply();
    expect([...form.refusals.value.keys()]).toEqual(['workspace.low_m', 'workspace.high_m']);
  });

  it('says that another client was first, shows its values, and keeps the draft', async () => {
    const {form, server} = await opened();
    form.type(parameter('safety.ramp_s'), '0.01');
    server.set('safety.ramp_s', 0.015, 5n);
    server.reply = {answer: {outcome: 'StaleRevision'}, revision: 5};
    await form.apply();
    const now = form.list.value?.parameters.find((one) => one.name === 'safety.ramp_s');
    expect(form.verdict.value?.isGood).toBe(false);
    expect(form.verdict.value?.words).toContain('another client');
    expect(form.conflictOf(now as Parameter)).toContain('from 0.02 to 0.015');
    expect(form.draftOf(now as Parameter)).toBe('0.01');
  });

  it('keeps what was typed while the device is gone', async () => {
    const server = new Server();
    let isGone = false;
    const form = new Form('lab/arm0', (method, request) =>
      isGone ? Promise.reject(new Error('the connection is lost')) : server.call(method, request),
    );
    await form.refresh();
    form.type(parameter('safety.ramp_s'), '0.01');
    isGone = true;
    await form.refresh();
    await form.apply();
    expect(form.problem.value).toContain('lost');
    expect(form.verdict.value).toEqual({isGood: false, words: 'the connection is lost'});
    isGone = false;
    await form.refresh();
    expect(form.problem.value).toBe('');
    expect(form.draftOf(parameter('safety.ramp_s'))).toBe('0.01');
    expect(form.changes.value.map((one) => one.name)).toEqual(['safety.ramp_s']);
  });

  it('forgets a draft that is typed back', async () => {
    const {form} = await opened();
    form.type(parameter('safety.ramp_s'), '0.01');
    form.type(parameter('safety.ramp_s'), '0.02');
    expect(form.drafts.value.size).toBe(0);
  });

  it('finds what has parameters by the services', () => {
    const services = new Set([
      'console/estop',
      'lab/servo/config/list',
      'lab/arm0/config/list',
      'lab/arm0/config/apply',
      'lab/arm0/read',
    ]);
    expect(configNames(services)).toEqual(['lab/arm0', 'lab/servo']);
  });
});
