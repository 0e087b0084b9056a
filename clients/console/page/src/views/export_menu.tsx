import {useEffect, useRef} from 'preact/hooks';
import {useSignal} from '@preact/signals';
import type {ComponentChildren} from 'preact';
import {Choice, Empty, useId} from '../parts/parts';
import {Popup} from '../parts/popup';
import {useApp} from '../store/app';
import type {Contents, Part, TableChoice} from '../store/exports';
import {texts} from '../texts/texts';

/** Downloads one recording: as it is, as a table, or as a table that is chosen. */
export function ExportMenu({file}: {file: string}) {
  const app = useApp();
  const words = texts.value.exports;
  const making = app.exports.making.value.get(file);
  const isUsable = app.isLive.value && app.mayCommand.value;
  if (making !== undefined) {
    return (
      <div class="export-progress">
        <progress value={making.part} aria-label={words.making(file)} />
        <span>{Math.floor(100 * making.part)} %</span>
        <button type="button" onClick={() => app.exports.cancel(file)}>
          {texts.value.parts.cancel}
        </button>
      </div>
    );
  }
  return (
    <div class="export-menu">
      <button
        type="button"
        disabled={!isUsable}
        aria-label={words.downloadFile(file)}
        onClick={() => void app.exports.download(file)}
      >
        {words.download}
      </button>
      <button
        type="button"
        disabled={!isUsable}
        aria-label={words.csvOf(file)}
        onClick={() => void app.exports.table(file, app.exports.lastChoice())}
      >
        {words.csv}
      </button>
      {isUsable && <TableForm file={file} />}
    </div>
  );
}

const kRates = [1000, 500, 100, 60, 10, 1] as const;

function TableForm({file}: {file: string}) {
  const app = useApp();
  const words = texts.value.exports;
  const contents = useSignal<Contents | null>(null);
  const choice = useSignal<TableChoice>(app.exports.lastChoice());
  const columns = useSignal(choice.value.columns.join(' '));
  const change = (changed: Partial<TableChoice>) => {
    choice.value = {...choice.value, ...changed};
  };
  const read = async () => {
    if (contents.value === null) contents.value = await app.exports.contents(file);
  };
  const around = useRef<HTMLSpanElement>(null);
  useEffect(() => {
    const span = around.current;
    const open = () => void read();
    // Only the panel's button makes it open, and the event does not bubble.
    span?.addEventListener('toggle', open, {capture: true});
    return () => span?.removeEventListener('toggle', open, {capture: true});
  }, []);
  const rates = [...new Set([...kRates, ...(choice.value.rateHz ? [choice.value.rateHz] : [])])];
  const make = (event: Event) => {
    event.preventDefault();
    const patterns = columns.value.split(/[\s,;]+/).filter((one) => one !== '');
    void app.exports.table(file, {...choice.value, columns: patterns});
  };
  return (
    <span ref={around}>
      <Popup
        button={<span aria-hidden="true">⋯</span>}
        label={words.chooseOf(file)}
        buttonClass="export-choose"
        class="export-form"
      >
        <form onSubmit={make}>
          <h3>{words.title(file)}</h3>
          <Row name={words.tables}>
            <Choice
              label={words.tables}
              options={[
                {value: 1, label: words.joined},
                {value: 0, label: words.perTopic},
              ]}
              value={choice.value.isJoined ? 1 : 0}
              onChange={(value) => change({isJoined: value === 1})}
            />
          </Row>
          <Select
            name={words.rows}
            value={String(choice.value.rateHz ?? '')}
            options={[
              ['', words.asRecorded],
              ...rates.map((rate): [string, string] => [String(rate), words.perSecond(rate)]),
            ]}
            onChange={(value) => change({rateHz: value === '' ? null : Number(value)})}
          />
          <label class="export-row">
            <span>{words.columns}</span>
            <input
              type="text"
              value={columns.value}
              placeholder={words.columnsLike}
              spellcheck={false}
              autocomplete="off"
              onInput={(event) => (columns.value = event.currentTarget.value)}
            />
          </label>
          <PartFields
            part={choice.value.part}
            contents={contents.value}
            onChange={(part) => change({part})}
          />
          <Topics
            topics={contents.value?.topics ?? null}
            chosen={choice.value.topics}
            onChange={(topics) => change({topics})}
          />
          <button type="submit" class="strong" disabled={choice.value.topics?.length === 0}>
            {words.make}
          </button>
        </form>
      </Popup>
    </span>
  );
}

function Row({name, children}: {name: string; children: ComponentChildren}) {
  return (
    <div class="export-row">
      <span>{name}</span>
      {children}
    </div>
  );
}

