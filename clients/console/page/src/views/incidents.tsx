import {useEffect, useState} from 'preact/hooks';
import {chosen, isUnseen, kShows, toCsv, type Incident, type Show} from '../model/incidents';
import {useApp} from '../store/app';
import {readFlightRecord} from '../store/flight_record';
import {writeRoute} from '../store/route';
import {download} from '../parts/download';
import {Badge, Card, Choice, Confirm, Empty, Notice, type Tone} from '../parts/parts';
import {dayAndTime, duration, thousands, timeOfDay} from '../parts/text';
import {texts} from '../texts/texts';
import {OperatorForm} from './operator';

const kTones: Readonly<Record<Incident['severity'], Tone>> = {
  info: 'plain',
  warning: 'warn',
  alarm: 'bad',
};
/** A device has a flight record of these. */
const kFlown = new Set(['lost', 'stopped', 'fault']);

/** Shorter ones are events, which do not last. */
const kMomentMs = 10;

/** The list of incidents: open ones first, then the newest. */
export function IncidentsView() {
  const app = useApp();
  const words = texts.value.incidents;
  const [show, setShow] = useState<Show>('unseen');
  const [search, setSearch] = useState('');
  useEffect(() => app.incidents.follow(), [app]);
  const list = app.incidents.list.value;
  const state = app.state.value?.incidents ?? null;
  const shown = list === null ? [] : chosen(list.incidents, show, search);
  const unseen = shown.filter(isUnseen);
  const mayAcknowledge = app.isLive.value && app.mayCommand.value && app.operator.name.value !== '';
  const shows = kShows.map((one) => ({value: one, label: texts.value.incidentShow[one]}));
  const save = async () => {
    const all = (app.mayCommand.value ? await app.incidents.all() : null) ?? list;
    if (all !== null) download('incidents.csv', toCsv(chosen(all.incidents, 'all', search)));
  };
  return (
    <div class="incidents">
      <Card
        title={words.title}
        aside={
          <span class="quiet small" data-testid="incident-count" role="status">
            {state !== null && words.counts(state.openCount, state.unseenCount)}
          </span>
        }
      >
        <Told />
        <div class="incident-tools">
          <Choice label={words.which} options={shows} value={show} onChange={setShow} />
          <label class="incident-search">
            <span class="visually-hidden">{words.search}</span>
            <input
              type="text"
              placeholder={words.search}
              value={search}
              onInput={(event) => setSearch(event.currentTarget.value)}
            />
          </label>
          <SoundSwitch />
          <button type="button" disabled={list === null} onClick={() => void save()}>
            {words.csv}
          </button>
          <Confirm
            label={words.acknowledgeAll(unseen.length)}
            question={words.acknowledgeQuestion(unseen.length)}
            confirm={words.acknowledge}
            disabled={!mayAcknowledge || unseen.length === 0}
            onConfirm={() => void app.incidents.acknowledge(unseen.map((one) => one.id))}
          />
        </div>
        {shown.length === 0 ? (
          <Empty>{list === null ? words.reading : texts.value.incidentNone[show]}</Empty>
        ) : (
          <ol class="incident-list" aria-label={words.title}>
            {shown.map((one) => (
              <Row key={one.id} incident={one} mayAcknowledge={mayAcknowledge} />
            ))}
          </ol>
        )}
        {list !== null && list.count > list.incidents.length && (
          <p class="quiet small">{words.older(thousands(list.count - list.incidents.length))}</p>
        )}
      </Card>
    </div>
  );
}

/** Faults of the list itself, and a name that is missing. */
function Told() {
  const app = useApp();
  const words = texts.value.incidents;
  const state = app.state.value?.incidents ?? null;
  const problem = app.incidents.problem.value;
  const needsName = app.isLive.value && app.mayCommand.value && app.operator.name.value === '';
  return (
    <>
      {needsName && (
        <Notice tone="accent">
          {words.needsName} <OperatorForm />
        </Notice>
      )}
      {problem !== '' && (
        <Notice tone="bad" role="alert">
          {problem}
        </Notice>
      )}
      {state !== null && state.problem !== '' && (
        <Notice tone="warn" role="status">
          {words.notKept(state.problem)}
        </Notice>
      )}
      {state !== null && state.tornCount > 0 && (
        <p class="quiet small">{words.torn(state.tornCount)}</p>
      )}
      {(app.incidents.list.value?.droppedCount ?? 0) > 0 && (
        <p class="quiet small">
          {words.dropped(thousands(app.incidents.list.value?.droppedCount ?? 0))}
        </p>
      )}
    </>
  );
}

