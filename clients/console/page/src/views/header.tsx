import {useApp} from '../store/app';
import {kViews, writeRoute, type View} from '../store/route';
import {kStopKeyText} from '../store/stop';
import {nextTheme, theme} from '../store/theme';
import {severity} from '../model/state';
import {clock} from '../parts/text';
import {texts} from '../texts/texts';
import {worstText} from './device_status';

const kThemeNames = {system: 'Auto', light: 'Light', dark: 'Dark'} as const;

export function Header() {
  const app = useApp();
  const {view, subject} = app.route.value;
  const subjectOf = (target: View) => (target === 'live' || target === 'parameters' ? subject : '');
  return (
    <header class="header">
      <div class="brand">
        <svg viewBox="0 0 32 32" aria-hidden="true">
          <path d="M3 21h7l3.5-13 5.5 16 3-9h7" />
        </svg>
        <div>
          <strong>RTPM console</strong>
          <span>{app.link.info.value?.metadata['rtpm.host'] ?? '\u00a0'}</span>
        </div>
      </div>
      <nav aria-label="Views">
        {kViews.map((one) => (
          <a
            key={one}
            href={writeRoute(one, subjectOf(one))}
            {...(one === view ? {'aria-current': 'page' as const} : {})}
          >
            {texts.value.views[one]}
          </a>
        ))}
      </nav>
      <div class="standing">
        <LinkStatus />
        <RecordStatus />
        <button
          type="button"
          class="theme"
          onClick={nextTheme}
          aria-label={`Colours: ${kThemeNames[theme.value]}; change`}
        >
          <svg viewBox="0 0 20 20" aria-hidden="true">
            <circle cx="10" cy="10" r="7" />
            <path d="M10 3a7 7 0 0 1 0 14z" />
          </svg>
          {kThemeNames[theme.value]}
        </button>
      </div>
      <StopButton />
    </header>
  );
}

function LinkStatus() {
  const app = useApp();
  const words = {
    connecting: 'Connecting',
    live: 'Live',
    silent: 'No data',
    lost: 'Not connected',
  } as const;
  const {phase} = app.link.state.value;
  const standing = app.standing.value;
  const isNotStopped = app.notStopped.value.length > 0;
  const tone = isNotStopped ? 'bad' : severity(standing.worst);
  const isAlarm = phase === 'live' && tone !== 'good';
  const word = isNotStopped ? 'NOT stopped' : worstText(standing);
  const access = app.mayCommand.value ? 'may command' : 'read only';
  return (
    <p class={`link link-${phase} ${isAlarm ? `link-is-${tone}` : ''}`} data-testid="link">
      <i aria-hidden="true" />
      <span>
        <b>{isAlarm ? word : words[phase]}</b>
        {phase === 'live' && <span class="access">{access}</span>}
      </span>
    </p>
  );
}

function RecordStatus() {
  const app = useApp();
  const recording = app.state.value?.recording;
  if (recording === undefined || recording.file === null || !app.isLive.value) return null;
  return (
    <a
      class="rec"
      href={writeRoute('recordings')}
      aria-label={`Recording ${recording.file}, ${Math.floor(recording.timeS)} seconds`}
    >
      <i aria-hidden="true" />
      REC {clock(recording.timeS)}
    </a>
  );
}

/** Always there, and always in the same place. */
function StopButton() {
  const app = useApp();
  const stoppedCount = app.stopped.value.length;
  // Where one is not stopped, the button is not spent.
  const isStopped =
    stoppedCount > 0 &&
    stoppedCount === app.devices.value.length &&
    app.notStopped.value.length === 0;
  const isAsked = app.stop.report.value.phase === 'asked';
  const mayStop = app.mayCommand.value || app.link.info.value === null;
  return (
    <button
      type="button"
      class={`stop ${isStopped ? 'is-latched' : ''}`}
      data-testid="stop"
      disabled={!mayStop}
      onClick={() => void app.stop.press()}
      aria-keyshortcuts="Control+Shift+Space"
    >
      <span class="stop-word">{isAsked ? 'STOPPING' : isStopped ? 'STOPPED' : 'STOP ALL'}</span>
      <span class="stop-key">{mayStop ? kStopKeyText : 'read only: use the hardware stop'}</span>
    </button>
  );
}
