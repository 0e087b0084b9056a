// Incidents and named operators, by two people at two browsers.
import {strict as assert} from 'node:assert';
import {readFileSync} from 'node:fs';
import {after, before, it} from 'node:test';
import {accessibilityFaults, keep, launch, open, show, smallTargets, until} from './browser.mjs';
import {System} from './programs.mjs';

const {RTPM_ARTEFACTS, RTPM_CHROMIUM} = process.env;
const artefacts = `${RTPM_ARTEFACTS}/incidents`;
const system = new System();
const kSizes = {desktop: {width: 1440, height: 1000}, phone: {width: 390, height: 844}};
let browser;
let anna;
let ben;

// No colour is on its way to another one while axe-core looks.
const named = (name, room) => ({
  reducedMotion: 'reduce',
  storageState: {
    cookies: [],
    origins: [
      {
        origin: new URL(system.url).origin,
        localStorage: [
          {name: 'rtpm.operator', value: name},
          {name: 'rtpm.room', value: room},
        ],
      },
    ],
  },
});

before(async () => {
  await system.start();
  browser = await launch(RTPM_CHROMIUM);
  anna = await open(browser, system.url, named('Anna', 'Room 12'));
  ben = await open(browser, system.url, named('Ben', 'Room 12'));
});
after(async () => {
  await browser?.close();
  await system.end();
  assert.deepEqual([...(anna?.faults ?? []), ...(ben?.faults ?? [])], []);
});

const lease = (page) => page.getByTestId('lease');
const rows = (page, words) => page.getByTestId('incident').filter({hasText: words});

it('another program that holds a device is called by its name and host', async () => {
  await show(anna, 'live/lab/arm0');
  await lease(anna)
    .getByText(/^rtpm-servo on .+, for /)
    .waitFor();
});

it('a device changes hands by request and consent', async () => {
  await show(anna, 'live/lab/knob0');
  await show(ben, 'live/lab/knob0');
  await anna.getByRole('button', {name: 'Take over'}).click();
  await lease(ben)
    .getByText(/^Anna, this room, since \d\d:\d\d, until released$/)
    .waitFor();

  await ben.getByRole('button', {name: 'Ask for it'}).click();
  const asked = anna.getByTestId('asked');
  await asked.getByText('Ben (Room 12) asks for lab/knob0.').waitFor();
  await keep(anna, artefacts, 'asked-desktop-light');
  assert.deepEqual(await accessibilityFaults(anna), []);
  await asked.getByRole('button', {name: 'Keep'}).click();
  await ben.getByText('Anna keeps lab/knob0.').waitFor();
  await keep(ben, artefacts, 'kept-desktop-light');

  await ben.getByRole('button', {name: 'Ask for it'}).click();
  await asked.getByRole('button', {name: 'Hand over'}).click();
  await ben.getByText('It was handed over to you.').waitFor();
  await lease(anna)
    .getByText(/^Ben, this room/)
    .waitFor();
  await ben.getByRole('button', {name: 'Release'}).click();
  await lease(anna).getByText('free').waitFor();
});

it('a lost device opens an incident, which a person acknowledges', async () => {
  await show(anna, 'incidents');
  await anna.getByRole('button', {name: 'All', exact: true}).click();
  await rows(anna, 'lab/knob0: lease changed').filter({hasText: 'Anna → Ben'}).waitFor();
  await anna.getByRole('button', {name: 'To do'}).click();

  await anna.keyboard.press('Control+Shift+Space');
  const stopped = rows(anna, 'lab/arm0: emergency stop');
  await stopped.getByText('open').waitFor();
  await until(
    'a title with a number',
    () => anna.title(),
    (title) => /^\(\d+\) /.test(title),
  );
  await anna.getByTestId('unseen').first().waitFor();
  const count = Number(await anna.getByTestId('unseen').first().textContent());
  assert.ok(count >= 5, `${count} of five stopped devices`);

  await stopped.getByRole('button', {name: /^Acknowledge/}).click();
  await stopped.getByText(/^Anna, \d/).waitFor();
  for (const [size, viewport] of Object.entries(kSizes)) {
    await anna.setViewportSize(viewport);
    for (const colorScheme of ['light', 'dark']) {
      await anna.emulateMedia({colorScheme});
      await keep(anna, artefacts, `incidents-${size}-${colorScheme}`);
      assert.deepEqual(await accessibilityFaults(anna), []);
    }
    const overflow = await anna.evaluate(
      () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
    );
    assert.ok(overflow <= 0, `${size}: ${overflow} px`);
    if (size === 'phone') assert.deepEqual(await smallTargets(anna), []);
  }
  await anna.setViewportSize(kSizes.desktop);

  await system.devices.end('SIGKILL');
  await rows(anna, 'lab/arm0: lost').getByText('open').waitFor();
  await until(
    'all five are lost',
    () => rows(anna, ': lost').count(),
    (lost) => lost >= 5,
  );
  await anna.getByRole('button', {name: /^Acknowledge all \d+…$/}).click();
  await anna.getByRole('button', {name: 'Acknowledge', exact: true}).click();
  await until('all is acknowledged', async () =>
    /, 0 not/.test(await anna.getByTestId('incident-count').textContent()),
  );
  const [file] = await Promise.all([
    anna.waitForEvent('download'),
    anna.getByRole('button', {name: 'Export CSV'}).click(),
  ]);
  const table = readFileSync(await file.path(), 'utf8').split('\r\n');
  const lost = table.find((line) => /^\d+,alarm,lab\/arm0,lost,/.test(line));
  assert.match(lost, /,Anna,\d{4}-/);
});

it('incidents outlive the console', async () => {
  await system.console.end();
  await anna.locator('.link-lost').waitFor();
  await system.startConsole(system.port);
  await anna.locator('.link-live').waitFor();
  await rows(anna, 'lab/arm0: lost')
    .getByText(/^Anna, \d/)
    .waitFor();
});
