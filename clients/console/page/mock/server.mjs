// Speaks to the page as rtpm-console does (clients/console/README.md), of a system of its own that
// moves. For work on the page; usage:
// node mock/server.mjs [PORT] [NAME OF A LOST DEVICE] [--devices=200]
import {createReadStream} from 'node:fs';
import {createServer} from 'node:http';
import {fileURLToPath} from 'node:url';
import {WebSocketServer} from 'ws';
import {Reviews} from './review.mjs';
import {picturePayloads, samplePayload, schemas, touchPayload} from './payloads.mjs';
import {System} from './system.mjs';

const kCountOption = '--devices=';
const options = process.argv.slice(2);
const places = options.filter((one) => !one.startsWith('--'));
const count = options.find((one) => one.startsWith(kCountOption))?.slice(kCountOption.length);
const port = Number(places[0] ?? 8765);
const system = new System(Number(count ?? 0));
if (places[1]) system.lose(places[1]);
const start = Date.now();
const kSource = 3571832195; // lab/arm0
let recording = null;
let replay = null;
const marks = [];
const files = [
  {
    file: 'run-1.mcap',
    byte_count: 5_242_880,
    begin_ns: (start - 600_000) * 1e6,
    end_ns: (start - 570_000) * 1e6,
    message_count: 92_114,
    is_complete: true,
    session: {participant: 'P07', experiment: 'stiffness', condition: 'soft first'},
  },
  {
    file: 'run-2.mcap',
    byte_count: 4_294_967_296,
    begin_ns: (start - 4_200_000) * 1e6,
    end_ns: (start - 600_000) * 1e6,
    message_count: 18_400_221,
    is_complete: true,
    session: {participant: 'P08', experiment: 'stiffness', condition: 'stiff first'},
  },
];
const reviews = new Reviews(files);
const kReviewServices = reviews.services();

const nowNs = (agoS) => (start - agoS * 1000) * 1e6;
const incidents = [
  {who: 'lab/arm0', what: 'lost', why: 'its server hangs', severity: 'alarm', agoS: 90, lastsS: 30},
  {who: 'disk', what: 'disk low', why: '812 MiB are free', severity: 'warning', agoS: 60},
  {who: 'lab/arm0', what: 'lease', why: 'free → Anna', severity: 'info', agoS: 20, lastsS: 0.001},
].map(({agoS, lastsS, ...one}, i) => ({
  id: i + 1,
  ...one,
  since_ns: nowNs(agoS),
  until_ns: lastsS === undefined ? 0 : nowNs(agoS - lastsS),
  count: 1,
  recording: i === 0 ? 'run-1.mcap' : '',
}));
const listed = () => ({incidents, count: incidents.length, dropped_count: 0});
const unseen = () => incidents.filter((one) => !one.acknowledged_ns && one.severity !== 'info');

const channels = [];
function addChannel(topic, schemaName = '') {
  channels.push({
    id: channels.length + 1,
    topic,
    encoding: schemaName ? 'flatbuffer' : 'json',
    schemaName,
    schema: schemas[schemaName] ?? '',
    ...(schemaName ? {schemaEncoding: 'flatbuffer'} : {}),
  });
}
['console/state', 'console/latency', 'console/log', 'console/marks', 'console/incidents'].forEach(
  (topic) => addChannel(topic),
);
system.devices.forEach(({name}) => addChannel(`${name}/sample`, 'rtpm.device.Sampled'));
addChannel(`rtpm.touch.Touched/${kSource}`, 'rtpm.touch.Touched');
addChannel('lab/cam0/video', 'foxglove.CompressedImage');
const kLiveCount = channels.length;

const services = [
  ...[
    'estop',
    'rearm',
    'take_over',
    'release',
    'activate',
    'deactivate',
    'recover',
    'dismiss',
    'operator',
    'lease_request',
    'lease_answer',
    'lease_keep',
    'incidents',
    'incident_acknowledge',
    'log_filter',
    'fields',
    'history',
    'record_start',
    'record_stop',
    'session_start',
    'session_stop',
    'mark',
    'recordings',
    'download',
    'download_choices',
    'download_progress',
    'download_cancel',
    'replay_open',
    'replay_seek',
    'replay_play',
    'replay_pause',
    'replay_close',
    ...Object.keys(kReviewServices),
  ].map((name) => `console/${name}`),
  ...Object.keys(system.lists).flatMap((name) =>
    [
      'list',
      'apply',
      'save',
      'reset',
      'calibrations',
      'calibrate',
      'calibration',
      'answer',
      'keep',
      'discard',
    ].map((method) => `${name}/config/${method}`),
  ),
].map((name, i) => ({
  id: i + 1,
  name,
  type: name,
  request: {encoding: 'json', schemaName: name, schema: ''},
  response: {encoding: 'json', schemaName: name, schema: ''},
}));

