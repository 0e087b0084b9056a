import {useApp} from '../store/app';
import {writeRoute} from '../store/route';
import {Confirm, Notice} from '../parts/parts';
import {duration, timeOfDay} from '../parts/text';
import {texts} from '../texts/texts';

/** Facts that an operator must know in every view. */
export function Banners() {
  return (
    <div class="banners">
      <LinkBanner />
      <StopReportBanner />
      <NotStoppedBanner />
      <StoppedBanner />
      <RequestBanner />
      <ReplayBanner />
      <Complaint />
    </div>
  );
}

function LinkBanner() {
  const app = useApp();
  const words = texts.value.banners;
  const {phase, lastMs} = app.link.state.value;
  if (phase === 'live' || (phase === 'connecting' && lastMs === null)) return null;
  const isSilent = phase === 'silent';
  const since = lastMs === null ? null : timeOfDay(lastMs);
  const known = isSilent ? words.silentSince : words.lostSince;
  const unknown = isSilent ? words.silent : words.lost;
  return (
    <Notice tone="bad" role="alert">
      <b>{since === null ? unknown : known(since)}</b> {words.notLive}
    </Notice>
  );
}

function StopReportBanner() {
  const app = useApp();
  const words = texts.value.banners;
  const report = app.stop.report.value;
  const dismiss = (
    <button type="button" onClick={() => app.stop.dismiss()}>
      {texts.value.commands.dismiss}
    </button>
  );
  if (report.phase === 'waiting') {
    return (
      <Notice tone="bad" role="alert">
        <b>{words.notSent}</b> {words.notSentMore} {dismiss}
      </Notice>
    );
  }
  // The console says it until it is delivered or dismissed.
  if (report.phase === 'failed' && report.isAnswered && app.notStopped.value.length > 0)
    return null;
  if (report.phase === 'done' && report.notes.length > 0) {
    return (
      <Notice tone="warn" role="alert">
        <b>{words.stop}</b> {words.stopNotes(report.notes.join('; '))} {dismiss}
      </Notice>
    );
  }
  if (report.phase === 'failed') {
    return (
      <Notice tone="bad" role="alert">
        <b>{words.stop}</b> {report.words} {words.hardware} {dismiss}
      </Notice>
    );
  }
  return null;
}

/** The banner has room for the reasons of two devices; those of more show at the pointer. */
const kReasonCountMax = 2;

/** Stays, whatever becomes of names and connections, until the stop is delivered or dismissed. */
function NotStoppedBanner() {
  const app = useApp();
  const words = texts.value.banners;
  const missing = app.notStopped.value;
  if (missing.length === 0) return null;
  const names = [...new Set(missing.map((one) => one.device))];
  const isOperable = app.isLive.value && app.mayCommand.value;
  const dismissAll = async () => {
    for (const name of names) {
      if (!(await app.commands.run('dismiss', name))) break;
    }
  };
  return (
    <div class="notice notice-bad stopped" role="alert" data-testid="not-stopped">
      <p>
        <b>{words.notStopped}</b>{' '}
        {missing.map((one, i) => (
          <span key={`${one.device} ${one.url}`} title={`${one.url}: ${one.why}`}>
            {i > 0 && ', '}
            <b>{one.device}</b>
            {missing.length <= kReasonCountMax &&
              words.notStoppedFor(duration(one.sinceS), one.why)}
          </span>
        ))}
        {'. '}
        {words.delivered(names.length)}
      </p>
      <Confirm
        label={texts.value.commands.dismiss}
        disabled={!isOperable}
        question={words.dismissQuestion}
        confirm={
          names.length === 1 ? words.dismissOne(names[0] ?? '') : words.dismissMany(names.length)
        }
        onConfirm={() => void dismissAll()}
      />
    </div>
  );
}

function StoppedBanner() {
  const app = useApp();
  const words = texts.value.banners;
  const commands = texts.value.commands;
  const stopped = app.stopped.value;
  if (stopped.length === 0) return null;
  const isOperable = app.isLive.value && app.mayCommand.value;
  const names = stopped.map((one) => one.name);
  const rearmAll = async () => {
    for (const name of names) {
      if (!(await app.commands.run('rearm', name))) break;
    }
  };
  const refusal = names
    .map((name) => app.commands.refusals.value.get(name))
    .find((one) => one?.command === 'rearm');
  return (
    <div class="notice notice-bad stopped" role="alert" data-testid="stopped">
      <p>
        <b>{words.inForce}</b>{' '}
        {names.map((name, i) => (
          <span key={name}>
            {i > 0 && ', '}
            <a href={writeRoute('live', name)}>{name}</a>
          </span>
        ))}
        . {words.noForce}
        {refusal !== undefined && <span class="refusal"> {words.notRearmed(refusal.words)}</span>}
      </p>
      <Confirm
        label={names.length === 1 ? commands.rearm : commands.rearmAll}
        disabled={!isOperable}
        question={commands.rearmQuestion}
        confirm={
          names.length === 1 ? commands.rearmOne(names[0] ?? '') : commands.rearmMany(names.length)
        }
        onConfirm={() => void rearmAll()}
      />
    </div>
  );
}

/** Other operators ask for devices that this browser operates. */
function RequestBanner() {
  const app = useApp();
  const words = texts.value.lease;
  const asked = app.devices.value.filter(
    (one) => one.lease.request !== null && app.operator.holds(one),
  );
  if (!app.isLive.value || asked.length === 0) return null;
  return (
    <>
      {asked.map((device) => {
        const request = device.lease.request;
        if (request === null) return null;
        const room = request.room === '' ? '' : ` (${request.room})`;
        const who = `${request.name === '' ? words.somebody : request.name}${room}`;
        const leftS = Math.ceil(Math.max(0, request.endsInS));
        return (
          <div
            key={device.name}
            class="notice notice-accent lease-asked"
            role="alert"
            data-testid="asked"
          >
            <b>{words.asks(who, device.name)}</b>
            <span class="quiet" aria-hidden="true">
              {leftS} s
            </span>
            <button
              type="button"
              class="strong"
              onClick={() => void app.operator.answer(device.name, true)}
            >
              {words.handOver}
            </button>
            <button type="button" onClick={() => void app.operator.answer(device.name, false)}>
              {words.keep}
            </button>
          </div>
        );
      })}
    </>
  );
}

function ReplayBanner() {
  const app = useApp();
  const words = texts.value.banners;
  const replay = app.state.value?.replay ?? null;
  if (replay === null) return null;
  const isShown = app.showsReplay.value;
  return (
    <Notice tone="replay">
      <b>{isShown ? 'REPLAY' : words.recordingOpen}</b> {replay.file}
      {isShown ? `: ${words.replayed}` : '.'}{' '}
      <button type="button" onClick={() => (app.showsReplay.value = !isShown)}>
        {isShown ? words.showDevices : words.showRecording}
      </button>
    </Notice>
  );
}

const kComplaintMs = 15000;

function Complaint() {
  const app = useApp();
  const complaint = app.link.complaint.value;
  if (complaint === null || Date.now() - complaint.atMs > kComplaintMs) return null;
  return (
    <Notice tone="warn">
      {texts.value.banners.complaint(complaint.message)}{' '}
      <button type="button" onClick={() => (app.link.complaint.value = null)}>
        {texts.value.commands.dismiss}
      </button>
    </Notice>
  );
}
