// Plots of any fields, beside the running system.
import assert from 'node:assert/strict';
import {after, before, describe, it} from 'node:test';
import {
  accessibilityFaults,
  keep,
  launch,
  open,
  show,
  smallTargets,
  until,
  visit,
} from './browser.mjs';
import {System} from './programs.mjs';

const artefacts = process.env.RTPM_ARTEFACTS;
const system = new System();
let browser;
let page;

before(async () => {
  await system.start();
  browser = await launch(process.env.RTPM_CHROMIUM);
  page = await open(browser, system.url);
});

after(async () => {
  await browser?.close();
  await system.end();
});

const kX = 'lab/arm0/sampled.position_m.x';
const kOtherX = 'lab/arm1/sampled.position_m.x';
const query = () => page.getByRole('combobox', {name: 'Search fields'});
const canvas = (at = 0) => page.getByTestId(`plot-${at}`).getByTestId('plot-canvas');
/** The table's value of a curve, as a number; NaN where there is none. */
const value = async (path, column = 'value') => {
  const text = await page.locator(`[data-curve="${path}"] [data-${column}]`).first().textContent();
  return Number(text.split(' ')[0].replace('−', '-').replace('–', 'NaN') || NaN);
};
/** Columns of the canvas that have the colour of the first curve. */
const paintedColumns = (within) =>
  within.evaluate((holder) => {
    const picture = holder.querySelector('canvas');
    const {data, width, height} = picture
      .getContext('2d')
      .getImageData(0, 0, picture.width, picture.height);
    const wanted = getComputedStyle(document.documentElement).getPropertyValue('--curve-1').trim();
    const [red, green, blue] = [1, 3, 5].map((at) => Number.parseInt(wanted.slice(at, at + 2), 16));
    let count = 0;
    for (let x = 0; x < width; ++x) {
      for (let y = 0; y < height; ++y) {
        const at = 4 * (y * width + x);
        const off =
          Math.abs(data[at] - red) + Math.abs(data[at + 1] - green) + Math.abs(data[at + 2] - blue);
        // On a screen of half the pixels a line is half transparent.
        if (data[at + 3] > 50 && off < 60) {
          ++count;
          break;
        }
      }
    }
    return count / width;
  });

