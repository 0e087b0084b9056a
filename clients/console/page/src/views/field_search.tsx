import {useEffect, useState} from 'preact/hooks';
import {sampleFields, unitOf} from '../model/fields';
import {kCurveMax, kCurvesInAllMax} from '../model/layout';
import {finder} from '../model/words';
import {Combobox, type Option} from '../parts/combobox';
import {thousands} from '../parts/text';
import {useApp} from '../store/app';
import type {Found, FoundFields} from '../store/plot_data';
import {titleOf} from '../store/plots';
import {Problem} from '../parts/parts';
import {texts} from '../texts/texts';

const kShownMax = 60;
const kTypingMs = 120;
/** So few are offered to be added at once. */
const kTogetherMax = 8;

/** Searches all fields by words, and adds them to a plot. */
export function FieldSearch({inputRef}: {inputRef: {current: HTMLInputElement | null}}) {
  const app = useApp();
  const {plots} = app;
  const words = texts.value.plots;
  const [query, setQuery] = useState('');
  const [isOpen, setOpen] = useState(false);
  const [found, setFound] = useState<FoundFields>({fields: [], totalCount: 0});
  const [problem, setProblem] = useState('');
  const hasService = app.link.services.value.has('console/fields');
  const devices = app.devices.value;
  const layout = plots.layout.value;
  const target = Math.min(plots.target.value, layout.plots.length);
  const shown = layout.plots[target]?.fields ?? [];

  useEffect(() => {
    if (!isOpen) return undefined;
    let isEnded = false;
    const search = async () => {
      try {
        const reply = hasService
          ? await plots.data.find(query, kShownMax)
          : searchIn(devices.flatMap(sampleFields), query);
        if (isEnded) return;
        setFound(reply);
        setProblem('');
      } catch (error) {
        if (!isEnded) setProblem((error as Error).message);
      }
    };
    const timer = setTimeout(() => void search(), kTypingMs);
    return () => {
      isEnded = true;
      clearTimeout(timer);
    };
    // The devices of a system without the service seldom change while somebody types.
  }, [query, isOpen, hasService]);

  const isTogether = query.trim() !== '' && found.fields.length > 1;
  const offersAll = isTogether && found.totalCount <= kTogetherMax;

  const add = (paths: readonly string[]) => {
    const isAdded = plots.add(paths);
    setProblem(isAdded ? '' : words.tooMany(kCurveMax, kCurvesInAllMax));
  };
  const choose = (index: number) => {
    const one = found.fields[index];
    add(one !== undefined ? [one.path] : found.fields.map(({path}) => path));
  };
  const options = found.fields.map(({path, unit}): Option => ({
    key: path,
    label: `${shown.includes(path) ? '✓ ' : ''}${path}`,
    aside: unit,
  }));
  if (offersAll) options.push({key: 'all', label: <b>{words.addAll(found.fields.length)}</b>});

  return (
    <div class="field-search">
      <Combobox
        inputRef={inputRef}
        label={words.search}
        placeholder={words.search}
        query={query}
        onQuery={setQuery}
        options={options}
        onChoose={choose}
        isMultiple
        isOpen={isOpen}
        onOpen={setOpen}
        note={
          <>
            {found.fields.length === 0
              ? words.nothingFound
              : words.foundCount(found.fields.length, thousands(found.totalCount))}
            {!hasService && ` ${words.needsToken}`}
          </>
        }
      />
      <label class="field-target">
        <span>{words.addTo}</span>
        <select
          value={String(target)}
          onChange={(event) => (plots.target.value = Number(event.currentTarget.value))}
        >
          {layout.plots.map((plot, i) => (
            <option key={i} value={String(i)} disabled={plot.kind !== 'time'}>
              {i + 1}. {titleOf(plot)}
            </option>
          ))}
          <option value={String(layout.plots.length)}>{words.newPlot}</option>
        </select>
      </label>
      <Problem text={problem} />
    </div>
  );
}

function searchIn(paths: readonly string[], query: string): FoundFields {
  const all = paths.filter(finder(query));
  const fields: Found[] = all.slice(0, kShownMax).map((path) => ({path, unit: unitOf(path, null)}));
  return {fields, totalCount: all.length};
}
