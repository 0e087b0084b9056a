import {signal, useSignal} from '@preact/signals';
import {useEffect} from 'preact/hooks';
import {useApp, type App} from '../store/app';
import {kButtonMax, type MarkButton, type Marker, type Trial} from '../store/markers';
import {Badge, Notice, Problem} from '../parts/parts';
import {momentText} from '../model/span';
import {duration, thousands, timeOfDay} from '../parts/text';
import {texts} from '../texts/texts';

export const kBeginKey = 'b';
export const kEndKey = 'e';
const kListMax = 50;

const note = signal('');
const condition = signal('');
const response = signal('');

/** Marks moments and trials of an experiment, by a button or its key, and lists them. */
export function MarkerBar() {
  const app = useApp();
  const isEditing = useSignal(false);
  const isOpen = useSignal(false);
  const words = texts.value.markers;
  const {markers} = app;
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => press(app, event);
    window.addEventListener('keydown', onKey);
    return () => window.removeEventListener('keydown', onKey);
  }, [app]);
  const count = markers.live.rows.value.length + markers.live.omittedCount.value;
  const markNote = (event: Event) => {
    event.preventDefault();
    const label = note.value.trim();
    if (label === '') return;
    void markers.mark({label});
    note.value = '';
  };
  return (
    <section class="card markers" aria-label={words.title} data-testid="markers">
      <div class="marker-bar">
        <div class="marker-group">
          {markers.buttons.value.map((one) => (
            <button
              type="button"
              key={`${one.key} ${one.label}`}
              class="marker-button"
              onClick={() => void markers.mark({label: one.label})}
              {...(one.key === '' ? {} : {'aria-keyshortcuts': one.key})}
            >
              {one.label}
              {one.key !== '' && <kbd>{one.key.toUpperCase()}</kbd>}
            </button>
          ))}
        </div>
        <form class="marker-group marker-note" onSubmit={markNote}>
          <input
            type="text"
            aria-label={words.note}
            placeholder={words.note}
            maxLength={200}
            autocomplete="off"
            value={note.value}
            onInput={(event) => (note.value = event.currentTarget.value)}
          />
          <button type="submit" disabled={note.value.trim() === ''}>
            {words.mark}
          </button>
        </form>
        <TrialGroup />
        <div class="marker-group marker-tools">
          <button
            type="button"
            class="quiet-button"
            aria-expanded={isOpen.value}
            onClick={() => (isOpen.value = !isOpen.value)}
          >
            {words.count(thousands(count))}
          </button>
          <button
            type="button"
            class="quiet-button"
            aria-expanded={isEditing.value}
            onClick={() => (isEditing.value = !isEditing.value)}
          >
            {words.edit}
          </button>
        </div>
      </div>
      <Sent />
      {isEditing.value && <Editor />}
      {isOpen.value && <List />}
    </section>
  );
}

/** Without the console no one knows which trial is open; a mark waits until it is back. */
function TrialGroup() {
  const app = useApp();
  const isUsable = app.isLive.value;
  const words = texts.value.markers;
  const trial = app.markers.open.value;
  const isOpen = trial !== null;
  const value = isOpen ? response : condition;
  const label = isOpen ? words.response : words.condition;
  return (
    <form
      class={`marker-group marker-trial ${isOpen ? 'is-open' : ''}`}
      onSubmit={(event) => {
        event.preventDefault();
        if (isUsable) turnTrial(app, trial);
      }}
    >
      {isOpen && (
        <span class="trial-state">
          <b>{words.trial(trial.number)}</b> {trial.condition} <Since trial={trial} />
        </span>
      )}
      <input
        type="text"
        aria-label={label}
        placeholder={label}
        maxLength={60}
        autocomplete="off"
        value={value.value}
        onInput={(event) => (value.value = event.currentTarget.value)}
      />
      <button type="submit" disabled={!isUsable} aria-keyshortcuts={isOpen ? kEndKey : kBeginKey}>
        {isOpen ? words.end : words.begin(app.markers.nextNumber.value)}
        <kbd>{(isOpen ? kEndKey : kBeginKey).toUpperCase()}</kbd>
      </button>
    </form>
  );
}

function Since({trial}: {trial: Trial}) {
  const app = useApp();
  // It goes on with each state of the console.
  const nowNs = app.state.value?.timeNs ?? trial.beginNs;
  return <span class="number">{momentText(Math.max(0, nowNs - trial.beginNs) / 1e9, 0)}</span>;
}

/** Begins the next trial, or ends the open one. */
function turnTrial(app: App, trial: Trial | null): void {
  if (trial === null) {
    void app.markers.mark({
      phase: 'begin',
      number: app.markers.nextNumber.peek(),
      condition: condition.peek().trim(),
    });
    return;
  }
  void app.markers.mark({
    phase: 'end',
    number: trial.number,
    condition: trial.condition,
    response: response.peek().trim(),
  });
  response.value = '';
}

const kTyping = 'input, textarea, select, [contenteditable], dialog';