function SoundSwitch() {
  const {sound} = useApp();
  const words = texts.value.incidents;
  const isWaiting = sound.isOn.value && !sound.isAllowed.value;
  return (
    <button
      type="button"
      aria-pressed={sound.isOn.value}
      title={isWaiting ? words.soundWaits : undefined}
      onClick={() => sound.set(!sound.isOn.value)}
    >
      {sound.isOn.value ? words.soundOn : words.soundOff}
    </button>
  );
}

function Row({incident: one, mayAcknowledge}: {incident: Incident; mayAcknowledge: boolean}) {
  const app = useApp();
  const words = texts.value.incidents;
  const what = (texts.value.incidentWhat as Readonly<Record<string, string>>)[one.what] ?? one.what;
  const isOpen = one.untilNs === null;
  const endMs = one.untilNs === null ? app.consoleMs() : one.untilNs / 1e6;
  const lengthMs = Math.max(0, endMs - one.sinceNs / 1e6);
  const length = duration(lengthMs / 1000);
  const isDevice = app.device(one.who) !== null;
  return (
    <li
      class={`incident incident-${one.severity} ${isOpen ? 'is-open' : ''}`}
      data-testid="incident"
      data-id={one.id}
    >
      <div class="incident-kind">
        <Badge tone={kTones[one.severity]}>{texts.value.severity[one.severity]}</Badge>
        {isOpen && <Badge tone="accent">{words.lasts}</Badge>}
      </div>
      <div class="incident-what">
        <b>
          {isDevice ? <a href={writeRoute('live', one.who)}>{one.who}</a> : one.who}: {what}
        </b>
        {one.count > 1 && <span class="quiet"> × {thousands(one.count)}</span>}
        {one.why !== '' && <p class="quiet small">{one.why}</p>}
      </div>
      <div class="incident-time">
        <time dateTime={new Date(one.sinceNs / 1e6).toISOString()}>
          {dayAndTime(one.sinceNs / 1e6)}
        </time>
        {isOpen && <span class="quiet small">{words.for(length)}</span>}
        {!isOpen && lengthMs >= kMomentMs && (
          <span class="quiet small">{words.lasted(length)}</span>
        )}
      </div>
      <div class="incident-links">
        {one.recording !== '' && (
          <a href={writeRoute('recordings', `${one.recording}/${Math.round(one.sinceNs)}`)}>
            {words.inRecording}
          </a>
        )}
        {kFlown.has(one.what) && <FlightRecordButton device={one.who} />}
      </div>
      <div class="incident-seen">
        {one.acknowledgedNs !== null ? (
          <span class="quiet small">
            {words.seenBy(one.acknowledgedBy, timeOfDay(one.acknowledgedNs / 1e6))}
          </span>
        ) : one.severity === 'info' ? null : (
          <button
            type="button"
            disabled={!mayAcknowledge}
            aria-label={`${words.acknowledge}: ${one.who}, ${what}`}
            onClick={() => void app.incidents.acknowledge([one.id])}
          >
            {words.acknowledge}
          </button>
        )}
      </div>
    </li>
  );
}

/** Keeps the cycles around the device's newest fault as a file. */
function FlightRecordButton({device}: {device: string}) {
  const app = useApp();
  const words = texts.value.incidents;
  const [note, setNote] = useState('');
  const isThere = app.link.services.value.has(`${device}/read_flight_record`);
  if (!isThere && note === '') return null;
  const save = async () => {
    try {
      const record = await readFlightRecord(app.link, device);
      if (record === null) return setNote(words.noFlight);
      download(`${device.replaceAll('/', '-')}-flight-${record.number}.csv`, record.csv);
      setNote(words.flight(record.number, record.cause));
    } catch (error) {
      setNote((error as Error).message);
    }
  };
  return (
    <>
      <button
        type="button"
        class="quiet-button"
        title={words.flightTip(device)}
        onClick={() => void save()}
      >
        {words.flightRecord}
      </button>
      <span class="quiet small" role="status">
        {note}
      </span>
    </>
  );
}