interface SelectProps {
  name: string;
  value: string;
  options: readonly (readonly [value: string, label: string])[];
  onChange: (value: string) => void;
}

function Select({name, value, options, onChange}: SelectProps) {
  return (
    <label class="export-row">
      <span>{name}</span>
      <select value={value} onChange={(event) => onChange(event.currentTarget.value)}>
        {options.map(([one, label]) => (
          <option key={one} value={one}>
            {label}
          </option>
        ))}
      </select>
    </label>
  );
}

interface PartFieldsProps {
  part: Part;
  contents: Contents | null;
  onChange: (part: Part) => void;
}

function PartFields({part, contents, onChange}: PartFieldsProps) {
  const words = texts.value.exports;
  const {marks = [], trials = [], conditions = []} = contents ?? {};
  const kinds: [Part['kind'], string][] = [
    ['all', words.whole],
    ['times', words.times],
  ];
  if (marks.length > 0) kinds.push(['marks', words.between]);
  if (trials.length > 0) kinds.push(['trial', words.trial]);
  if (conditions.length > 0) kinds.push(['condition', words.condition]);
  const begin = (kind: string): Part => {
    if (kind === 'times') return {kind, fromS: 0, toS: null};
    if (kind === 'marks') return {kind, first: marks[0] ?? '', second: marks.at(-1) ?? ''};
    if (kind === 'trial') return {kind, number: trials[0] ?? 0};
    if (kind === 'condition') return {kind, condition: conditions[0] ?? ''};
    return {kind: 'all'};
  };
  const pairs = (all: readonly string[]) => all.map((one): [string, string] => [one, one]);
  return (
    <>
      <Select
        name={words.part}
        value={part.kind}
        options={kinds}
        onChange={(kind) => onChange(begin(kind))}
      />
      {part.kind === 'times' && (
        <div class="export-pair">
          <Seconds
            name={words.from}
            value={part.fromS}
            onChange={(fromS) => onChange({...part, fromS})}
          />
          <Seconds name={words.to} value={part.toS} onChange={(toS) => onChange({...part, toS})} />
        </div>
      )}
      {part.kind === 'marks' && (
        <div class="export-pair">
          <Select
            name={words.from}
            value={part.first}
            options={pairs(marks)}
            onChange={(first) => onChange({...part, first})}
          />
          <Select
            name={words.to}
            value={part.second}
            options={pairs(marks)}
            onChange={(second) => onChange({...part, second})}
          />
        </div>
      )}
      {part.kind === 'trial' && (
        <Select
          name={words.trial}
          value={String(part.number)}
          options={pairs(trials.map(String))}
          onChange={(value) => onChange({kind: 'trial', number: Number(value)})}
        />
      )}
      {part.kind === 'condition' && (
        <Select
          name={words.condition}
          value={part.condition}
          options={pairs(conditions)}
          onChange={(condition) => onChange({kind: 'condition', condition})}
        />
      )}
    </>
  );
}

interface SecondsProps {
  name: string;
  value: number | null;
  onChange: (value: number | null) => void;
}

function Seconds({name, value, onChange}: SecondsProps) {
  return (
    <label class="export-row">
      <span>{name}</span>
      <input
        type="text"
        inputmode="decimal"
        value={value ?? ''}
        onChange={(event) => {
          const typed = event.currentTarget.value.trim().replace(',', '.');
          const seconds = Number(typed);
          onChange(typed === '' || !Number.isFinite(seconds) || seconds < 0 ? null : seconds);
        }}
      />
    </label>
  );
}

interface TopicsProps {
  topics: readonly string[] | null;
  chosen: readonly string[] | null;
  onChange: (topics: readonly string[] | null) => void;
}

function Topics({topics, chosen, onChange}: TopicsProps) {
  const words = texts.value.exports;
  const id = useId('topics');
  const isOn = (topic: string) => chosen === null || chosen.includes(topic);
  const toggle = (topic: string) => {
    const all = topics ?? [];
    const kept = all.filter((one) => (one === topic ? !isOn(one) : isOn(one)));
    onChange(kept.length === all.length ? null : kept);
  };
  return (
    <fieldset class="export-topics" aria-labelledby={id}>
      <div class="row">
        <span id={id}>{words.topics}</span>
        <button type="button" onClick={() => onChange(chosen === null ? [] : null)}>
          {chosen === null ? words.none : words.all}
        </button>
      </div>
      {topics === null ? (
        <Empty>{words.reading}</Empty>
      ) : (
        topics.map((topic) => (
          <label key={topic}>
            <input type="checkbox" checked={isOn(topic)} onChange={() => toggle(topic)} /> {topic}
          </label>
        ))
      )}
    </fieldset>
  );
}
