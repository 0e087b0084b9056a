// Reviews a recording in Chromium beside the running system. The cases stand in one order.
import assert from 'node:assert/strict';
import {copyFileSync, existsSync} from 'node:fs';
import {after, before, describe, it} from 'node:test';
import {accessibilityFaults, keep, launch, open, show, smallTargets, until} from './browser.mjs';
import {System} from './programs.mjs';

const artefacts = process.env.RTPM_ARTEFACTS;
const scratch = process.env.RTPM_SCRATCH;
const system = new System();
let browser;
let page;

const byId = (name) => page.getByTestId(name);
const button = (name) => page.getByRole('button', {name, exact: true});
/** The seconds that show. */
const span = async () => {
  const [from, to] = (await byId('review-span').textContent()).match(/[\d:.]+/g);
  const seconds = (text) => text.split(':').reduce((sum, part) => 60 * sum + Number(part), 0);
  return {from: seconds(from), to: seconds(to)};
};
/** In how many columns of pixels the first chart has something coloured. */
const paintedColumns = () =>
  page.evaluate(() => {
    const canvas = document.querySelector('.review-plot');
    if (canvas === null) return 0;
    const {width, height} = canvas;
    const {data} = canvas.getContext('2d').getImageData(0, 0, width, height);
    const painted = new Set();
    for (let i = 0; i < data.length; i += 4) {
      const [low, high] = [Math.min, Math.max].map((of) => of(data[i], data[i + 1], data[i + 2]));
      // On a screen of half the pixels a line is half transparent.
      if (data[i + 3] > 50 && high - low > 60) painted.add((i / 4) % width);
    }
    return painted.size / width;
  });

before(async () => {
  await system.start();
  browser = await launch(process.env.RTPM_CHROMIUM);
  page = await open(browser, system.url);
  await show(page, 'recordings');
  await byId('record').click();
  await page.locator('.rec').waitFor();
  await page.getByTestId('stop').click();
  await until(
    'more than three seconds',
    () => page.locator('.rec').textContent(),
    (text) => !/0:0[0-3]/.test(text),
  );
  await byId('record').click();
  await page.getByText('is complete').waitFor();
});

after(async () => {
  await browser?.close();
  await system.end();
});

