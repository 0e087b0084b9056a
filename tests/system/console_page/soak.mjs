// Watches the console's memory beside 50 devices while a page is reloaded: node soak.mjs SECONDS RELOADS
// with the environment of run.cmake. Fails above 150 MB.
import {launch, open, show} from './browser.mjs';
import {System} from './programs.mjs';

const kMostMiB = 150e6 / 2 ** 20;
const kViews = ['overview', 'plots/of/lab/arm0', 'incidents', 'recordings', 'live/cell1/knob3'];
const [seconds, reloadCount] = process.argv.slice(2).map(Number);
const system = new System();
await system.start();
await system.startKnobs('cell1', 45);
const browser = await launch(process.env.RTPM_CHROMIUM);
try {
  const page = await open(browser, system.url);
  const beginMs = Date.now();
  for (let i = 1; i <= reloadCount; ++i) {
    await show(page, kViews[i % kViews.length]);
    await page.reload();
    await page.locator('.link-live').waitFor();
    const dueMs = beginMs + (1000 * seconds * i) / reloadCount;
    await new Promise((resolve) => setTimeout(resolve, Math.max(0, dueMs - Date.now())));
    const peakMiB = system.console.peakMiB();
    console.log(`${i} reloads, ${Math.round((Date.now() - beginMs) / 1000)} s: ${peakMiB} MiB`);
    if (peakMiB > kMostMiB) process.exitCode = 1;
  }
} finally {
  await browser.close();
  await system.end();
}
