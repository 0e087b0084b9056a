// Chromium beside the console's page: what tests see, do and keep of it.
import {mkdirSync, readFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {chromium} from 'playwright-core';

const axe = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
export const kPatienceMs = 30_000;

const kDesktop = {width: 1440, height: 1000};

export async function launch(path) {
  return chromium.launch({
    executablePath: path,
    // They take room as they do for most people.
    ignoreDefaultArgs: ['--hide-scrollbars'],
    args: ['--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader'],
  });
}

/** A page of the console, with what its program complained of. */
export async function open(browser, url, options = {}) {
  const context = await browser.newContext({
    viewport: kDesktop,
    // Software draws the scene: a quarter of the pixels takes a quarter of the time.
    deviceScaleFactor: process.env.RTPM_PICTURES ? 1 : 0.5,
    ...options,
  });
  const page = await context.newPage();
  page.setDefaultTimeout(kPatienceMs);
  page.faults = [];
  page.on('pageerror', (error) => page.faults.push(String(error.stack)));
  page.on('console', (message) => {
    // A connection that is refused while the console is down is what the page is tested for.
    if (
      message.type() === 'error' &&
      !/WebSocket|ERR_CONNECTION_|ERR_EMPTY_RESPONSE/.test(message.text())
    ) {
      page.faults.push(message.text());
    }
  });
  await page.goto(url);
  await page.locator('.link-live').waitFor();
  return page;
}

/** Does `work` with a further page, which ends with it, also where it fails. */
export async function visit(browser, url, options, work) {
  const page = await open(browser, url, options);
  try {
    await work(page);
  } finally {
    await page.context().close();
  }
}

export async function show(page, view) {
  await page.evaluate((hash) => (window.location.hash = hash), `#/${view}`);
}

/** The newest number of a reading, such as "force"; NaN where none is live. */
export async function reading(page, name) {
  const text = await page.locator(`[data-reading="${name}"] b`).textContent();
  return Number(text.replace('−', '-').replace('–', 'NaN'));
}

/** Waits until `isTrue(value)` holds for what `read` gives, and returns it. */
export async function until(what, read, isTrue = Boolean) {
  const endMs = Date.now() + kPatienceMs;
  for (;;) {
    const value = await read();
    if (isTrue(value)) return value;
    if (Date.now() > endMs) throw new Error(`${what}: still ${JSON.stringify(value)}`);
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
}

/** Serious and critical findings of axe-core, in words; its rule about colours is the slowest. */
export async function accessibilityFaults(page, {withColours = true} = {}) {
  if (!(await page.evaluate(() => 'axe' in window))) await page.evaluate(axe);
  const found = await page.evaluate(
    (hasColours) =>
      window.axe.run(document, {
        runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'best-practice'],
        rules: {'color-contrast': {enabled: hasColours}},
        // The rest is not read, and takes longer than the rules.
        resultTypes: ['violations'],
        selectors: false,
      }),
    withColours,
  );
  return found.violations
    .filter((one) => ['serious', 'critical'].includes(one.impact))
    .map(
      (one) =>
        `${one.id}: ${one.nodes
          .map((node) => node.html)
          .slice(0, 3)
          .join(' | ')}`,
    );
}

/** Buttons and links that are smaller than a finger. */
export async function smallTargets(page) {
  return page.evaluate(() =>
    [...document.querySelectorAll('button, .header nav a, .choice a')]
      .filter((one) => one.checkVisibility())
      .filter((one) => one.getBoundingClientRect().height < 44)
      .map((one) => one.outerHTML.slice(0, 100)),
  );
}

/** A picture for people who set RTPM_PICTURES. */
export async function keep(page, folder, name) {
  if (!process.env.RTPM_PICTURES) return;
  mkdirSync(folder, {recursive: true});
  await page.screenshot({path: `${folder}/${name}.png`, animations: 'disabled'});
}
