// Drives the console's page in Chromium beside the running system. The cases stand in one order:
// each leaves the system as the next one needs it.
import assert from 'node:assert/strict';
import {after, before, describe, it} from 'node:test';
import {accessibilityFaults, keep, launch, open, reading, show, until, visit} from './browser.mjs';
import {System} from './programs.mjs';

const artefacts = process.env.RTPM_ARTEFACTS;
const system = new System();
let browser;
let page;

const byId = (name) => page.getByTestId(name);
const button = (name) => page.getByRole('button', {name, exact: true});
const force = () => reading(page, 'force');
/** In how many columns of pixels a chart has something coloured. */
const paintedColumns = (chart) =>
  page.evaluate((name) => {
    const canvas = document.querySelector(`[data-testid="${name}"] canvas`);
    const {width, height} = canvas;
    const {data} = canvas.getContext('2d').getImageData(0, 0, width, height);
    const painted = new Set();
    for (let i = 0; i < data.length; i += 4) {
      const [low, high] = [Math.min, Math.max].map((of) => of(data[i], data[i + 1], data[i + 2]));
      // On a screen of half the pixels a line is half transparent.
      if (data[i + 3] > 50 && high - low > 60) painted.add((i / 4) % width);
    }
    return painted.size;
  }, chart);

before(async () => {
  await system.start();
  browser = await launch(process.env.RTPM_CHROMIUM);
  page = await open(browser, system.url);
});

after(async () => {
  await browser?.close();
  await system.end();
});

describe('the page', () => {
  it('hides the token, and may command', async () => {
    assert.ok(!page.url().includes('token'));
    await page.getByText('may command', {exact: true}).waitFor();
    // The token is kept for a reload.
    await page.reload();
    await page.getByText('may command', {exact: true}).waitFor();
  });

  it('shows hosts, servers, lanes, devices and objects', async () => {
    await show(page, 'overview');
    for (const name of ['lab/arm0', 'lab/arm1', 'lab/gaze0', 'lab/biometric0', 'lab/knob0']) {
      await byId(name).getByText('active', {exact: true}).waitFor();
    }
    await page
      .getByRole('region', {name: 'Servers and lanes'})
      .getByText('haptic')
      .first()
      .waitFor();
    await page.getByRole('region', {name: 'Objects'}).getByText('rtpm.events.Hub').waitFor();
    await page.getByText('5 of 5 live').waitFor();
  });

  it('sees the tool move', async () => {
    await show(page, 'live/lab/arm0');
    const first = await until('a position', () => reading(page, 'x'), Number.isFinite);
    await until(
      'another position',
      () => reading(page, 'x'),
      (x) => Math.abs(x - first) > 2,
    );
    await until('a force', force, (newton) => newton > 0.05);
    await page.locator('.space-label').waitFor();
    await page.getByText(/reads within 1 ms/).waitFor();
    await until(
      'strip charts',
      () => page.locator('.strip:not(.is-stale)').count(),
      (count) => count === 3,
    );
  });

  it('shows dials and inputs of devices without a pose', async () => {
    await show(page, 'live/lab/biometric0');
    // Each unit has an axis of its own.
    for (const channel of ['pulse', 'heart_rate', 'skin_conductance']) {
      await page.locator(`.strip[data-testid="strip-${channel}"]:not(.is-stale)`).waitFor();
    }
    const conductance = page.locator('[data-reading="skin_conductance"]');
    await until(
      'a conductance in microsiemens',
      () => reading(page, 'skin_conductance'),
      (value) => value > 0.1,
    );
    assert.match(await conductance.textContent(), /µS/);
    await show(page, 'live/lab/knob0');
    await page.locator('.strip[data-testid="strip-dial"]:not(.is-stale)').waitFor();
  });

  it('shows where a gaze goes', async () => {
    await show(page, 'live/lab/gaze0');
    await byId('direction').waitFor();
    await page.locator('.strip[data-testid="strip-direction"]:not(.is-stale)').waitFor();
    const first = await until('a gaze', () => reading(page, 'right'), Number.isFinite);
    await until(
      'another gaze',
      () => reading(page, 'right'),
      (degrees) => Math.abs(degrees - first) > 1,
    );
    await keep(page, artefacts, 'gaze-desktop-light');
  });
});