// The built page beside it, for looking at it without the rest of RTPM.
const kTypes = {html: 'text/html', js: 'text/javascript', css: 'text/css', svg: 'image/svg+xml'};
const pages = createServer((request, response) => {
  const path = new URL(request.url, 'http://mock').pathname.replace(/\/$/, '/index.html');
  const file = createReadStream(fileURLToPath(new URL(`../dist${path}`, import.meta.url)));
  file.on('error', () => response.writeHead(404).end());
  file.on('open', () => {
    response.setHeader(
      'content-type',
      kTypes[path.split('.').at(-1)] ?? 'application/octet-stream',
    );
    file.pipe(response);
  });
}).listen(port, '127.0.0.1', () =>
  console.log(`mock of rtpm-console at http://127.0.0.1:${pages.address().port}/?token=mock`),
);
const server = new WebSocketServer({
  server: pages,
  handleProtocols: (offered) => (offered.has('foxglove.sdk.v1') ? 'foxglove.sdk.v1' : false),
});
const clients = new Set();

function publish(topic, payload, timeMs = Date.now()) {
  const channel = channels.find((one) => one.topic === topic);
  const body = Buffer.isBuffer(payload) ? payload : Buffer.from(JSON.stringify(payload));
  for (const client of clients) {
    for (const [subscription, channelId] of client.subscriptions) {
      if (channelId !== channel?.id) continue;
      const head = Buffer.alloc(13);
      head.writeUInt8(1, 0);
      head.writeUInt32LE(subscription, 1);
      head.writeBigUInt64LE(BigInt(Math.round(timeMs * 1e6)), 5);
      client.socket.send(Buffer.concat([head, body]));
    }
  }
}

function isSubscribed(topic) {
  const channel = channels.find((one) => one.topic === topic);
  return [...clients].some((one) => [...one.subscriptions.values()].includes(channel?.id));
}

function broadcast(message) {
  clients.forEach(({socket}) => socket.send(JSON.stringify(message)));
}

