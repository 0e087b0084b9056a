// Downloads of a recording on the console's page: as it is, as one table, and as tables in a ZIP.
import assert from 'node:assert/strict';
import {readdirSync, readFileSync} from 'node:fs';
import {after, before, it} from 'node:test';
import {crc32, inflateRawSync} from 'node:zlib';
import {accessibilityFaults, keep, launch, open, show, smallTargets, until} from './browser.mjs';
import {System} from './programs.mjs';

const artefacts = process.env.RTPM_ARTEFACTS;
const recordings = `${process.env.RTPM_SCRATCH}/recordings`;
const system = new System();
let browser;
let page;
let file;

const button = (name) => page.getByRole('button', {name, exact: true});
const form = () => page.locator('.export-form');

/** The file that the browser saves after `work`. */
async function saved(work) {
  const [download] = await Promise.all([page.waitForEvent('download'), work()]);
  const path = await download.path();
  return {name: download.suggestedFilename(), url: download.url(), bytes: readFileSync(path)};
}

/** The files of a ZIP file by name, each checked. */
function unzipped(bytes) {
  const files = new Map();
  for (let at = 0; bytes.readUInt32LE(at) === 0x04034b50;) {
    const checksum = bytes.readUInt32LE(at + 14);
    const nameSize = bytes.readUInt16LE(at + 26);
    const name = bytes.toString('utf8', at + 30, at + 30 + nameSize);
    const packedSize = Number(bytes.readBigUInt64LE(at + 30 + nameSize + 12));
    const begin = at + 30 + nameSize + bytes.readUInt16LE(at + 28);
    const content = inflateRawSync(bytes.subarray(begin, begin + packedSize));
    assert.equal(crc32?.(content) ?? checksum, checksum, name);
    files.set(name, content.toString());
    at = begin + packedSize;
  }
  return files;
}

before(async () => {
  await system.start();
  browser = await launch(process.env.RTPM_CHROMIUM);
  page = await open(browser, system.url);
  await show(page, 'recordings');
  await page.getByTestId('record').click();
  await until(
    'samples',
    () => page.locator('.record-facts').textContent(),
    (text) => /[1-9]\d{2,} messages|\d,\d{3} messages|\d\s\d{3} messages/.test(text),
  );
  await page.getByTestId('record').click();
  file = await until('the recording', () =>
    readdirSync(recordings).find((one) => one.endsWith('.mcap')),
  );
  await button(`CSV of ${file}`).waitFor();
});

after(async () => {
  await browser?.close();
  await system.end();
});

it('saves the recording itself', async () => {
  const {name, bytes} = await saved(() => button(`Download ${file}`).click());
  assert.equal(name, file);
  assert.ok(bytes.equals(readFileSync(`${recordings}/${file}`)));
});

it('saves one table by one click, once', async () => {
  const {name, url, bytes} = await saved(() => button(`CSV of ${file}`).click());
  assert.equal(name, file.replace('.mcap', '.csv'));
  const [header, ...rows] = bytes.toString().trimEnd().split('\r\n');
  assert.ok(header.startsWith('time [UTC],seconds [s],'));
  for (const column of ['lab/arm0.position_m.x', 'lab/arm1.position_m.x']) {
    assert.ok(header.split(',').includes(column), header);
  }
  assert.ok(rows.length > 50);
  const times = rows.map((row) => row.slice(0, row.indexOf(',')));
  assert.deepEqual(times, [...new Set(times)].sort());
  assert.equal((await fetch(url)).status, 404);
});

it('saves the tables that are chosen', async () => {
  await button(`Choose the tables of ${file}`).click();
  await form().getByText('lab/arm0/sampled').waitFor();
  assert.deepEqual(await accessibilityFaults(page), []);
  await keep(page, artefacts, 'export-form');
  await form().getByRole('button', {name: 'One per topic'}).click();
  const {name, bytes} = await saved(() => form().getByRole('button', {name: 'Make CSV'}).click());
  assert.equal(name, file.replace('.mcap', '.zip'));
  const files = unzipped(bytes);
  assert.ok(files.has('lab_arm0_sampled.csv'), [...files.keys()].join());
  assert.match(files.get('lab_arm0_sampled.csv'), /^time \[UTC\],seconds \[s\],message,sequence,/);
  assert.ok(JSON.parse(files.get('recording.json')).channels.length > 5);
  // Nothing remains beside the recordings.
  await until(
    'the end of all tables',
    () => readdirSync(recordings).length,
    (count) => count === 1,
  );
});

it('tells which column is meant', async () => {
  await button(`Choose the tables of ${file}`).click();
  await form().getByRole('textbox', {name: 'Columns'}).fill('position_n.x');
  await form().getByRole('button', {name: 'Make CSV'}).click();
  await page.keyboard.press('Escape');
  await page.getByRole('alert').getByText("did you mean 'position_m.x'").waitFor();
  assert.deepEqual(page.faults, []);
});

it('fits a phone, in the dark', async () => {
  await page.setViewportSize({width: 390, height: 844});
  await page.emulateMedia({colorScheme: 'dark'});
  await button(`Choose the tables of ${file}`).click();
  await form().waitFor();
  const [width, room] = await page.evaluate(() => [
    document.documentElement.scrollWidth,
    document.documentElement.clientWidth,
  ]);
  assert.ok(width <= room, `${width} > ${room}`);
  assert.deepEqual(await smallTargets(page), []);
  await keep(page, artefacts, 'export-form-phone-dark');
});
