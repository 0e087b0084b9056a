import {signal} from '@preact/signals';
import {useApp} from '../store/app';
import {kViews, writeRoute, type View} from '../store/route';
import {severity} from '../model/state';
import {Popup} from '../parts/popup';
import {momentText} from '../model/span';
import {texts} from '../texts/texts';
import {worstText} from './device_status';
import {Settings} from './settings';

/** So narrow that the views are in a menu; also in styles/header.css. */
const narrow = window.matchMedia('(max-width: 640px)');
const isNarrow = signal(narrow.matches);
narrow.addEventListener('change', (event) => (isNarrow.value = event.matches));

export function Header() {
  const app = useApp();
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
      <Navigation />
      <div class="standing">
        <LinkStatus />
        <RecordStatus />
      </div>
      <Settings />
      <StopButton />
    </header>
  );
}

function Navigation() {
  const {view} = useApp().route.value;
  const words = texts.value;
  const links = kViews.map((one) => <ViewLink key={one} to={one} />);
  return (
    <nav aria-label={words.header.views}>
      {isNarrow.value ? (
        <Popup
          button={
            <>
              <svg viewBox="0 0 20 20" aria-hidden="true">
                <path d="M3 5h14M3 10h14M3 15h14" />
              </svg>
              {words.views[view]}
              <UnseenCount />
            </>
          }
          buttonClass="menu-button"
          class="menu"
        >
          {links}
        </Popup>
      ) : (
        links
      )}
    </nav>
  );
}

function ViewLink({to}: {to: View}) {
  const {view, subject} = useApp().route.value;
  const keeps = to === 'live' || to === 'parameters';
  return (
    <a
      href={writeRoute(to, keeps ? subject : '')}
      {...(to === view ? {'aria-current': 'page' as const} : {})}
    >
      {texts.value.views[to]}
      {to === 'incidents' && <UnseenCount />}
    </a>
  );
}

/** How many incidents nobody has acknowledged. */
function UnseenCount() {
  const count = useApp().state.value?.incidents.unseenCount ?? 0;
  if (count === 0) return null;
  return (
    <span class="nav-count" data-testid="unseen" title={texts.value.incidents.toDo(count)}>
      {count > 99 ? '99+' : count}
    </span>
  );
}

function LinkStatus() {
  const app = useApp();
  const words = texts.value.header;
  const {phase} = app.link.state.value;
  const standing = app.standing.value;
  const isNotStopped = app.notStopped.value.length > 0;
  const tone = isNotStopped ? 'bad' : severity(standing.worst);
  const isAlarm = phase === 'live' && tone !== 'good';
  const word = isNotStopped ? words.notStopped : worstText(standing);
  return (
    <p class={`link link-${phase} ${isAlarm ? `link-is-${tone}` : ''}`} data-testid="link">
      <i aria-hidden="true" />
      <span>
        <b>{isAlarm ? word : words[phase]}</b>
        {phase === 'live' && (
          <span class="access">{app.mayCommand.value ? words.mayCommand : words.readOnly}</span>
        )}
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
      aria-label={texts.value.header.recording(recording.file, Math.floor(recording.timeS))}
    >
      <i aria-hidden="true" />
      REC {momentText(recording.timeS, 0)}
    </a>
  );
}

/** Always there, and always in the same place. */
function StopButton() {
  const app = useApp();
  const words = texts.value.header;
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
      <span class="stop-word">
        {isAsked ? words.stopping : isStopped ? words.stopped : words.stopAll}
      </span>
      <span class="stop-key">{mayStop ? words.stopKey : words.stopReadOnly}</span>
    </button>
  );
}