describe('a camera', () => {
  /**
   * At least `count` pictures that the page shows, with bar code and lamp, and two or more presses
   * of the knob. The first picture may be older than the subscription to presses.
   */
  const watch = (count) =>
    page.evaluate(async (countMin) => {
      const canvas = document.querySelector('[data-testid="camera-lab/cam0"]');
      const context = canvas.getContext('2d', {willReadFrequently: true});
      // As devices/camera/bar_code.cpp paints it.
      const readNumber = (isWhite) => {
        const width = Math.floor(canvas.width / 16);
        const height = Math.floor(canvas.height / 9);
        let number = 0n;
        for (let row = 0; row < 8; ++row) {
          for (let column = 0; column < 8; ++column) {
            const x = column * width + Math.floor(width / 2);
            const y = row * height + Math.floor(height / 2);
            if (isWhite(x, y)) number |= 1n << BigInt(8 * row + column);
          }
        }
        return number;
      };
      const pictures = [];
      const observer = new MutationObserver(() => {
        const {data} = context.getImageData(0, 0, canvas.width, canvas.height);
        const isWhite = (x, y) => data[4 * (y * canvas.width + x)] >= 128;
        pictures.push({
          captureNs: canvas.dataset.captureNs,
          number: String(readNumber(isWhite)),
          isLit: isWhite(Math.floor(canvas.width * 0.75), Math.floor(canvas.height / 2)),
        });
      });
      const presses = [];
      const socket = new WebSocket(location.origin.replace('http', 'ws'), ['foxglove.sdk.v1']);
      socket.binaryType = 'arraybuffer';
      socket.onmessage = ({data}) => {
        if (typeof data === 'string') {
          const {op, channels = []} = JSON.parse(data);
          const found = channels.find(({topic}) => topic === 'lab/knob0/event');
          if (op !== 'advertise' || found === undefined) return;
          const subscriptions = [{id: 1, channelId: found.id}];
          socket.send(JSON.stringify({op: 'subscribe', subscriptions}));
          return;
        }
        const event = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 13)));
        if (!/ButtonChanged/.test(event.type) || !JSON.stringify(event).includes('true')) return;
        presses.push(String(new DataView(data).getBigUint64(5, true)));
      };
      observer.observe(canvas, {attributeFilter: ['data-capture-ns']});
      // One that was pressed since the subscription, so that its event has come, too.
      const isSeenPressed = () =>
        pictures.some(
          (one, i) =>
            i > 0 &&
            one.isLit &&
            !pictures[i - 1].isLit &&
            presses.length > 0 &&
            BigInt(one.captureNs) > BigInt(presses[0]),
        );
      const isDone = () => pictures.length >= countMin && isSeenPressed();
      const endMs = performance.now() + 60_000;
      while (!isDone() && performance.now() < endMs)
        await new Promise((resolve) => setTimeout(resolve, 50));
      // The event of the last picture's press may still be on its way.
      await new Promise((resolve) => setTimeout(resolve, 500));
      observer.disconnect();
      socket.close();
      return {pictures, presses};
    }, count);

  it('shows beside the device, and its lamp at the time of the button', async (t) => {
    if (!(await system.startCamera())) return t.skip('rtpm-camerad is not built');
    await show(page, 'live/lab/knob0');
    const card = page.locator('.camera:not(.is-stale)');
    await card.getByText(/captured \d+ ms ago ± 34 ms · 640 × 480 at 30 Hz/).waitFor();
    await keep(page, artefacts, 'camera-desktop-light');
    const {pictures, presses} = await watch(20);
    assert.ok(pictures.length >= 20, `${pictures.length} pictures`);
    // The bar code is on the system's clock; the difference of the two clocks is one number.
    const lags = pictures.map((one) => Number(BigInt(one.captureNs) - BigInt(one.number)));
    assert.ok(
      Math.max(...lags) - Math.min(...lags) < 5e6,
      `${Math.max(...lags) - Math.min(...lags)} ns`,
    );
    const kUncertaintyNs = 34_000_000n;
    const kPeriodNs = 34_000_000n;
    let litCount = 0;
    for (const [i, one] of pictures.entries()) {
      if (i === 0 || !one.isLit || pictures[i - 1].isLit) continue;
      const low = BigInt(pictures[i - 1].captureNs) - kUncertaintyNs;
      const high = BigInt(one.captureNs) + kPeriodNs + kUncertaintyNs;
      // That press came before the subscription.
      if (high < BigInt(presses[0])) continue;
      ++litCount;
      assert.ok(
        presses.some((press) => low <= BigInt(press) && BigInt(press) <= high),
        `lit at ${one.captureNs}, pressed at ${presses}`,
      );
    }
    assert.ok(litCount > 0, 'the lamp was never lit');
  });

  it('that is gone leaves no picture that looks live', async (t) => {
    if (system.camera === undefined) return t.skip('rtpm-camerad is not built');
    await system.camera.end('SIGKILL');
    await page
      .locator('.camera.is-stale')
      .or(page.locator('.live-side:not(:has(.camera))'))
      .waitFor();
  });
});

