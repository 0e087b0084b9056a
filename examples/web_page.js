// Shows an arm live in a browser, through the console's gateway. The build puts this page and the
// package rtpm for TypeScript into one folder. First: rtpm up examples/laboratory.toml
//
//     rtpm-console --port 0 --page build/dev/examples/page      then open /web_page.html?token=…
import {Device, Node} from './rtpm/src/browser/index.js';

const kName = new URLSearchParams(location.search).get('device') ?? 'lab/arm0';
const kSeconds = 10;
const kCurves = [
  {id: 'position', colour: '#0b6bcb', unit: 'mm', range: 40, of: (s) => 1000 * s.positionM.z},
  {id: 'force', colour: '#c2410c', unit: 'N', range: 8, of: (s) => s.forceNewton.z},
];
const byId = (id) => document.getElementById(id);
const history = []; // {time, values}, of the last seconds

function draw(now) {
  const canvas = byId('plot');
  const pen = canvas.getContext('2d');
  const {width, height} = canvas;
  pen.clearRect(0, 0, width, height);
  pen.fillStyle = '#eef2f6'; // Below z = 0 is the wall, if a program renders one.
  pen.fillRect(0, height / 2, width, height / 2);
  kCurves.forEach(({colour, range}, i) => {
    pen.strokeStyle = colour;
    pen.lineWidth = 2;
    pen.beginPath();
    for (const {time, values} of history) {
      const x = width * (1 - (now - time) / 1000 / kSeconds);
      pen.lineTo(x, (height / 2) * (1 - values[i] / range));
    }
    pen.stroke();
  });
}

function show(sample) {
  const now = performance.now();
  history.push({time: now, values: kCurves.map((curve) => curve.of(sample))});
  while (now - history[0].time > 1000 * kSeconds) history.shift();
  kCurves.forEach(({id, colour, unit}, i) => {
    byId(id).textContent = `${id} z ${history.at(-1).values[i].toFixed(2)} ${unit}`;
    byId(id).style.color = colour;
  });
  draw(now);
}

async function follow(node) {
  const device = await Device.open(node, kName);
  byId('stop').onclick = () => device.emergencyStop().catch(tell); // Needs no lease.
  const {model} = await device.describe();
  byId('name').textContent = `${kName}: ${model}`;
  for await (const sample of device.samples({intervalMs: 33})) {
    byId('problem').textContent = '';
    show(sample);
  }
}

function tell(error) {
  byId('problem').textContent = error.message;
}

byId('name').textContent = kName;
const node = new Node(); // The gateway and the token of this page's address.
for (;;) {
  await follow(node).catch(tell); // The device's server may start again.
  await new Promise((resolve) => setTimeout(resolve, 1000));
}
