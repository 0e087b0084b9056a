import {useSignal} from '@preact/signals';
import {useEffect} from 'preact/hooks';
import {finder} from '../model/words';
import {useApp} from '../store/app';
import type {Entry} from '../store/recordings';
import {writeRoute} from '../store/route';
import {ExportMenu} from './export_menu';
import {Badge, Card, Confirm, Empty, Notice} from '../parts/parts';
import {bytes, dayAndTime, duration, thousands} from '../parts/text';
import {texts} from '../texts/texts';
import {ReviewView} from './review';
import {SessionCard} from './session';

/** Records, lists recordings, and shows one: `#/recordings/run.mcap/TIME`, since 1970 in ns. */
export function RecordingsView() {
  const app = useApp();
  const [file = '', at = ''] = app.route.value.subject.split('/');
  if (file !== '') {
    return <ReviewView key={file} file={file} atNs={/^\d{1,20}$/.test(at) ? BigInt(at) : null} />;
  }
  return <RecordingsList />;
}

function RecordingsList() {
  const app = useApp();
  const words = texts.value.recordings;
  const hasService = app.link.services.value.has('console/recordings');
  const file = app.state.value?.recording.file ?? null;
  useEffect(() => {
    if (hasService) void app.recordings.refresh();
  }, [hasService, file]);
  const {problem, done, undo, purged, omittedCount} = app.recordings;
  return (
    <div class="recordings">
      <SessionCard />
      <Card
        title={texts.value.views.recordings}
        aside={
          <button
            type="button"
            disabled={!hasService}
            onClick={() => void app.recordings.refresh()}
          >
            {words.refresh}
          </button>
        }
      >
        {problem.value !== '' && (
          <Notice tone="bad" role="alert">
            {problem.value}
          </Notice>
        )}
        {undo.value !== null && <Undo {...undo.value} />}
        {done.value !== '' && (
          <Notice tone="good" role="status">
            {done.value}
          </Notice>
        )}
        {purged.value.length > 0 && (
          <Notice tone="warn" role="status">
            {words.purged(purged.value.join(', '))}
          </Notice>
        )}
        {omittedCount.value > 0 && (
          <Notice tone="warn">{words.omitted(thousands(omittedCount.value))}</Notice>
        )}
        <List entries={app.recordings.entries.value} hasService={hasService} />
        <DeletedList />
      </Card>
    </div>
  );
}

function Undo({id, file}: {id: string; file: string}) {
  const app = useApp();
  const words = texts.value.recordings;
  return (
    <Notice tone="good" role="status">
      {words.removed(file)}
      <button
        type="button"
        disabled={!app.isLive.value}
        onClick={() => void app.recordings.restore(id)}
      >
        {words.undo}
      </button>
    </Notice>
  );
}

type Column =
  | 'file'
  | 'participant'
  | 'experiment'
  | 'condition'
  | 'beginNs'
  | 'length'
  | 'messageCount'
  | 'byteCount';

const kTextColumns: ReadonlySet<Column> = new Set([
  'file',
  'participant',
  'experiment',
  'condition',
]);
const kSessionColumns = ['participant', 'experiment', 'condition'] as const;
const kPageSize = 100;

function valueOf(entry: Entry, column: Column): string | number {
  return column === 'length' ? entry.endNs - entry.beginNs : entry[column];
}

function compare(a: Entry, b: Entry, column: Column): number {
  const [one, other] = [valueOf(a, column), valueOf(b, column)];
  if (typeof one === 'number' && typeof other === 'number') return one - other;
  return String(one).localeCompare(String(other), undefined, {numeric: true});
}