const kCommands = {
  estop({device}) {
    const asked = system.devices.filter((one) => !device || one.name === device);
    const stopped = asked.filter((one) => one.lost_for_s === null);
    stopped.forEach((one) => Object.assign(one, {is_stopped: true, faults: ['emergency stop']}));
    const failed = asked
      .filter((one) => one.lost_for_s !== null)
      .map(({name, url}) => ({device: name, url, why: 'no server answers at the address'}));
    system.owe(failed);
    return {stopped: stopped.map((one) => one.name), failed, hub_count: 1, notes: []};
  },
  rearm({device}) {
    Object.assign(system.named(device), {is_stopped: false, faults: []});
    return {ok: true};
  },
  take_over({device, force}) {
    const held = system.named(device);
    if (held.is_operated_elsewhere && !force) {
      throw new Error(`another browser (connection 3) operates ${device}; take over first`);
    }
    held.lease = {state: 'held by this console', since_s: 0, ends_in_s: null};
    return {ok: true};
  },
  release({device}) {
    system.named(device).lease = {state: 'free', since_s: null, ends_in_s: null};
    return {ok: true};
  },
  activate({device}) {
    system.named(device).lifecycle = 'active';
    return {ok: true};
  },
  deactivate({device}) {
    system.named(device).lifecycle = 'inactive';
    return {ok: true};
  },
  recover: () => ({ok: true}),
  operator({name, room}, client) {
    Object.assign(client, {name, room});
    return {connection: 1, name, room};
  },
  lease_request({device}) {
    throw new Error(`Ben keeps ${device}`);
  },
  lease_answer: () => ({ok: true}),
  lease_keep: ({keep}) => ({keep}),
  incidents: () => listed(),
  incident_acknowledge({ids, all}, client) {
    if (!client.name) throw new Error('an acknowledgement has a name');
    const wanted = unseen().filter((one) => all || ids.includes(one.id));
    wanted.forEach((one) =>
      Object.assign(one, {acknowledged_by: client.name, acknowledged_ns: Date.now() * 1e6}),
    );
    return {acknowledged: wanted.length};
  },
  dismiss({device}) {
    system.dismiss(device);
    return {ok: true};
  },
  log_filter({filter}, client) {
    const offset = filter === null ? -1 : filter.indexOf('force.zz');
    if (offset >= 0) {
      return {ok: false, offset, what: "unknown field 'force.zz'; did you mean 'force.z'?"};
    }
    client.filter = filter;
    return {ok: true};
  },
  session_start({participant, experiment, condition, notes}) {
    const session = {participant, experiment, condition, notes};
    recording = {file: `session-${files.length + 1}.mcap`, since: Date.now(), session};
    return {file: recording.file};
  },
  session_stop: () => kCommands.record_stop(),
  mark({label = '', phase = 'mark', number = 0, condition = '', response = '', time_ns}) {
    const mark = {time_ns, label, phase, number, source: 0, condition, response};
    if (phase === 'end') {
      const begin = marks.findLast((one) => one.phase === 'begin' && one.number === number);
      if (begin) mark.duration_ns = time_ns - begin.time_ns;
    }
    marks.push(mark);
    publish('console/marks', {marks: [mark], omitted: 0});
    return {ok: true, time_ns};
  },
  fields({query = '', count = 500}) {
    const words = query.toLowerCase().split(' ');
    const fits = ({path}) => words.every((word) => path.toLowerCase().includes(word));
    const found = fields().filter(fits);
    return {fields: found.slice(0, count), total_count: found.length};
  },
  history: ({fields: paths, begin_ns, end_ns, points}) => ({
    begin_ns,
    end_ns,
    columns: paths.map((path) => past(path, begin_ns / 1e9, end_ns / 1e9, points)),
  }),
  record_start() {
    recording = {file: `run-${files.length + 1}.mcap`, since: Date.now()};
    return {file: recording.file};
  },
  record_stop() {
    const end = Date.now();
    const {file, since} = recording;
    recording = null;
    const made = {file, byte_count: (end - since) * 170, message_count: (end - since) * 3};
    files.push({...made, begin_ns: since * 1e6, end_ns: end * 1e6, is_complete: true});
    return {...made, drop_count: 0};
  },
  download({file, format}) {
    if (!files.some((one) => one.file === file)) throw new Error(`there is no recording ${file}`);
    const name = format === 'csv' ? file.replace('.mcap', '.csv') : file;
    return {path: `/download/mock/${name}`, name, byte_count: 0, late_count: 0, left_out: []};
  },
  download_choices: () => ({
    topics: system.devices.map(({name}) => `${name}/sampled`),
    trials: [1, 2],
    conditions: ['soft', 'hard'],
    marks: ['begin', 'touch'],
  }),
  download_progress: () => ({part: 0.5}),
  download_cancel: () => ({}),
  recordings: () => ({files, omitted_count: 0, deleted: reviews.deleted, purged: []}),
  ...kReviewServices,
  replay_open({file}) {
    const found = files.find((one) => one.file === file);
    if (!found) throw new Error(`there is no recording ${file}`);
    const topics = ['rtpm.device.Sampled', 'rtpm.touch.Touched'].map(
      (type) => `${type}/${kSource}`,
    );
    replay = {
      file,
      begin_ns: found.begin_ns,
      end_ns: found.end_ns,
      time_ns: found.begin_ns,
      speed: 1,
      is_playing: false,
      topics,
    };
    topics.forEach((topic) => addChannel(`replay/${topic}`, topic.split('/')[0]));
    broadcast({op: 'advertise', channels: channels.slice(kLiveCount)});
    return {begin_ns: found.begin_ns, end_ns: found.end_ns, topics};
  },
  replay_seek: ({time_ns}) => Object.assign(replay, {time_ns}),
  replay_play: ({speed}) => Object.assign(replay, {is_playing: true, speed}),
  replay_pause: () => Object.assign(replay, {is_playing: false}),
  replay_close() {
    replay = null;
    const gone = channels.splice(kLiveCount);
    broadcast({op: 'unadvertise', channelIds: gone.map((one) => one.id)});
    return {ok: true};
  },
};

/** Some fields of the devices; the units as the console has them. */
function fields() {
  const xyz = (name, unit) => ['x', 'y', 'z'].map((end) => [`${name}.${end}`, unit]);
  return system.devices.flatMap(({name, analogs, joints, force_newton_max}) =>
    [
      ...xyz('position_m', 'm'),
      ...(force_newton_max > 0 ? [...xyz('force_newton', 'N'), ['force_newton.total', 'N']] : []),
      ...joints.map((one) => [`joints.${one.name}`, one.unit]),
      ...analogs.map((one) => [`analogs.${one.name}`, one.unit]),
    ].map(([field, unit]) => ({
      path: `${name}/sampled.${field}`,
      unit,
      device: name,
      label: field,
    })),
  );
}

