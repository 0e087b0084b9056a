// An experimenter's day at the page beside the running system: ten things that an operator needs. The
// cases stand in one order. RTPM_PICTURES keeps each view at six sizes, light and dark.
import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {after, before, describe, it} from 'node:test';
import {accessibilityFaults, keep, launch, open, show, until, visit} from './browser.mjs';
import {System} from './programs.mjs';

const artefacts = process.env.RTPM_ARTEFACTS;
const system = new System();
const kRecording = 'touch_P07_soft.mcap';
const kSizes = {
  phone: {width: 390, height: 844},
  tablet: {width: 768, height: 1024},
  small: {width: 1024, height: 768},
  laptop: {width: 1440, height: 900},
  desktop: {width: 1920, height: 1080},
  wall: {width: 3840, height: 2160},
};
let browser;
let page;

const byId = (name) => page.getByTestId(name);
const button = (name) => page.getByRole('button', {name, exact: true});
const field = (name) => page.locator('.session').getByLabel(name, {exact: true});
const marks = () => page.locator('.marker-list tbody tr').allTextContents();
const unfocus = () => page.evaluate(() => document.activeElement?.blur());

before(async () => {
  await system.start();
  // More than the overview shows as cards.
  await system.startKnobs('cell1', 10);
  browser = await launch(process.env.RTPM_CHROMIUM);
  page = await open(browser, system.url);
});

after(async () => {
  await browser?.close();
  await system.end();
});