function press(app: App, event: KeyboardEvent): void {
  const isPlain = !event.ctrlKey && !event.altKey && !event.metaKey && !event.repeat;
  const target = event.target;
  if (!isPlain || event.defaultPrevented) return;
  if (target instanceof Element && target.closest(kTyping) !== null) return;
  const key = event.key.toLowerCase();
  const button = app.markers.buttons.peek().find((one) => one.key === key);
  const trial = app.markers.open.peek();
  if (button !== undefined) void app.markers.mark({label: button.label});
  else if (!app.isLive.peek()) return;
  else if (key === kBeginKey && trial === null) turnTrial(app, null);
  else if (key === kEndKey && trial !== null) turnTrial(app, trial);
  else return;
  event.preventDefault();
}

/** Marks on their way for longer than usual, and those that failed. */
function Sent() {
  const app = useApp();
  const words = texts.value.markers;
  const sent = app.markers.sent.value.filter((one) => one.why !== '');
  if (sent.length === 0) return null;
  return (
    <div role="status">
      {sent.map((one) => (
        <Notice key={one.key} tone={one.state === 'failed' ? 'bad' : 'warn'}>
          <b>
            {one.state === 'failed'
              ? words.failed(one.label, timeOfDay(one.timeNs / 1e6))
              : words.waits(one.label, timeOfDay(one.timeNs / 1e6))}
          </b>{' '}
          {one.why}
          {one.state === 'failed' && (
            <button type="button" onClick={() => app.markers.dismiss(one.key)}>
              {words.dismiss}
            </button>
          )}
        </Notice>
      ))}
    </div>
  );
}

function Editor() {
  const app = useApp();
  const words = texts.value.markers;
  const buttons = app.markers.buttons.value;
  const change = (at: number, part: Partial<MarkButton>) =>
    app.markers.setButtons(buttons.map((one, i) => (i === at ? {...one, ...part} : one)));
  const problem = problemOf(buttons);
  return (
    <fieldset class="marker-editor">
      <legend>{words.buttons}</legend>
      {buttons.map((one, at) => (
        <div class="row" key={at}>
          <input
            type="text"
            aria-label={words.label}
            maxLength={40}
            value={one.label}
            onInput={(event) => change(at, {label: event.currentTarget.value})}
          />
          <input
            type="text"
            class="marker-key"
            aria-label={words.key(one.label)}
            maxLength={1}
            value={one.key}
            onInput={(event) => change(at, {key: event.currentTarget.value.trim().toLowerCase()})}
          />
          <button
            type="button"
            aria-label={words.remove(one.label)}
            onClick={() => app.markers.setButtons(buttons.filter((_, i) => i !== at))}
          >
            ✕
          </button>
        </div>
      ))}
      <Problem text={problem} />
      <button
        type="button"
        disabled={buttons.length >= kButtonMax}
        onClick={() => app.markers.setButtons([...buttons, {label: words.newLabel, key: ''}])}
      >
        {words.add}
      </button>
    </fieldset>
  );
}

function problemOf(buttons: readonly MarkButton[]): string {
  const words = texts.value.markers;
  const keys = buttons.map((one) => one.key).filter((key) => key !== '');
  const twice = keys.find((key, i) => keys.indexOf(key) !== i);
  if (twice !== undefined) return words.twice(twice.toUpperCase());
  const taken = keys.find((key) => key === kBeginKey || key === kEndKey);
  return taken === undefined ? '' : words.taken(taken.toUpperCase());
}

function List() {
  const app = useApp();
  const words = texts.value.markers;
  const {rows, omittedCount, trials} = app.markers.live;
  const shown = rows.value.slice(-kListMax).reverse();
  const trialOf = (marker: Marker) =>
    marker.phase === 'mark' ? null : trials.value.find((one) => isOf(one, marker));
  if (shown.length === 0) return <p class="empty">{words.none}</p>;
  return (
    <>
      {omittedCount.value > 0 && (
        <Notice tone="warn">{words.omitted(thousands(omittedCount.value))}</Notice>
      )}
      <div class="scroll marker-list" tabIndex={0} role="region" aria-label={words.list}>
        <table>
          <thead>
            <tr>
              <th scope="col">{words.time}</th>
              <th scope="col">{words.label}</th>
              <th scope="col">{words.condition}</th>
              <th scope="col">{words.response}</th>
              <th scope="col" class="number">
                {words.length}
              </th>
            </tr>
          </thead>
          <tbody>
            {shown.map((one) => (
              <Row key={one.key} marker={one} trial={trialOf(one) ?? null} />
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}

function isOf(trial: Trial, marker: Marker): boolean {
  const {timeNs} = marker;
  const isIn = marker.phase === 'begin' ? trial.beginNs === timeNs : trial.endNs === timeNs;
  return isIn && trial.source === marker.source && trial.number === marker.number;
}

function Row({marker, trial}: {marker: Marker; trial: Trial | null}) {
  const words = texts.value.markers;
  const endNs = marker.phase === 'end' ? trial?.endNs : null;
  return (
    <tr>
      <td class="marker-time">{timeOfDay(marker.timeNs / 1e6)}</td>
      <th scope="row">
        {marker.label}
        {marker.phase === 'begin' && trial?.endNs === null && (
          <>
            {' '}
            <Badge tone="accent">{words.running}</Badge>
          </>
        )}
      </th>
      <td>{marker.condition}</td>
      <td>{marker.response}</td>
      <td class="number">
        {trial === null || endNs === null || endNs === undefined
          ? ''
          : duration((endNs - trial.beginNs) / 1e9)}
      </td>
    </tr>
  );
}
