// Every view of the console's page at six widths, in both languages and themes, beside the mock: no
// view is wider than the page, the stop stays in reach, and axe-core finds nothing.
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
import {Program} from './programs.mjs';

const artefacts = process.env.RTPM_ARTEFACTS;
const kWidths = [390, 768, 1024, 1440, 1920, 3840];
const kViews = [
  'overview',
  'live/lab/arm0',
  'plots',
  'parameters/lab/arm0',
  'recordings',
  'incidents',
  'events',
];
/** Each language in one theme; how wide a text is does not depend on its colour. */
const kLooks = [
  {language: 'en', locale: 'en-GB', colorScheme: 'light'},
  {language: 'de', locale: 'de-DE', colorScheme: 'dark'},
];

let browser;
let few;
let many;

function startMock(...options) {
  const path = `${process.env.RTPM_PAGE}/../mock/server.mjs`;
  return Program.start(process.execPath, [path, '0', ...options], /http:\S+/);
}

before(async () => {
  [few, many, browser] = await Promise.all([
    startMock(),
    startMock('--devices=200'),
    launch(process.env.RTPM_CHROMIUM),
  ]);
});

after(async () => {
  await browser?.close();
  await Promise.all([few?.end(), many?.end()]);
});

/** Elements that are wider than the page, as a whole or cut off at its edge, or than the card around it. */
function tooWide(page) {
  return page.evaluate(() => {
    const {scrollWidth, clientWidth} = document.scrollingElement;
    const found = scrollWidth > clientWidth ? [`the page: ${scrollWidth} of ${clientWidth}`] : [];
    const rightOf = (one) => one?.getBoundingClientRect().right ?? Infinity;
    const isCut = (one) => rightOf(one) > Math.min(clientWidth, rightOf(one.closest('.card'))) + 1;
    // Tables and lists of their own may scroll; what is hidden to the eye may be anywhere.
    const isExempt = (one) => one.closest('.scroll, .visually-hidden, .skip, [popover]') !== null;
    for (const one of document.querySelectorAll('body *')) {
      if (isCut(one) && !isExempt(one) && one.checkVisibility())
        found.push(one.outerHTML.slice(0, 90));
    }
    return found.slice(0, 3);
  });
}

/** Whether a press in the middle of the stop hits it. */
function isStopInReach(page) {
  return page.evaluate(() => {
    const stop = document.querySelector('.stop');
    const {left, right, top, bottom} = stop.getBoundingClientRect();
    const hit = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
    return left >= 0 && right <= document.documentElement.clientWidth && stop.contains(hit);
  });
}

async function atWidth(page, width) {
  await page.setViewportSize({width, height: 1000});
  await page.evaluate(
    () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))),
  );
}

async function checkWidths(page, view, name, {language, colorScheme}) {
  await show(page, view);
  await page.locator('main > *:not(h1)').first().waitFor();
  for (const width of kWidths) {
    await atWidth(page, width);
    const where = `${view}, ${width} wide, ${language}`;
    assert.deepEqual(await tooWide(page), [], where);
    assert.ok(await isStopInReach(page), `${where}: the stop is out of reach`);
    await keep(page, artefacts, `${name}-${width}-${language}-${colorScheme}`);
    if (width === 390) assert.deepEqual(await smallTargets(page), [], where);
    if (width !== 1440) continue;
    // The rule about colours takes most of the time, and rows have no colours of their own.
    const withColours = name !== 'many';
    assert.deepEqual(await accessibilityFaults(page, {withColours}), [], where);
  }
}

describe('widths', {concurrency: 2}, () => {
  for (const look of kLooks) {
    const {language, locale, colorScheme} = look;
    // As fingers use it; no colour is on its way to another one.
    const options = {locale, colorScheme, hasTouch: true, reducedMotion: 'reduce'};

    it(`all views fit and are for everybody, ${language}, ${colorScheme}`, async () => {
      await visit(browser, few.found, options, async (page) => {
        for (const view of kViews) await checkWidths(page, view, view.split('/')[0], look);
        assert.deepEqual(page.faults, []);
      });
    });

    it(`200 devices fit and are for everybody, ${language}, ${colorScheme}`, async () => {
      await visit(browser, many.found, options, async (page) => {
        await show(page, 'overview');
        await page.locator('.device-row').first().waitFor();
        await checkWidths(page, 'overview', 'many', look);
        assert.deepEqual(page.faults, []);
      });
    });
  }
});