describe('parameters', () => {
  const field = (name) => page.locator(`[data-parameter="${name}"]`);

  it('a greater stiffness makes a greater force', async () => {
    await show(page, 'parameters/lab/servo');
    const stiffness = field('wall.stiffness_newton_per_m');
    await stiffness.getByText('N/m', {exact: true}).waitFor();
    await stiffness.getByRole('textbox').fill('600');
    await byId('apply').click();
    await page.getByText('Applied 1 change to lab/servo.').waitFor();
    await show(page, 'live/lab/arm0');
    // The stroke goes 9 mm deep at most, where 60 N/m gave about half a newton.
    await until('a greater force', force, (newton) => newton > 0.9);
  });

  it('out of range is said in the form, and nothing is sent', async () => {
    await show(page, 'parameters/lab/arm0');
    const ramp = field('safety.ramp_s');
    await ramp.getByRole('textbox').fill('3');
    await ramp.getByText('3 is above the range: 0 to 0.02 s.').waitFor();
    assert.ok(await byId('apply').isDisabled());
    await ramp.getByRole('textbox').press('Escape');
    await ramp.getByText('not applied yet').waitFor({state: 'detached'});
  });

  it("the server's refusal is shown at the field", async () => {
    const low = field('workspace.low_m');
    await low.getByRole('textbox').fill('0.09 0.09 0.09');
    const high = field('workspace.high_m');
    await high.getByRole('textbox').fill('-0.09 -0.09 -0.09');
    await byId('apply').click();
    await page.locator('.field .problem').getByText('Refused:').first().waitFor();
    await button('Discard what I typed').click();
  });

  it("another operator's change is said, and what was typed is kept", async () => {
    const ramp = field('safety.ramp_s');
    await ramp.getByRole('textbox').fill('0.01');
    await visit(browser, system.url, {}, async (other) => {
      await show(other, 'parameters/lab/arm0');
      await other.locator('[data-parameter="safety.ramp_s"]').getByRole('textbox').fill('0.015');
      await other.getByTestId('apply').click();
      await other.getByText('Applied 1 change').waitFor();
    });
    await ramp.getByText('Changed elsewhere meanwhile, from 0.02 to 0.015.').waitFor();
    assert.equal(await ramp.getByRole('textbox').inputValue(), '0.01');
    await byId('apply').click();
    await page.getByText('Applied 1 change to lab/arm0.').waitFor();
    await button('Save').click();
    await page.getByText('Saved for the next start of the device server.').waitFor();
  });

  it('a calibration runs, asks, and is kept', async () => {
    await show(page, 'parameters/lab/arm1');
    await button('Calibrate lab/arm1').click();
    await page.locator('.offers li', {hasText: 'encoder_offset'}).getByRole('button').click();
    const phase = byId('calibration-phase');
    await phase.getByText('Waits for you').waitFor();
    await keep(page, artefacts, 'calibration-desktop-light');
    await page.getByRole('dialog').getByRole('button', {name: 'ready'}).click();
    await button('Keep and save').click();
    await phase.getByText('The result is kept and saved').waitFor();
    await button('Close').click();
  });
});