function List({entries, hasService}: {entries: readonly Entry[] | null; hasService: boolean}) {
  const words = texts.value.recordings;
  const typed = useSignal('');
  const column = useSignal<Column>('beginNs');
  const isDescending = useSignal(true);
  const shownCount = useSignal(kPageSize);
  if (entries === null) return <Empty>{hasService ? words.reading : words.noService}</Empty>;
  if (entries.length === 0) return <Empty>{words.none}</Empty>;
  const session = kSessionColumns.filter((one) => entries.some((entry) => entry[one] !== ''));
  const isFound = finder(typed.value);
  const found = entries.filter(({file, participant, experiment, condition}) =>
    isFound(`${file} ${participant} ${experiment} ${condition}`),
  );
  const sorted = found.sort((a, b) => compare(a, b, column.value) * (isDescending.value ? -1 : 1));
  const columns: readonly (readonly [Column, string])[] = [
    ['file', words.file],
    ...session.map((one) => [one, words[one]] as const),
    ['beginNs', words.from],
    ['length', words.length],
    ['messageCount', words.messages],
    ['byteCount', words.size],
  ];
  const sortBy = (wanted: Column) => {
    isDescending.value = column.value === wanted ? !isDescending.value : !kTextColumns.has(wanted);
    column.value = wanted;
  };
  return (
    <>
      <div class="row recordings-search">
        <input
          type="search"
          aria-label={words.search}
          placeholder={words.search}
          value={typed.value}
          onInput={(event) => {
            typed.value = event.currentTarget.value;
            shownCount.value = kPageSize;
          }}
        />
        <span class="quiet" role="status">
          {words.count(thousands(found.length), thousands(entries.length))}
        </span>
      </div>
      {found.length === 0 ? (
        <Empty>{words.noneFound}</Empty>
      ) : (
        <div class="scroll" tabIndex={0} role="region" aria-label={texts.value.views.recordings}>
          <table class="recordings-table">
            <thead>
              <tr>
                {columns.map(([name, text]) => (
                  <th
                    key={name}
                    scope="col"
                    class={kTextColumns.has(name) || name === 'beginNs' ? '' : 'number'}
                    aria-sort={
                      column.value !== name
                        ? 'none'
                        : isDescending.value
                          ? 'descending'
                          : 'ascending'
                    }
                  >
                    <button type="button" class="sort" onClick={() => sortBy(name)}>
                      {text}
                      <span aria-hidden="true">
                        {column.value !== name ? '' : isDescending.value ? ' ▾' : ' ▴'}
                      </span>
                    </button>
                  </th>
                ))}
                <th scope="col">
                  <span class="visually-hidden">{words.replay}</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {sorted.slice(0, shownCount.value).map((entry) => (
                <Row key={entry.file} entry={entry} session={session} />
              ))}
            </tbody>
          </table>
        </div>
      )}
      {sorted.length > shownCount.value && (
        <button type="button" onClick={() => (shownCount.value += kPageSize)}>
          {words.showMore(Math.min(kPageSize, sorted.length - shownCount.value))}
        </button>
      )}
    </>
  );
}

interface RowProps {
  readonly entry: Entry;
  readonly session: readonly (typeof kSessionColumns)[number][];
}

function Row({entry, session}: RowProps) {
  const app = useApp();
  const words = texts.value.recordings;
  const isOpen = app.state.value?.replay?.file === entry.file;
  const isUsable = app.isLive.value && app.mayCommand.value;
  const open = async () => {
    if (!(await app.recordings.open(entry.file))) return;
    app.showsReplay.value = true;
    window.location.hash = writeRoute('live');
  };
  return (
    <tr>
      <th scope="row">
        <a class="recordings-file" href={writeRoute('recordings', entry.file)}>
          {entry.file}
        </a>{' '}
        {!entry.isComplete && <Badge tone="warn">{words.notComplete}</Badge>}
      </th>
      {session.map((one) => (
        <td key={one}>{entry[one] === '' ? '–' : entry[one]}</td>
      ))}
      <td>{entry.beginNs > 0 ? dayAndTime(entry.beginNs / 1e6) : '–'}</td>
      <td class="number">{duration((entry.endNs - entry.beginNs) / 1e9)}</td>
      <td class="number">{thousands(entry.messageCount)}</td>
      <td class="number">{bytes(entry.byteCount)}</td>
      <td class="number row-actions recordings-buttons">
        <ExportMenu file={entry.file} />
        <button
          type="button"
          disabled={!isUsable}
          aria-label={words.replayOf(entry.file)}
          onClick={() => void open()}
        >
          {isOpen ? words.replayAgain : words.replay}
        </button>
        <button
          type="button"
          disabled={!isUsable}
          aria-label={words.deleteOf(entry.file)}
          onClick={() => void app.recordings.remove(entry.file)}
        >
          {words.remove}
        </button>
      </td>
    </tr>
  );
}

function DeletedList() {
  const app = useApp();
  const words = texts.value.recordings;
  const deleted = app.recordings.deleted.value;
  if (deleted.length === 0) return null;
  const isUsable = app.isLive.value && app.mayCommand.value;
  const size = deleted.reduce((sum, one) => sum + one.byteCount, 0);
  return (
    <details class="recordings-deleted">
      <summary>{words.deletedTitle(deleted.length, bytes(size))}</summary>
      <p class="quiet">{words.deletedText}</p>
      <ul>
        {deleted.slice(0, kPageSize).map((one) => (
          <li key={one.id}>
            <span>
              {one.file} <span class="quiet">{dayAndTime(one.deletedMs)}</span>{' '}
              <span class="quiet">{bytes(one.byteCount)}</span>
            </span>
            <button
              type="button"
              disabled={!isUsable}
              aria-label={words.restoreOf(one.file)}
              onClick={() => void app.recordings.restore(one.id)}
            >
              {words.restore}
            </button>
          </li>
        ))}
      </ul>
      <Confirm
        label={words.empty}
        question={words.emptyQuestion(deleted.length)}
        confirm={words.empty}
        disabled={!isUsable}
        onConfirm={() => void app.recordings.removeForGood()}
      />
    </details>
  );
}
