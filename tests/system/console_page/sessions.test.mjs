// An experimenter's session on the page: recorded with its markers and trials.
import assert from 'node:assert/strict';
import {after, before, describe, it} from 'node:test';
import {accessibilityFaults, keep, launch, open, show, until, visit} from './browser.mjs';
import {System} from './programs.mjs';

const kPhone = {width: 390, height: 844};
const artefacts = process.env.RTPM_ARTEFACTS;
const system = new System();
let browser;
let page;

const byId = (name) => page.getByTestId(name);
const button = (name) => page.getByRole('button', {name});
const field = (name) => page.locator('.session').getByLabel(name, {exact: true});
const rows = () => page.locator('.marker-list tbody tr').allTextContents();

before(async () => {
  await system.start();
  browser = await launch(process.env.RTPM_CHROMIUM);
  page = await open(browser, system.url);
});

after(async () => {
  await browser?.close();
  await system.end();
});

describe('a session', () => {
  it('is recorded under the name of its fields', async () => {
    await show(page, 'recordings');
    await field('Participant').fill('P07');
    await field('Experiment').fill('touch');
    await field('Condition').fill('soft');
    await page.getByText('File name and devices').click();
    await field('File name').fill('{experiment}_{participant}_{condition}');
    await keep(page, artefacts, 'session-desktop-light');
    await byId('record').click();
    await page.locator('.session-name', {hasText: 'P07 · touch · soft'}).waitFor();
    await page.locator('.record-facts', {hasText: 'touch_P07_soft.mcap'}).waitFor();
    assert.deepEqual(await accessibilityFaults(page), []);
  });

  it('has markers by key and button, and trials as intervals', async () => {
    await show(page, 'live/lab/arm0');
    await page.evaluate(() => document.activeElement?.blur());
    await page.keyboard.press('m');
    await byId('markers').getByLabel('A note').fill('bme');
    await page.getByRole('button', {name: 'Mark', exact: true}).click();
    await page.evaluate(() => document.activeElement?.blur());
    await page.keyboard.press('b');
    await byId('markers').getByText('Trial 1').waitFor();
    await byId('markers').getByLabel('Response').fill('left');
    await button('End trial').click();
    await button(/^Markers: /).click();
    const shown = await until('four markers', rows, (texts) => texts.length === 4);
    const [end, begin, note, event] = shown;
    assert.match(event, /event/);
    assert.match(note, /bme/, 'letters that are typed are no keys');
    assert.match(begin, /trial 1 begin/);
    assert.match(end, /trial 1 end.*left.*s$/, 'an end has its response and duration');
    assert.deepEqual(await accessibilityFaults(page), []);
    await keep(page, artefacts, 'markers-desktop-light');
  });

  it('takes buttons with labels and keys of their own', async () => {
    await button('Edit').click();
    await button('Add a button').click();
    await page.getByLabel('Label').last().fill('pain');
    await page.getByLabel('Key of pain').fill('p');
    await page.reload();
    await button('pain').waitFor();
    // The earlier marks come over the new connection, which a mark needs, too.
    await button('Markers: 4').waitFor();
    await page.keyboard.press('p');
    await button('Markers: 5').click();
    await until('the mark', rows, ([first]) => /pain/.test(first ?? ''));
  });

  it('ends, is listed, and proposes no participant for the next', async () => {
    await show(page, 'recordings');
    await byId('record').click();
    await page.getByRole('row', {name: /touch_P07_soft\.mcap/}).waitFor();
    assert.equal(await field('Participant').inputValue(), '');
    assert.equal(await field('Experiment').inputValue(), 'touch');
  });

  it('fits a phone, in the dark', async () => {
    for (const view of ['recordings', 'live']) {
      await visit(browser, system.url, {viewport: kPhone, colorScheme: 'dark'}, async (one) => {
        await show(one, view);
        await one.getByTestId('markers').waitFor();
        const [width, room] = await one.evaluate(() => [
          document.documentElement.scrollWidth,
          innerWidth,
        ]);
        assert.ok(width <= room, `${view}: ${width} of ${room} px`);
        await keep(one, artefacts, `session-${view}-phone-dark`);
      });
    }
  });

  it('can only be watched without the token', async () => {
    await visit(browser, new URL(system.url).origin, {}, async (one) => {
      await show(one, 'recordings');
      await one.getByText('read only', {exact: true}).waitFor();
      assert.equal(await one.getByTestId('markers').count(), 0);
      assert.ok(await one.getByTestId('record').isDisabled());
    });
  });
});
