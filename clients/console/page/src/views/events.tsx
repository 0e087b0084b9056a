import {useEffect, useRef, useState} from 'preact/hooks';
import {useApp} from '../store/app';
import type {FilterFault, LogRow} from '../store/log';
import {Card, Empty, Notice} from '../parts/parts';
import {Column} from '../parts/popup';
import {thousands, timeOfDay} from '../parts/text';
import {texts} from '../texts/texts';

const kExamples = [
  'type(rtpm.device.ButtonChanged, rtpm.device.ContactChanged)',
  'type(rtpm.device.StopChanged, rtpm.device.FaultChanged, rtpm.device.LifecycleChanged)',
  'type(rtpm.device.ConfigurationChanged)',
];

/** The events that pass a filter, as they come. */
export function EventsView() {
  const app = useApp();
  const {log} = app;
  const words = texts.value.events;
  const [draft, setDraft] = useState(log.filter.value ?? kExamples[0] ?? 'all');
  const isUsable = app.isLive.value && app.link.services.value.has('console/log_filter');
  const submit = (event: Event) => {
    event.preventDefault();
    if (isUsable) void log.set(draft);
  };
  return (
    <div class="events">
      <Card title={words.filter}>
        <form class="filter" onSubmit={submit}>
          <label for="filter">
            {words.which} <span class="quiet">{words.choose}</span>
          </label>
          <div class="input-row">
            <input
              id="filter"
              type="text"
              class="code"
              value={draft}
              autocomplete="off"
              spellcheck={false}
              aria-invalid={log.fault.value !== null}
              aria-describedby="filter-fault"
              onInput={(event) => setDraft(event.currentTarget.value)}
            />
            <button type="submit" class="strong" disabled={!isUsable}>
              {words.show}
            </button>
          </div>
          <div id="filter-fault" aria-live="polite">
            <Fault fault={log.fault.value} />
          </div>
          {log.problem.value !== '' && <Notice tone="bad">{log.problem.value}</Notice>}
          <div class="examples">
            {kExamples.map((one) => (
              <button
                key={one}
                type="button"
                class="quiet-button code"
                onClick={() => setDraft(one)}
              >
                {one}
              </button>
            ))}
          </div>
        </form>
      </Card>
      <LogCard />
    </div>
  );
}

/** The filter once more, with a caret below the character where it is wrong. */
function Fault({fault}: {fault: FilterFault | null}) {
  if (fault === null) return null;
  return (
    <div class="fault" data-testid="filter-fault">
      <pre>
        {fault.filter}
        {'\n'}
        {' '.repeat(Math.max(0, fault.offset))}^
      </pre>
      <p class="problem">{fault.what}</p>
    </div>
  );
}

function LogCard() {
  const app = useApp();
  const {log} = app;
  const list = useRef<HTMLDivElement>(null);
  const rows = log.rows.value;
  const words = texts.value.events;
  const isAtEnd = useRef(true);
  useEffect(() => {
    const target = list.current;
    if (target !== null && isAtEnd.current) target.scrollTop = target.scrollHeight;
  }, [rows]);
  const onScroll = () => {
    const target = list.current;
    if (target === null) return;
    isAtEnd.current = target.scrollHeight - target.scrollTop - target.clientHeight < 24;
  };
  const head = (
    <div class="row">
      <span class="quiet small">
        {log.filter.value === null
          ? words.noFilter
          : words.count(log.count.value, thousands(log.count.value))}
      </span>
      <button
        type="button"
        aria-pressed={log.isPaused.value}
        onClick={() => (log.isPaused.value = !log.isPaused.value)}
      >
        {words.pause}
      </button>
      <button type="button" disabled={log.filter.value === null} onClick={() => void log.set(null)}>
        {words.end}
      </button>
      <button type="button" onClick={() => log.clear()}>
        {words.clear}
      </button>
    </div>
  );
  return (
    <Card title={words.title} aside={head} class="log-card">
      {rows.length === 0 ? (
        <Empty>{log.filter.value === null ? words.setFilter : words.nothingYet}</Empty>
      ) : (
        <div
          ref={list}
          class="log scroll"
          tabIndex={0}
          role="region"
          aria-label={words.newestLast}
          onScroll={onScroll}
        >
          <table>
            <thead>
              <tr>
                <th scope="col">{words.time}</th>
                <th scope="col">{words.type}</th>
                <th scope="col">{words.from}</th>
                <Column name={words.number} help={words.numberHelp} isNumber />
                <th scope="col">{words.payload}</th>
              </tr>
            </thead>
            <tbody>
              {rows.map((row) => (
                <Row key={row.key} row={row} />
              ))}
            </tbody>
          </table>
        </div>
      )}
    </Card>
  );
}

function Row({row}: {row: LogRow}) {
  if (row.type === '') {
    return (
      <tr class="omitted">
        <td colSpan={5}>{texts.value.events.omitted(thousands(row.omittedCount))}</td>
      </tr>
    );
  }
  const millis = String(Math.floor((row.timeS * 1000) % 1000)).padStart(3, '0');
  return (
    <tr>
      <td class="time">
        {timeOfDay(row.timeS * 1000)}.{millis}
      </td>
      <td>{row.type}</td>
      <td>{row.from}</td>
      <td class="number">{row.sequence}</td>
      <td class="payload">{row.payload}</td>
    </tr>
  );
}