describe('a review', () => {
  it('shows the whole run with what happened', async () => {
    await page.locator('.recordings-file').first().click();
    await byId('review-strip').getByText('position_m.x').waitFor();
    await byId('review-happenings').getByText('emergency stop').first().waitFor();
    await until('curves', paintedColumns, (share) => share > 0.5);
    const {from, to} = await span();
    assert.ok(from === 0 && to > 3, `${from} to ${to} show`);
    await keep(page, artefacts, 'review-desktop-light');
    assert.deepEqual(await accessibilityFaults(page), []);
  });

  it('zooms to milliseconds by wheel, by drag and by keys', async () => {
    const chart = page.locator('.review-plot').first();
    await chart.scrollIntoViewIfNeeded();
    const box = await chart.boundingBox();
    const x = (share) => box.x + 58 + share * (box.width - 72);
    const y = box.y + box.height / 2;
    const whole = await span();
    await page.mouse.move(x(0.25), y);
    await page.mouse.down();
    await page.mouse.move(x(0.5), y, {steps: 4});
    await page.mouse.up();
    const dragged = await until('a part', span, (one) => one.to < whole.to);
    assert.ok(Math.abs(dragged.from - 0.25 * whole.to) < 0.05, `${dragged.from} s`);
    assert.ok(Math.abs(dragged.to - 0.5 * whole.to) < 0.05, `${dragged.to} s`);
    for (let i = 0; i < 14; ++i) await page.mouse.wheel(0, -300);
    const zoomed = await until('milliseconds', span, (one) => one.to - one.from < 0.02);
    assert.ok(zoomed.from >= dragged.from && zoomed.to <= dragged.to);
    await page.getByText('read from the file').waitFor();
    await until('curves', paintedColumns, (share) => share > 0.3);
    await page.mouse.click(x(0.5), y);
    await until(
      'a value at the crosshair',
      () => page.locator('.review-value b').first().textContent(),
      (text) => /\d/.test(text),
    );
    await keep(page, artefacts, 'review-zoomed-desktop-light');
    const before = await span();
    for (let i = 0; i < 5; ++i) await chart.press('-');
    await until('more', span, (one) => one.to - one.from > before.to - before.from);
    await chart.press('Escape');
    await until('all', span, (one) => one.from === 0 && one.to === whole.to);
  });

  it('keeps notes', async () => {
    await byId('review-actions').getByRole('button', {name: 'Add note'}).click();
    await page.getByLabel(/^Note at/).fill('subject yawns');
    await page.keyboard.press('Enter');
    await byId('review-happenings').getByText('subject yawns').waitFor();
    await page.reload();
    await byId('review-happenings').getByText('subject yawns').waitFor();
  });

  it('cuts the part that shows, and never over another file', async () => {
    const chart = page.locator('.review-plot').first();
    await chart.press('+');
    await button('Cut this part').click();
    const name = page.getByLabel(/^New file with/);
    const file = await name.inputValue();
    await page.keyboard.press('Enter');
    await name.waitFor({state: 'detached'});
    assert.ok(existsSync(`${scratch}/recordings/${file}`));
    await button('Cut this part').click();
    await name.fill(file);
    await page.keyboard.press('Enter');
    await page.getByText('it exists already').waitFor();
    await page.keyboard.press('Escape');
  });

  it('compares two recordings, one above the other', async () => {
    const other = page.getByLabel('Compare with');
    await other.selectOption({index: 1});
    await until(
      'two strips',
      () => byId('review-strip').count(),
      (count) => count === 2,
    );
    await until(
      'four charts',
      () => byId('review-chart').count(),
      (count) => count === 4,
    );
    await keep(page, artefacts, 'review-compared-desktop-light');
    await other.selectOption('');
  });

  it('renames, deletes and restores', async () => {
    await button('Rename').click();
    await page.getByLabel('New name').fill('best-run');
    await page.keyboard.press('Enter');
    await page.getByRole('heading', {name: 'best-run.mcap'}).waitFor();
    await byId('review-happenings').getByText('subject yawns').waitFor();
    await button('Delete').click();
    await page.getByText('best-run.mcap is deleted.').waitFor();
    assert.ok(!existsSync(`${scratch}/recordings/best-run.mcap`));
    assert.deepEqual(await accessibilityFaults(page), []);
    await button('Undo').click();
    await page.getByText('best-run.mcap is back in the list.').waitFor();
    assert.ok(existsSync(`${scratch}/recordings/best-run.mcap`));
  });

  it('says what is broken', async () => {
    copyFileSync(`${scratch}/token`, `${scratch}/recordings/broken.mcap`);
    await show(page, 'recordings/broken.mcap');
    await page.getByRole('alert').getByText('broken.mcap').waitFor();
    await show(page, 'recordings/none.mcap');
    await page.getByRole('alert').getByText("there is no recording 'none.mcap'").waitFor();
  });

  it('fits a phone, in dark', async () => {
    await page.setViewportSize({width: 390, height: 844});
    await page.emulateMedia({colorScheme: 'dark', reducedMotion: 'reduce'});
    await show(page, 'recordings/best-run.mcap');
    await until('curves', paintedColumns, (share) => share > 0.3);
    await keep(page, artefacts, 'review-phone-dark');
    assert.deepEqual(await accessibilityFaults(page), []);
    assert.deepEqual(await smallTargets(page), []);
    const isWide = await page.evaluate(
      () => document.documentElement.scrollWidth > document.documentElement.clientWidth,
    );
    assert.equal(isWide, false);
    assert.deepEqual(page.faults, []);
  });
});
