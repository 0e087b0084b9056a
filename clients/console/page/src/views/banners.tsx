import {useApp} from '../store/app';
import {writeRoute} from '../store/route';
import {Confirm, Notice} from '../parts/parts';
import {duration, timeOfDay} from '../parts/text';

/** What an operator must know wherever he is. */
export function Banners() {
  return (
    <div class="banners">
      <LinkBanner />
      <StopReportBanner />
      <NotStoppedBanner />
      <StoppedBanner />
      <ReplayBanner />
      <Complaint />
    </div>
  );
}

function LinkBanner() {
  const app = useApp();
  const {phase, lastMs} = app.link.state.value;
  if (phase === 'live' || (phase === 'connecting' && lastMs === null)) return null;
  const since = lastMs === null ? '' : ` since ${timeOfDay(lastMs)}`;
  const what =
    phase === 'silent'
      ? `The console is silent${since}.`
      : `The connection to the console is lost${since}.`;
  return (
    <Notice tone="bad" role="alert">
      <b>{what}</b> Nothing below is live. What you typed is kept; the page reconnects by itself.
    </Notice>
  );
}

function StopReportBanner() {
  const app = useApp();
  const report = app.stop.report.value;
  const dismiss = (
    <button type="button" onClick={() => app.stop.dismiss()}>
      Dismiss
    </button>
  );
  if (report.phase === 'waiting') {
    return (
      <Notice tone="bad" role="alert">
        <b>The emergency stop was NOT sent: there is no connection.</b> Use the hardware stop. It is
        sent as soon as the console answers. {dismiss}
      </Notice>
    );
  }
  // The console says it until it is delivered or dismissed.
  if (report.phase === 'failed' && report.isAnswered && app.notStopped.value.length > 0) return null;
  if (report.phase === 'done' && report.notes.length > 0) {
    return (
      <Notice tone="warn" role="alert">
        <b>Emergency stop:</b> every device that is known is stopped, but not all could be asked:{' '}
        {report.notes.join('; ')}. {dismiss}
      </Notice>
    );
  }
  if (report.phase === 'failed') {
    return (
      <Notice tone="bad" role="alert">
        <b>Emergency stop:</b> {report.words} Use the hardware stop. {dismiss}
      </Notice>
    );
  }
  return null;
}

/** So many devices' reasons fit the banner; those of more show at the pointer. */
const kReasonCountMax = 2;

/** Stays, whatever becomes of names and connections, until the stop is delivered or dismissed. */
function NotStoppedBanner() {
  const app = useApp();
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
        <b>NOT stopped: use the hardware stop.</b>{' '}
        {missing.map((one, i) => (
          <span key={`${one.device} ${one.url}`} title={`${one.url}: ${one.why}`}>
            {i > 0 && ', '}
            <b>{one.device}</b>
            {missing.length <= kReasonCountMax && ` for ${duration(one.sinceS)} (${one.why})`}
          </span>
        ))}
        {'. '}
        The stop is delivered as soon as {names.length === 1 ? 'it answers' : 'they answer'}.
      </p>
      <Confirm
        label="Dismiss"
        disabled={!isOperable}
        question={
          'Is the hardware stop pressed, or the device off? The stop is not delivered any more ' +
          'when it comes back.'
        }
        confirm={`Dismiss ${names.length === 1 ? names[0] : `${names.length} devices`}`}
        onConfirm={() => void dismissAll()}
      />
    </div>
  );
}

function StoppedBanner() {
  const app = useApp();
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
        <b>Emergency stop is in force:</b>{' '}
        {names.map((name, i) => (
          <span key={name}>
            {i > 0 && ', '}
            <a href={writeRoute('live', name)}>{name}</a>
          </span>
        ))}
        . No force, and no commands, until rearmed.
        {refusal !== undefined && <span class="refusal"> Not rearmed: {refusal.words}.</span>}
      </p>
      <Confirm
        label={names.length === 1 ? 'Rearm' : 'Rearm all'}
        disabled={!isOperable}
        question={
          'Is the cause removed, and is nobody in reach who does not expect force? The ' +
          'force returns slowly after this.'
        }
        confirm={`Rearm ${names.length === 1 ? names[0] : `${names.length} devices`}`}
        onConfirm={() => void rearmAll()}
      />
    </div>
  );
}

function ReplayBanner() {
  const app = useApp();
  const replay = app.state.value?.replay ?? null;
  if (replay === null) return null;
  const isShown = app.showsReplay.value;
  return (
    <Notice tone="replay">
      <b>{isShown ? 'REPLAY' : 'A recording is open'}</b> {replay.file}
      {isShown ? ': the Live view shows recorded motion, not the devices.' : '.'}{' '}
      <button type="button" onClick={() => (app.showsReplay.value = !isShown)}>
        {isShown ? 'Show the devices live' : 'Show the recording'}
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
      The console says: {complaint.message}{' '}
      <button type="button" onClick={() => (app.link.complaint.value = null)}>
        Dismiss
      </button>
    </Notice>
  );
}