describe('an operator', () => {
  it('gives a name once', async () => {
    await button('Settings').click();
    const popup = page.locator('.popup:popover-open');
    await popup.getByLabel('Name', {exact: true}).fill('Anna');
    await popup.getByLabel('Room').fill('Lab 2');
    await popup.getByRole('button', {name: 'Save'}).click();
    await page.keyboard.press('Escape');
  });

  it('finds a device by words and keyboard', async () => {
    await show(page, 'overview');
    await page.getByText('15 of 15 live').waitFor();
    assert.deepEqual(await accessibilityFaults(page, {withColours: false}), []);
    await unfocus();
    await page.keyboard.press('/');
    await page.keyboard.type('lab knob');
    await page.getByText('1 of 15', {exact: true}).waitFor();
    await page.keyboard.press('ArrowDown');
    await page.keyboard.press('Enter');
    await page.locator('.strip[data-testid="strip-dial"]:not(.is-stale)').waitFor();
    assert.ok(page.url().endsWith('#/live/lab/knob0'));
  });

  it('holds it under that name until it is released', async () => {
    await button('Take over').click();
    await byId('lease')
      .getByText(/^Anna, this room, since \d\d:\d\d, until released$/)
      .waitFor();
    await button('Release').click();
    await byId('lease').getByText('free').waitFor();
  });

  it('records a session under the name of its fields', async () => {
    await show(page, 'recordings');
    await field('Participant').fill('P07');
    await field('Experiment').fill('touch');
    await field('Condition').fill('soft');
    await page.getByText('File name and devices').click();
    await field('File name').fill('{experiment}_{participant}_{condition}');
    await byId('record').click();
    await page.locator('.session-name', {hasText: 'P07 · touch · soft'}).waitFor();
    await page.locator('.record-facts', {hasText: kRecording}).waitFor();
    assert.deepEqual(await accessibilityFaults(page), []);
  });

  it('sees the camera beside the samples', async (t) => {
    if (!(await system.startCamera())) return t.skip('rtpm-camerad is not built');
    await show(page, 'live/lab/knob0');
    await page.locator('.camera:not(.is-stale)').waitFor();
    await page.locator('.strip[data-testid="strip-dial"]:not(.is-stale)').waitFor();
    await system.camera.end();
  });

  it('marks moments and trials, by keys and buttons', async () => {
    await show(page, 'live/lab/knob0');
    await unfocus();
    await page.keyboard.press('m');
    await byId('markers').getByLabel('A note').fill('bme');
    await button('Mark').click();
    await unfocus();
    await page.keyboard.press('b');
    await byId('markers').getByText('Trial 1').waitFor();
    await byId('markers').getByLabel('Response').fill('left');
    await page.getByRole('button', {name: 'End trial'}).click();
    await page.getByRole('button', {name: /^Markers: /}).click();
    const shown = await until('four markers', marks, (texts) => texts.length === 4);
    const [end, begin, note, event] = shown;
    assert.match(event, /event/);
    assert.match(note, /bme/, 'letters that are typed are no keys');
    assert.match(begin, /trial 1 begin/);
    assert.match(end, /trial 1 end.*left.*s$/, 'an end has its response and duration');
    assert.deepEqual(await accessibilityFaults(page), []);
  });

  it('has buttons with labels and keys of their own, after a reload, too', async () => {
    await button('Edit').click();
    await button('Add a button').click();
    await page.getByLabel('Label').last().fill('pain');
    await page.getByLabel('Key of pain').fill('p');
    await page.reload();
    await page.getByRole('button', {name: 'pain'}).waitFor();
    await page.keyboard.press('p');
    await page.getByRole('button', {name: 'Markers: 5'}).click();
    await until('the mark', marks, ([first]) => /pain/.test(first ?? ''));
  });

  it('plots fields of two devices on one axis of time', async () => {
    await show(page, 'plots/of/lab/arm0');
    await page.locator('[data-curve="lab/arm0/sampled.position_m.x"]').waitFor();
    const query = page.getByRole('combobox', {name: 'Search fields'});
    await query.fill('arm1 position');
    await page.locator('[data-option="lab/arm1/sampled.position_m.x"]').waitFor();
    await query.press('Enter');
    await query.press('Escape');
    const value = page.locator('[data-curve="lab/arm1/sampled.position_m.x"] [data-value]');
    await until(
      'a value',
      () => value.first().textContent(),
      (text) => /\d mm$/.test(text),
    );
  });

  it('ends the session, which proposes no participant for the next', async () => {
    await show(page, 'recordings');
    await byId('record').click();
    await page.getByRole('row', {name: new RegExp(kRecording)}).waitFor();
    assert.equal(await field('Participant').inputValue(), '');
    assert.equal(await field('Experiment').inputValue(), 'touch');
  });

  it('has its table by one click, with marks and trials', async () => {
    const [saved] = await Promise.all([
      page.waitForEvent('download'),
      button(`CSV of ${kRecording}`).click(),
    ]);
    assert.equal(saved.suggestedFilename(), 'touch_P07_soft.csv');
    const table = readFileSync(await saved.path(), 'utf8');
    const [header, ...rows] = table.trimEnd().split('\r\n');
    for (const column of ['seconds [s]', 'lab/arm0.position_m.x', 'trial', 'marker']) {
      assert.ok(header.split(',').includes(column), header);
    }
    assert.ok(rows.length > 500, `${rows.length} rows`);
    const place = header.split(',').indexOf('marker');
    const marked = rows.map((row) => row.split(',')[place]).filter((cell) => cell !== '');
    // Marks between the same two samples share a cell.
    assert.ok(
      marked.some((cell) => cell.split('; ').includes('bme')),
      `the marks are ${marked.join(' | ')}`,
    );
  });

  it('reviews the whole run with its marks and trials', async () => {
    await page.getByRole('link', {name: kRecording}).first().click();
    await byId('review-strip').waitFor();
    for (const label of ['bme', 'pain']) {
      await byId('review-happenings').getByText(label).first().waitFor();
    }
    assert.deepEqual(await accessibilityFaults(page), []);
  });

  it('stops all; the stop outlives browser and console, and marks wait for it', async () => {
    await show(page, 'live/lab/knob0');
    await page.keyboard.press('Control+Shift+Space');
    await byId('stopped').waitFor();
    await system.console.end('SIGKILL');
    await page.locator('.link-lost').waitFor();
    await unfocus();
    await page.keyboard.press('p');
    await page.getByText(/^“pain” at .* waits for the connection/).waitFor();
    await system.startConsole(system.port);
    // A console that was killed has forgotten those before.
    await page.getByRole('button', {name: 'Markers: 1'}).waitFor();
    await visit(browser, system.url, {}, async (other) => {
      await other.getByTestId('stopped').waitFor();
    });
    await byId('stopped').getByRole('button', {name: 'Rearm all…'}).click();
    await byId('stopped')
      .getByRole('button', {name: /^Rearm \d+ devices$/})
      .click();
    await byId('stopped').waitFor({state: 'detached'});
  });

  it('acknowledges incidents by name', async () => {
    await show(page, 'incidents');
    await button('All').click();
    const stopped = byId('incident').filter({hasText: 'lab/arm0: emergency stop'});
    await stopped.getByRole('button', {name: /^Acknowledge/}).click();
    await stopped.getByText(/^Anna, \d/).waitFor();
    assert.deepEqual(page.faults, []);
  });

  it('sees all of it well at any size', async (t) => {
    if (!process.env.RTPM_PICTURES) return t.skip('pictures are for people');
    const views = {
      overview: 'overview',
      live: 'live/lab/arm0',
      plots: 'plots/of/lab/arm0',
      parameters: 'parameters/lab/arm0',
      recordings: 'recordings',
      review: `recordings/${kRecording}`,
      incidents: 'incidents',
      events: 'events',
    };
    for (const [name, view] of Object.entries(views)) {
      await show(page, view);
      for (const [size, viewport] of Object.entries(kSizes)) {
        await page.setViewportSize(viewport);
        for (const colorScheme of ['light', 'dark']) {
          await page.emulateMedia({colorScheme});
          await page.waitForTimeout(1000);
          await keep(page, `${artefacts}/operator`, `${name}-${size}-${colorScheme}`);
        }
      }
    }
  });
});
