// Makes clients/console/page_moving.png, the README's moving picture, from the running system:
//   ctest --preset dev -R console_page.end_to_end        (prepares the folder)
//   cd build/dev/tests/system/console_page/work; RTPM_PICTURES=1 RTPM_PROGRAM_FOLDER=… RTPM_STROKE=… \
//     RTPM_SCRATCH=scratch RTPM_CHROMIUM=chromium node moving_picture.mjs OUTPUT.png
// ffmpeg joins the frames.
import {execFileSync} from 'node:child_process';
import {mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {launch, open, reading, show, until} from './browser.mjs';
import {System} from './programs.mjs';

// As many as software draws in time.
const kFramesPerSecond = 3;
const kSeconds = 8;
// Without the scroll bar.
const kPart = {x: 0, y: 0, width: 1268, height: 1000};
const kWidth = 800;
const kColors = 96;

const system = new System();
const folder = mkdtempSync(`${tmpdir()}/rtpm-picture-`);
await system.start();
const browser = await launch(process.env.RTPM_CHROMIUM);
try {
  const page = await open(browser, system.url, {viewport: {width: 1280, height: kPart.height}});
  await show(page, 'live/lab/arm0');
  await until('a force', () => reading(page, 'force'), (newton) => newton > 0.2);
  await page.getByRole('button', {name: '10 s', exact: true}).click();
  // The charts fill.
  await page.waitForTimeout(8_000);
  const begun = performance.now();
  for (let i = 0; i < kFramesPerSecond * kSeconds; ++i) {
    await page.waitForTimeout(Math.max(0, begun + (i * 1000) / kFramesPerSecond - performance.now()));
    await page.screenshot({path: `${folder}/${String(i).padStart(3, '0')}.png`, clip: kPart});
  }
  console.log(`${kFramesPerSecond * kSeconds} frames in ${Math.round(performance.now() - begun)} ms`);
} finally {
  await browser.close();
  await system.end();
}
const colors = `split[a][b];[a]palettegen=max_colors=${kColors}[p];[b][p]paletteuse=dither=none`;
execFileSync('ffmpeg', [
  ...['-y', '-loglevel', 'error', '-framerate', String(kFramesPerSecond), '-i', `${folder}/%03d.png`],
  ...['-vf', `scale=${kWidth}:-1:flags=area,${colors}`, '-plays', '0', '-f', 'apng', process.argv[2]],
]);
rmSync(folder, {recursive: true});