describe('recordings', () => {
  it('are made, listed and replayed in the same views', async () => {
    await show(page, 'recordings');
    await byId('record').click();
    await page.locator('.rec').waitFor();
    await until(
      'messages',
      () => page.locator('.record-facts').textContent(),
      (text) => Number(/([\d\u202f]+) messages/.exec(text)?.[1].replace('\u202f', '')) > 4000,
    );
    // Long enough for a curve, however fast the messages come.
    await until(
      'six seconds',
      () => page.locator('.rec').textContent(),
      (text) => !/0:0[0-5]/.test(text),
    );
    await byId('record').click();
    await page.getByText('is complete').waitFor();
    await page
      .getByRole('button', {name: /^Replay .*\.mcap$/})
      .first()
      .click();
    await page.locator('.space.is-replay').waitFor();
    await page.getByText('Commands are not shown here').waitFor();
    await until('recorded motion', () => reading(page, 'x'), Number.isFinite);
    await keep(page, artefacts, 'replay-desktop-light');
  });

  it('pause, and seek', async () => {
    const time = () => byId('replay-time').textContent();
    await until('its end', () => button('Play').count());
    const slider = page.getByRole('slider', {name: 'Time of the replay'});
    await slider.fill('0');
    await until('the beginning', time, (text) => text.startsWith('0:00.0'));
    // The curves up to the sought time are there at once, without playing on.
    await slider.press('End');
    await until('the end', time, (text) => !text.startsWith('0:00.0'));
    await until(
      'curves',
      () => paintedColumns('strip-position'),
      (count) => count > 50,
    );
    await keep(page, artefacts, 'replay-sought-desktop-light');
    await slider.fill('0');
    await until('the beginning again', time, (text) => text.startsWith('0:00.0'));
    // So slow that its end does not come before the click.
    await page.locator('.timeline select').selectOption('0.1');
    await until('motion', time, (text) => !text.startsWith('0:00.0'));
    await button('Pause').click();
    await button('Play').waitFor();
    const pausedTime = await time();
    await byId('play').click();
    await until('further motion', time, (text) => text !== pausedTime);
    await page.locator('.timeline').getByRole('button', {name: 'Close'}).click();
    await page.locator('.timeline').waitFor({state: 'detached'});
    await page.locator('.space.is-replay').waitFor({state: 'detached'});
  });
});

describe('events', () => {
  it('a fault in the filter is shown at its character', async () => {
    await show(page, 'events');
    await page.getByLabel('Which events?').fill('type(rtpm.device.ContactChange)');
    await button('Show').click();
    const fault = byId('filter-fault').locator('pre');
    await fault.waitFor();
    assert.match(await fault.textContent(), /^type\(rtpm\.device\.ContactChange\)\n {5}\^$/);
  });

  it('that pass the filter are listed', async () => {
    await page.getByLabel('Which events?').fill('type(rtpm.device.ContactChanged)');
    await button('Show').click();
    await page.locator('.log').getByText('rtpm.device.ContactChanged').first().waitFor();
    await keep(page, artefacts, 'events-desktop-light');
    await button('End').click();
  });
});

describe('looks of the first page', () => {
  // clients/console/page.png is a copy of it: charts fill while the page is open.
  it('well for the documents', async () => {
    await show(page, 'live/lab/arm0');
    await until('a force', force, (newton) => newton > 0.5);
    await keep(page, artefacts, 'page');
  });

  it('can be reached by the keyboard', async () => {
    await show(page, 'overview');
    await page.reload();
    await page.locator('.link-live').waitFor();
    await page.keyboard.press('Tab');
    assert.equal(await page.evaluate(() => document.activeElement.className), 'skip');
    await page.keyboard.press('Enter');
    assert.equal(await page.evaluate(() => document.activeElement.id), 'main');
  });
});

describe('without a token', () => {
  it('is read only, and says so', async () => {
    await visit(browser, `http://127.0.0.1:${system.port}/#/live/lab/arm0`, {}, async (other) => {
      await other.getByText('read only', {exact: true}).waitFor();
      await until('a position', () => reading(other, 'x'), Number.isFinite);
      assert.ok(await other.getByTestId('stop').isDisabled());
      assert.ok(await other.getByRole('button', {name: 'Deactivate'}).isDisabled());
      assert.equal(await other.getByTestId('markers').count(), 0);
      await show(other, 'recordings');
      assert.ok(await other.getByTestId('record').isDisabled());
    });
  });
});

describe('the connection', () => {
  it('is lost visibly, comes back by itself, and what was typed stays', async () => {
    await show(page, 'parameters/lab/arm0');
    const soft = page.locator('[data-parameter="safety.soft_start_s"]').getByRole('textbox');
    await soft.fill('0.4');
    await system.console.end('SIGKILL');
    await page.locator('.link-lost').waitFor();
    await page.getByText('The connection to the console is lost').waitFor();
    assert.ok(await byId('apply').isDisabled());
    await show(page, 'live/lab/arm0');
    await until('no live number', force, Number.isNaN);
    await page.locator('.strip.is-stale').first().waitFor();
    await keep(page, artefacts, 'lost-desktop-light');
    await page.keyboard.press('Control+Shift+Space');
    await page.getByText('The emergency stop was NOT sent').waitFor();
    await page.getByRole('button', {name: 'Dismiss'}).click();
    await system.startConsole(system.port);
    await page.locator('.link-live').waitFor();
    await until('a live number', force, Number.isFinite);
    await show(page, 'parameters/lab/arm0');
    assert.equal(await soft.inputValue(), '0.4');
    await until('a form that can be applied', () => byId('apply').isEnabled());
    await button('Discard what I typed').click();
  });
});