/** The past of the arm, as if the console had run for ten minutes. */
function past(path, beginS, endS, points) {
  const stepS = Math.max(0.1, (endS - beginS) / points);
  const known = fields().find((one) => one.path === path);
  const axis = 'xyz'.indexOf(path.at(-1));
  const column = {path, known: known !== undefined, unit: known?.unit ?? '', low: [], high: []};
  const steps = [];
  const count = path.startsWith('lab/arm0') && axis >= 0 ? Math.floor((endS - beginS) / stepS) : 0;
  for (let i = 0; i < count; ++i) {
    const timeS = beginS + i * stepS - start / 1000;
    if (timeS < -600) continue;
    const {position, force} = system.arm(timeS);
    const value = (path.includes('force') ? force : position)[axis];
    steps.push(i);
    column.low.push(value);
    column.high.push(value);
  }
  return {...column, first_ns: beginS * 1e9, step_ns: stepS * 1e9, steps};
}

function call(client, serviceId, callId, request) {
  const {name} = services[serviceId - 1];
  const method = name.slice(name.lastIndexOf('/') + 1);
  try {
    const reply = name.startsWith('console/')
      ? kCommands[method](request, client)
      : system.configure(name.slice(0, name.lastIndexOf('/config/')), method, request);
    const encoding = Buffer.from('json');
    const head = Buffer.alloc(13);
    head.writeUInt8(3, 0);
    head.writeUInt32LE(serviceId, 1);
    head.writeUInt32LE(callId, 5);
    head.writeUInt32LE(encoding.length, 9);
    client.socket.send(Buffer.concat([head, encoding, Buffer.from(JSON.stringify(reply))]));
  } catch (error) {
    client.socket.send(
      JSON.stringify({op: 'serviceCallFailure', serviceId, callId, message: error.message}),
    );
  }
}

server.on('connection', (socket, request) => {
  const mayCommand = new URL(request.url, 'http://mock').searchParams.has('token');
  const client = {socket, subscriptions: new Map(), filter: null};
  clients.add(client);
  const send = (message) => socket.send(JSON.stringify(message));
  send({
    op: 'serverInfo',
    name: 'rtpm-console',
    capabilities: ['parameters', 'parametersSubscribe', ...(mayCommand ? ['services'] : [])],
    supportedEncodings: ['json', 'flatbuffer'],
    sessionId: String(start),
    metadata: {
      'rtpm.access': mayCommand ? 'command' : 'observe',
      'rtpm.version': 'mock',
      'rtpm.host': 'lab-pc',
    },
  });
  send({op: 'advertise', channels});
  if (mayCommand) send({op: 'advertiseServices', services});
  socket.on('message', (data, isBinary) => {
    if (isBinary) {
      const encodingSize = data.readUInt32LE(9);
      call(
        client,
        data.readUInt32LE(1),
        data.readUInt32LE(5),
        JSON.parse(data.subarray(13 + encodingSize).toString() || '{}'),
      );
      return;
    }
    const message = JSON.parse(data.toString());
    if (message.op === 'subscribe') {
      message.subscriptions.forEach(({id, channelId}) => client.subscriptions.set(id, channelId));
      const channel = channels.find((one) => one.topic === 'console/marks');
      if (message.subscriptions.some(({channelId}) => channelId === channel.id)) {
        publish('console/marks', {is_first: true, marks, omitted: 0});
      }
    } else if (message.op === 'unsubscribe') {
      message.subscriptionIds.forEach((id) => client.subscriptions.delete(id));
    }
  });
  socket.on('close', () => clients.delete(client));
});

