import {useEffect} from 'preact/hooks';
import {useApp} from '../store/app';
import type {Entry} from '../store/recordings';
import {writeRoute} from '../store/route';
import {ExportMenu} from './export_menu';
import {Badge, Card, Empty, Notice} from '../parts/parts';
import {bytes, dayAndTime, duration, thousands} from '../parts/text';
import {SessionCard} from './session';

/** Records, lists recordings, and opens one for replay. */
export function RecordingsView() {
  const app = useApp();
  const hasService = app.link.services.value.has('console/recordings');
  const file = app.state.value?.recording.file ?? null;
  useEffect(() => {
    if (hasService) void app.recordings.refresh();
  }, [hasService, file]);
  const {problem, done} = app.recordings;
  return (
    <div class="recordings">
      <SessionCard />
      <Card
        title="Recordings"
        aside={
          <button
            type="button"
            disabled={!hasService}
            onClick={() => void app.recordings.refresh()}
          >
            Read the list anew
          </button>
        }
      >
        {problem.value !== '' && (
          <Notice tone="bad" role="alert">
            {problem.value}
          </Notice>
        )}
        {done.value !== '' && (
          <Notice tone="good" role="status">
            {done.value}
          </Notice>
        )}
        <List entries={app.recordings.entries.value} hasService={hasService} />
      </Card>
    </div>
  );
}

function List({entries, hasService}: {entries: readonly Entry[] | null; hasService: boolean}) {
  if (entries === null) {
    return (
      <Empty>
        {hasService ? 'Reading the list.' : 'The list needs a connection that may command.'}
      </Empty>
    );
  }
  if (entries.length === 0) return <Empty>No recordings yet.</Empty>;
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label="Recordings">
      <table>
        <thead>
          <tr>
            <th scope="col">File</th>
            <th scope="col">From</th>
            <th scope="col" class="number">
              Length
            </th>
            <th scope="col" class="number">
              Messages
            </th>
            <th scope="col" class="number">
              Size
            </th>
            <th scope="col">
              <span class="visually-hidden">Replay</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {entries.map((entry) => (
            <Row key={entry.file} entry={entry} />
          ))}
        </tbody>
      </table>
    </div>
  );
}

function Row({entry}: {entry: Entry}) {
  const app = useApp();
  const isOpen = app.state.value?.replay?.file === entry.file;
  const open = async () => {
    if (!(await app.recordings.open(entry.file))) return;
    app.showsReplay.value = true;
    window.location.hash = writeRoute('live');
  };
  return (
    <tr>
      <th scope="row">
        {entry.file} {!entry.isComplete && <Badge tone="warn">not complete</Badge>}
      </th>
      <td>{entry.beginNs > 0 ? dayAndTime(entry.beginNs / 1e6) : '–'}</td>
      <td class="number">{duration((entry.endNs - entry.beginNs) / 1e9)}</td>
      <td class="number">{thousands(entry.messageCount)}</td>
      <td class="number">{bytes(entry.byteCount)}</td>
      <td class="number row-actions">
        <ExportMenu file={entry.file} />
        <button
          type="button"
          disabled={!app.isLive.value || !app.mayCommand.value}
          aria-label={`Replay ${entry.file}`}
          onClick={() => void open()}
        >
          {isOpen ? 'Replay again' : 'Replay'}
        </button>
      </td>
    </tr>
  );
}
