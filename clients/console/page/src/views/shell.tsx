import type {ComponentChildren} from 'preact';
import {useEffect, useRef} from 'preact/hooks';
import {severity} from '../model/state';
import {useApp, type App} from '../store/app';
import {writeRoute, type View} from '../store/route';
import {texts} from '../texts/texts';
import {Banners} from './banners';
import {worstText} from './device_status';
import {EventsView} from './events';
import {Header} from './header';
import {IncidentsView} from './incidents';
import {LiveView} from './live';
import {MarkerBar} from './markers';
import {OverviewView} from './overview';
import {ParametersView} from './parameters';
import {PlotsView} from './plots';
import {RecordingsView} from './recordings';
import {Timeline} from './timeline';

/** Where an experimenter looks during a trial. */
const kMarkedViews: ReadonlySet<View> = new Set<View>(['live', 'plots', 'recordings']);

/** The page's frame: header with the stop, what must be known at once, and one view. */
export function Shell() {
  const app = useApp();
  const {view, subject} = app.route.value;
  const main = useRef<HTMLElement>(null);
  // A mark takes its time from the console's clock, which the first state tells.
  const isMarking =
    kMarkedViews.has(view) &&
    app.mayCommand.value &&
    app.state.value !== null &&
    !app.showsReplay.value;
  useEffect(() => {
    const state = !app.isLive.value ? texts.value.header.titleNotConnected : alarmOf(app);
    const unseen = app.state.value?.incidents.unseenCount ?? 0;
    const badge = unseen > 0 ? `(${unseen}) ` : '';
    // The subject of plots is their whole layout.
    const name = subject === '' || view === 'plots' ? '' : ` ${subject}`;
    document.title = `${badge}${state}${texts.value.views[view]}${name} · RTPM console`;
  });
  const skip = (event: Event) => {
    event.preventDefault();
    main.current?.focus();
  };
  return (
    <div
      class="shell"
      data-link={app.link.state.value.phase}
      data-replay={app.showsReplay.value ? 'yes' : 'no'}
    >
      <a class="skip" href={writeRoute(view, subject)} onClick={skip}>
        {texts.value.header.skip}
      </a>
      <Header />
      <Banners />
      <main id="main" ref={main} tabIndex={-1}>
        <h1 class="visually-hidden">{texts.value.views[view]}</h1>
        {isMarking && <MarkerBar />}
        <Shown view={view} />
      </main>
      <Timeline />
    </div>
  );
}

/** The alarm that the title of a window in the background must say. */
function alarmOf(app: App): string {
  if (app.notStopped.value.length > 0) return texts.value.header.titleNotStopped;
  if (app.stopped.value.length > 0) return texts.value.header.titleStopped;
  return severity(app.standing.value.worst) === 'bad' ? `${worstText(app.standing.value)}: ` : '';
}

function Shown({view}: {view: View}): ComponentChildren {
  switch (view) {
    case 'overview':
      return <OverviewView />;
    case 'live':
      return <LiveView />;
    case 'plots':
      return <PlotsView />;
    case 'parameters':
      return <ParametersView />;
    case 'recordings':
      return <RecordingsView />;
    case 'incidents':
      return <IncidentsView />;
    case 'events':
      return <EventsView />;
  }
}
