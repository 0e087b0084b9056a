import {render} from 'preact';
import {kSubprotocols, type Socket} from './protocol/client';
import {App, AppContext} from './store/app';
import {Link} from './store/link';
import {routeSignal} from './store/route';
import {socketUrl, takeToken} from './store/session';
import {isStopKey} from './store/stop';
import {Shell} from './views/shell';
import './styles/tokens.css';
import './styles/base.css';
import './styles/parts.css';
import './styles/header.css';
import './styles/views.css';
import './styles/overview.css';
import './styles/exports.css';
import './styles/session.css';
import './styles/charts.css';
import './styles/plots.css';
import './styles/review.css';
import './styles/incidents.css';

const nowMs = () => performance.now();
const token = takeToken();
const link = new Link({
  open: () => new WebSocket(socketUrl(token), kSubprotocols) as Socket,
  nowMs,
});
const app = new App(link, routeSignal(), nowMs);

// Before any field or dialogue sees the key.
window.addEventListener(
  'keydown',
  (event) => {
    if (!isStopKey(event)) return;
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) void app.stop.press();
  },
  {capture: true},
);

app.setVisible(!document.hidden);
document.addEventListener('visibilitychange', () => app.setVisible(!document.hidden));
app.sound.start();
link.start();
// The 3-D view is there, too, when it is first shown after the connection was lost.
window.addEventListener('load', () => void import('./drawing/space'), {once: true});

const root = document.getElementById('root');
if (root !== null) {
  render(
    <AppContext.Provider value={app}>
      <Shell />
    </AppContext.Provider>,
    root,
  );
}