describe('many devices', () => {
  it('are found, and reached by the keyboard, the worst first', async () => {
    await visit(browser, many.found, {}, async (page) => {
      await show(page, 'overview');
      await page.locator('.device-row').first().waitFor();
      assert.equal(await page.locator('.device-row').count(), 200);
      assert.match(await page.locator('.device-row').first().textContent(), /lost for/);
      await page.keyboard.press('/');
      await page.keyboard.type('cell3 haptic');
      await page.getByText('6 of 200').waitFor();
      await page.keyboard.press('ArrowDown');
      const focused = () => page.evaluate(() => document.activeElement.dataset.testid);
      const first = await focused();
      assert.match(first, /^cell3\/arm/);
      await page.keyboard.press('ArrowRight');
      await page.keyboard.press('ArrowDown');
      const third = await focused();
      assert.notEqual(third, first);
      await page.keyboard.press('Enter');
      await until(
        'the device',
        () => page.url(),
        (url) => url.endsWith(`#/live/${third}`),
      );
    });
  });

  it('beyond the first 16 have live samples, too', async () => {
    await visit(browser, many.found, {}, async (page) => {
      await show(page, 'live/cell9/arm18');
      await until(
        'a position',
        () => page.locator('[data-reading="force"] b').textContent(),
        (text) => text !== '–',
      );
    });
  });
});

describe('settings', () => {
  it('change language and numbers, and stay after a reload', async () => {
    await visit(browser, few.found, {locale: 'en-GB'}, async (page) => {
      await page.getByRole('button', {name: 'Settings'}).click();
      await page.getByRole('button', {name: 'Deutsch'}).click();
      await page.getByRole('link', {name: 'Aufnahmen'}).waitFor();
      await page.reload();
      await page.getByRole('link', {name: 'Aufnahmen'}).waitFor();
      assert.equal(await page.evaluate(() => document.documentElement.lang), 'de');
      await show(page, 'parameters/lab/arm0');
      const ramp = page.locator('[data-parameter="safety.ramp_s"]').getByRole('textbox');
      for (const typed of ['0,0125', '0.0125']) {
        await ramp.fill(typed);
        await page.getByRole('button', {name: '1 Änderung übernehmen'}).waitFor();
      }
      await page.getByRole('button', {name: 'Einstellungen'}).click();
      await page.getByRole('button', {name: '12\u202f345.6'}).click();
      await page.keyboard.press('Escape');
      await ramp.press('Escape');
      assert.match(await ramp.inputValue(), /^0\.\d+$/);
    });
  });

  it('and menu never cover the stop, on a phone', async () => {
    const options = {viewport: {width: 390, height: 700}, hasTouch: true};
    await visit(browser, few.found, options, async (page) => {
      for (const name of ['Settings', 'Overview']) {
        await page.getByRole('button', {name}).tap();
        await page.locator('.popup:popover-open').waitFor();
        assert.ok(await isStopInReach(page), name);
        assert.deepEqual(await accessibilityFaults(page, {withColours: false}), [], name);
        await page.keyboard.press('Escape');
      }
      await page.getByRole('button', {name: 'Overview'}).tap();
      await page.getByRole('link', {name: 'Events'}).tap();
      await page.getByRole('button', {name: 'Events'}).waitFor();
    });
  });
});

describe('help', () => {
  it('opens by keyboard and by touch', async () => {
    await visit(browser, few.found, {hasTouch: true}, async (page) => {
      await show(page, 'overview');
      const shown = page.locator('.help-text:popover-open');
      const longest = page.getByRole('button', {name: 'Help: Longest cycle'});
      await longest.first().tap();
      await shown.getByText('The longest time').waitFor();
      await page.keyboard.press('Escape');
      await shown.waitFor({state: 'detached'});
      await longest.first().focus();
      await page.keyboard.press('Enter');
      await shown.getByText('The longest time').waitFor();
    });
  });
});