describe('plots', () => {
  it('of a device show it as its class needs', async () => {
    await show(page, 'live/lab/gaze0');
    await page.getByRole('link', {name: 'Open in plots'}).click();
    await page.getByTestId('direction').waitFor();
    await until('a gaze', () => value('lab/gaze0/sampled.direction_deg.right'), Number.isFinite);
    await keep(page, artefacts, 'plots-gaze-desktop-light');
  });

  it('take fields of two devices, by search and keyboard', async () => {
    await show(page, 'plots/of/lab/arm0');
    await until('a position', () => value(kX), Number.isFinite);
    await query().fill('arm1 position');
    await page.locator(`[data-option="${kOtherX}"]`).waitFor();
    await query().press('Enter');
    await query().press('Escape');
    await until('the other position', () => value(kOtherX), Number.isFinite);
    // Both in the unit that their size asks for.
    assert.match(await page.locator(`[data-curve="${kX}"] [data-value]`).textContent(), / mm$/);
    await keep(page, artefacts, 'plots-desktop-light');
  });

  it('have one crosshair, whose values the tables show', async () => {
    const {x, y, width, height} = await canvas(0).boundingBox();
    await page.mouse.move(x + width * 0.6, y + height * 0.5);
    await until(
      'a crosshair in each plot',
      () => page.locator('.plot-cross:visible').count(),
      (count) => count === 2,
    );
    const times = await page.locator('.plot-cross span').allTextContents();
    assert.equal(new Set(times).size, 1);
    assert.match(times[0], /^\d\d:\d\d:\d\d/);
    await page.mouse.move(x + width * 0.5, y - 200);
  });

  it('pause, zoom by dragging, and follow again', async () => {
    const pause = page.getByTestId('plots-pause');
    await until(
      'five of 30 seconds',
      () => paintedColumns(canvas(0)),
      (share) => share > 0.16,
    );
    await pause.click();
    await page.getByText('Paused: the plots do not follow.').waitFor();
    const kept = await value(kX, 'high');
    const {x, y, width, height} = await canvas(0).boundingBox();
    await page.mouse.move(x + width * 0.9, y + height * 0.5);
    await page.mouse.down();
    await page.mouse.move(x + width * 0.95, y + height * 0.5, {steps: 4});
    await page.mouse.up();
    await until(
      'a smaller range',
      async () => (await value(kX, 'high')) - (await value(kX, 'low')),
      (span) => span < 2 * Math.abs(kept) + 200,
    );
    await canvas(0).press('Space');
    await page.getByText('Paused: the plots do not follow.').waitFor({state: 'detached'});
    await canvas(0).press('Space');
    await canvas(0).dblclick({position: {x: width / 2, y: height / 2}});
    await page.getByText('Paused: the plots do not follow.').waitFor({state: 'detached'});
  });

  it('tell a threshold that is passed, in words', async () => {
    await page
      .getByTestId('plot-0')
      .getByRole('button', {name: /^More for/})
      .click();
    const menu = page.locator('.plot-menu:popover-open');
    await menu.getByRole('combobox', {name: 'Passed'}).selectOption('below');
    await menu.getByRole('textbox', {name: 'Value'}).fill('0.05');
    await menu.getByRole('textbox', {name: 'Label'}).fill('soft limit');
    await menu.getByRole('button', {name: 'Add'}).click();
    await page.keyboard.press('Escape');
    await page.getByText(/position_m\.x is below soft limit/).waitFor();
  });

  it('are saved by name, deleted and restored', async () => {
    await page.getByRole('button', {name: /^Layouts/}).click();
    const menu = page.locator('.layouts:popover-open');
    await menu.getByRole('textbox', {name: 'Name of this layout'}).fill('two <arms>');
    await menu.getByRole('button', {name: 'Save'}).click();
    await menu.locator('[data-layout="two <arms>"]').waitFor();
    await menu.getByRole('button', {name: 'Delete two <arms>'}).click();
    await menu.locator('[data-layout="two <arms>"]').waitFor({state: 'detached'});
    await page.keyboard.press('Escape');
    await page.getByRole('button', {name: 'Undo'}).click();
    await page.getByRole('button', {name: /^Layouts/}).click();
    await menu.locator('[data-layout="two <arms>"]').waitFor();
    await page.keyboard.press('Escape');
  });

  it('are shared by their address, with the past before the page was opened', async () => {
    // At least so much of the last 30 s was recorded before the other page opens.
    await until(
      'a past',
      () => paintedColumns(canvas(0)),
      (share) => share > 0.2,
    );
    const shared = page.url();
    assert.match(shared, /#\/plots\/layout\//);
    await visit(
      browser,
      system.url,
      {viewport: {width: 390, height: 844}, colorScheme: 'dark'},
      async (other) => {
        await other.evaluate((hash) => (window.location.hash = hash), new URL(shared).hash);
        await other.locator(`[data-curve="${kOtherX}"]`).waitFor();
        // Before its own samples could fill so much of the window.
        await until(
          'the past',
          () => paintedColumns(other.getByTestId('plot-canvas').first()),
          (share) => share > 0.15,
        );
        assert.equal(
          await other.evaluate(() => document.documentElement.scrollWidth <= innerWidth),
          true,
        );
        assert.deepEqual(await smallTargets(other), []);
        await keep(other, artefacts, 'plots-phone-dark');
        await other.evaluate(() => (window.location.hash = '#/plots/layout/broken'));
        await other.getByText('has no layout that this page can read').waitFor();
      },
    );
  });

  it('are accessible', async () => {
    await query().focus();
    await page.locator('[role="option"]').first().waitFor();
    assert.deepEqual(await accessibilityFaults(page), []);
    assert.deepEqual(page.faults, []);
  });
});

describe('the live view', () => {
  it('finds a device by words and keyboard', async () => {
    await show(page, 'live/lab/arm0');
    const picker = page.getByRole('combobox', {name: 'Device'});
    await picker.fill('knob');
    await picker.press('Enter');
    await page.locator('.strip[data-testid="strip-dial"]:not(.is-stale)').waitFor();
    await page.getByText(/reads within 1 ms/).waitFor();
    await keep(page, artefacts, 'live-picker-desktop-light');
  });
});