setInterval(() => {
  const now = Date.now();
  const recorded = recording && {
    file: recording.file,
    time_s: (now - recording.since) / 1000,
    message_count: (now - recording.since) * 3,
    byte_count: (now - recording.since) * 170,
    drop_count: 0,
    problem: '',
    session: recording.session ?? null,
    missing: [],
  };
  publish('console/state', {
    time_ns: now * 1e6,
    uptime_s: (now - start) / 1000,
    registry: {url: 'rtpm://127.0.0.1:7420/rtpm/names', ok: true, problem: ''},
    hub: {name: 'rtpm/events', ok: true, problem: '', event_per_s: 3512, ...system.consumers()},
    servers: system.servers(),
    objects: system.objects(),
    devices: system.devices,
    incidents: {
      open_count: incidents.filter((one) => one.until_ns === 0).length,
      unseen_count: unseen().length,
      unseen_alarm: unseen().find((one) => one.severity === 'alarm')?.id ?? 0,
      is_kept: true,
      problem: '',
      torn_count: 0,
    },
    media: [
      {
        name: 'lab/cam0',
        frame: 'cam0_optical',
        width_px: 160,
        height_px: 120,
        rate_hz: 10,
        uncertainty_ns: 5e6,
        lost_count: 0,
        problem: '',
      },
    ],
    not_stopped: system.notStopped,
    recording: recorded ?? {
      file: null,
      time_s: 0,
      message_count: 0,
      byte_count: 0,
      drop_count: 0,
      problem: '',
    },
    replay: replay ?? {file: null},
    history: {byte_count: 12e6, byte_max: 50331648, field_count: 240, dropped_count: 0},
    clients: {count: clients.size, dropped_count: 0},
    events: {channel_count: 1, channel_count_max: 128, omitted_count: 0, dropped_count: 0},
  });
}, 250);

setInterval(
  () => publish('console/latency', system.latency(system.devices.map((one) => one.name))),
  1000,
);

setInterval(() => publish('console/incidents', listed()), 1000);

let pictureCount = 0;
setInterval(() => {
  publish('lab/cam0/video', picturePayloads[++pictureCount % picturePayloads.length]);
}, 100);

function move(time, topicOf, timeMs) {
  const {position, proxy, force, face} = system.arm(time);
  const sequence = Math.round(time * 1000);
  publish(
    topicOf('rtpm.device.Sampled'),
    samplePayload({sequence, time: timeMs / 1000, position, force}),
    timeMs,
  );
  publish(
    topicOf('rtpm.touch.Touched'),
    touchPayload({sequence, device: position, proxy, force, face, shape: 1}),
    timeMs,
  );
  return force;
}

/** Jumps twice a second between points of a field, as eyes do. */
function gaze(time) {
  const jump = Math.floor(2 * time);
  const left = (((jump * 7) % 3) - 1) * 0.09;
  const up = (((jump * 5) % 4) - 1.5) * 0.06;
  return {
    orientation: [
      Math.cos(left) * Math.sin(up),
      Math.sin(left) * Math.cos(up),
      -Math.sin(left) * Math.sin(up),
      Math.cos(left) * Math.cos(up),
    ],
    analogs: [4e-3 + 5e-4 * Math.sin(time)],
  };
}

let wasTouching = false;
setInterval(() => {
  const time = (Date.now() - start) / 1000;
  const force = move(
    time,
    (type) => (type === 'rtpm.device.Sampled' ? 'lab/arm0/sample' : `${type}/${kSource}`),
    Date.now(),
  );
  const still = {sequence: Math.round(time * 1000), time, position: [0, 0, 0], force: [0, 0, 0]};
  publish('lab/gaze0/sample', samplePayload({...still, ...gaze(time)}));
  publish('lab/knob0/sample', samplePayload({...still, joints: [time % 6.28]}));
  publish(
    'lab/biometric0/sample',
    samplePayload({
      ...still,
      analogs: [1.2 + 0.1 * Math.sin(time), 5e-6 + 2e-6 * Math.sin(time / 3)],
    }),
  );
  for (const {name} of system.crowd()) {
    if (!isSubscribed(`${name}/sample`)) continue;
    publish(`${name}/sample`, samplePayload({...still, position: [0.03 * Math.sin(time), 0, 0]}));
  }
  const isTouching = Math.hypot(...force) > 0;
  if (isTouching !== wasTouching && [...clients].some((client) => client.filter !== null)) {
    publish('console/log', {
      time_ns: Date.now() * 1e6,
      type: 'rtpm.device.ContactChanged',
      source: kSource,
      device: 'lab/arm0',
      sequence: still.sequence,
      payload: {cycle: still.sequence, force_newton: Math.hypot(...force), is_touching: isTouching},
    });
  }
  wasTouching = isTouching;
  if (replay?.is_playing) {
    replay.time_ns += (replay.speed * 1e9) / 60;
    if (replay.time_ns >= replay.end_ns)
      Object.assign(replay, {is_playing: false, time_ns: replay.end_ns});
    move(
      (replay.time_ns / 1e9) % 1000,
      (type) => `replay/${type}/${kSource}`,
      replay.time_ns / 1e6,
    );
  }
}, 1000 / 60);

process.on('message', ({device, refuses_save, ...change}) => {
  if (refuses_save === true) system.lists['lab/arm0'].is_persistent = false;
  if (device !== undefined) Object.assign(system.named(device), change);
});
