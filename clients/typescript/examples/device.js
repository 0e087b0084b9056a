// Shows a device: rtpm-console --page FOLDER serves device.html, this file and, as rtpm/, the
// package's folder dist. Open device.html?token=…&device=lab/arm0. It reads, and holds no lease.
import { Device, Node } from "./rtpm/src/browser/index.js";

const name = new URLSearchParams(location.search).get("device") ?? "lab/arm0";
const byId = (id) => document.getElementById(id);

function show(id, { x, y, z }, factor) {
  const cells = byId(id).querySelectorAll("td + td");
  [x, y, z].forEach((value, i) => (cells[i].textContent = (value * factor).toFixed(2)));
}

async function follow(node) {
  const device = await Device.open(node, name);
  byId("stop").onclick = () => device.emergencyStop().catch(tell);
  const { model } = await device.describe();
  byId("name").textContent = `${name}, ${model}`;
  for await (const sample of device.samples({ intervalMs: 30 })) {
    byId("problem").textContent = "";
    show("position", sample.positionM, 1000);
    show("force", sample.forceNewton, 1);
  }
}

function tell(error) {
  byId("problem").textContent = error.message;
}

byId("name").textContent = name;
const node = new Node();
for (;;) {
  await follow(node).catch(tell);
  await new Promise((resolve) => setTimeout(resolve, 1000));
}