describe('operators', () => {
  it('two at once: the second is refused, and may take over', async () => {
    await visit(browser, system.url, {}, async (other) => {
      await show(other, 'live/lab/knob0');
      await other.getByTestId('lifecycle').getByText('active', {exact: true}).waitFor();
      await show(page, 'live/lab/knob0');
      await button('Take over').click();
      await byId('lease').getByText('this console').waitFor();
      await other.getByRole('button', {name: 'Deactivate'}).click();
      await other.getByText('another browser').waitFor();
      await keep(other, artefacts, 'refused-desktop-light');
      await other.getByRole('button', {name: 'Take over all the same'}).click();
      await other.getByText('Done: this console holds the lease.').waitFor();
      await other.getByRole('button', {name: 'Deactivate'}).click();
      await other.getByTestId('lifecycle').getByText('inactive').waitFor();
      await other.getByRole('button', {name: 'Activate', exact: true}).click();
      await other.getByTestId('lifecycle').getByText('active', {exact: true}).waitFor();
      await other.getByRole('button', {name: 'Release'}).click();
      await other.getByTestId('lease').getByText('free').waitFor();
    });
  });
});

describe('the emergency stop', () => {
  async function rearm() {
    await byId('stopped').getByRole('button', {name: 'Rearm all…'}).click();
    await byId('stopped')
      .getByRole('button', {name: /^Rearm \d+ devices$/})
      .click();
    await byId('stopped').waitFor({state: 'detached'});
  }

  it('by the button takes the force away, and stays until rearmed', async () => {
    await show(page, 'live/lab/arm0');
    await until('a force', force, (newton) => newton > 0.05);
    await byId('stop').click();
    await byId('stopped').waitFor();
    await byId('faults').getByText('emergency stop').waitFor();
    await until('no force', force, (newton) => newton === 0);
    await page.locator('.stop.is-latched').waitFor();
    await keep(page, artefacts, 'stopped-desktop-light');
    assert.deepEqual(await accessibilityFaults(page), []);
    await rearm();
  });

  it('by the key works from within a text field, too', async () => {
    await show(page, 'events');
    const filter = page.getByLabel('Which events?');
    await filter.fill('all');
    await filter.press('Control+Shift+Space');
    await byId('stopped').waitFor();
    assert.equal(await filter.inputValue(), 'all');
    await rearm();
    assert.deepEqual(page.faults, []);
  });
});

describe('a device that vanishes', () => {
  it('is said to be lost, while its form keeps what was typed', async () => {
    await show(page, 'parameters/lab/arm0');
    const soft = page.locator('[data-parameter="safety.soft_start_s"]').getByRole('textbox');
    await soft.fill('0.4');
    await system.devices.end('SIGKILL');
    await show(page, 'overview');
    await until(
      'nothing live',
      () => page.locator('.device-live').count(),
      (count) => count === 0,
    );
    // Also when its name has expired.
    await page
      .locator('.device')
      .filter({hasText: /lost for/})
      .first()
      .waitFor();
    await byId('link').getByText('5 lost').waitFor();
    assert.equal(await page.locator('.device-lost').count(), 5);
    await keep(page, artefacts, 'devices-lost-desktop-light');
    await show(page, 'parameters/lab/arm0');
    assert.equal(await soft.inputValue(), '0.4');
    assert.deepEqual(page.faults, []);
  });

  it('is not stopped, which is said until it is dismissed', async () => {
    await show(page, 'overview');
    await byId('stop').click();
    await byId('not-stopped').getByText('use the hardware stop').waitFor();
    await byId('link').getByText('NOT stopped').waitFor();
    await keep(page, artefacts, 'not-stopped-desktop-light');
    assert.deepEqual(await accessibilityFaults(page), []);
    // A reload, as another browser, sees it, too.
    await page.reload();
    await byId('not-stopped').waitFor();
    await byId('not-stopped').getByRole('button', {name: 'Dismiss…'}).click();
    await byId('not-stopped').getByRole('button', {name: 'Dismiss 5 devices'}).click();
    await byId('not-stopped').waitFor({state: 'detached'});
    assert.equal(await page.locator('.device-lost').count(), 0);
    assert.deepEqual(page.faults, []);
  });
});
