// The web page of the package rtpm that shows a device (clients/typescript/examples/device.html),
// served by the console, through whose gateway it calls.
import assert from 'node:assert/strict';
import {cpSync, mkdirSync} from 'node:fs';
import {after, before, describe, it} from 'node:test';
import {keep, launch, until} from './browser.mjs';
import {System} from './programs.mjs';

const artefacts = process.env.RTPM_ARTEFACTS;
const folder = `${process.env.RTPM_SCRATCH}/page`;
const system = new System();
let browser;
let page;

before(async () => {
  const built = process.env.RTPM_TYPESCRIPT;
  mkdirSync(folder, {recursive: true});
  cpSync(`${built}/examples`, folder, {recursive: true});
  for (const part of ['src', 'idl'])
    cpSync(`${built}/dist/${part}`, `${folder}/rtpm/${part}`, {recursive: true});
  [, browser] = await Promise.all([
    system.startWithPage(folder),
    launch(process.env.RTPM_CHROMIUM),
  ]);
  page = await browser.newPage({viewport: {width: 700, height: 400}});
  page.faults = [];
  page.on('pageerror', (error) => page.faults.push(String(error)));
});
after(async () => {
  await browser?.close();
  await system.end();
});

const address = (token) => {
  const url = new URL('/device.html', system.url);
  if (token) url.searchParams.set('token', new URL(system.url).searchParams.get('token'));
  return url.href;
};
const problem = () => page.locator('#problem').textContent();
const numbers = async (row) =>
  (await page.locator(`#${row} td + td`).allTextContents()).map((text) => Number(text || NaN));

describe('the page of a device', () => {
  it('shows how the device moves', async () => {
    await page.goto(address(true));
    const first = await until('a position', () => numbers('position'), ([x]) => !Number.isNaN(x));
    await until('a move', () => numbers('position'), (now) => String(now) !== String(first));
    assert.match(await page.locator('h1').textContent(), /^lab\/arm0, .+/);
    assert.equal(await problem(), '');
    await keep(page, artefacts, 'device');
  });

  it('holds no lease', async () => {
    const other = await page.evaluate(async () => {
      const rtpm = await import('./rtpm/src/browser/index.js');
      const node = new rtpm.Node();
      const device = await rtpm.Device.open(node, 'lab/arm0');
      const lease = await device.acquire();
      await lease.close();
      await node.close();
      return 'acquired';
    });
    assert.equal(other, 'acquired');
  });

  it('stops the device', async () => {
    await page.locator('#stop').click();
    const refusal = () =>
      page.evaluate(async () => {
        const {Device, Node} = await import('./rtpm/src/browser/index.js');
        const node = new Node();
        const device = await Device.open(node, 'lab/arm0');
        const lease = await device.acquire({patienceMs: 1000});
        const force = lease.force({x: 0, y: 0, z: 1}, 20, {deadlineMs: 2000});
        const outcome = await force.catch((error) => error.outcome);
        await lease.close();
        await node.close();
        return outcome;
      });
    await until('a refusal', refusal, (outcome) => outcome === 'EmergencyStop');
  });

  it('says that the device is gone', async () => {
    await system.devices.end();
    await until('a problem', problem, (text) => text !== '');
    await keep(page, artefacts, 'device-problem');
  });

  it('says what is wrong without the token', async () => {
    await page.goto(address(false));
    assert.match(await until('a problem', problem, (text) => text !== ''), /token/);
    assert.deepEqual(page.faults, []);
  });
});
