import {useState} from 'preact/hooks';
import {kNameMax, kThresholdMax, plain, type Plot, type Side} from '../model/layout';
import {parsed, plain as plainNumber} from '../parts/text';
import {Popup} from '../parts/popup';
import {useApp} from '../store/app';
import {titleOf} from '../store/plots';
import {texts} from '../texts/texts';

/** The title of a plot, its place, its thresholds, and its end. */
export function PlotMenu({plot, at, count}: {plot: Plot; at: number; count: number}) {
  const {plots} = useApp();
  const words = texts.value.plots;
  return (
    <Popup
      button={<span aria-hidden="true">⋯</span>}
      label={words.more(titleOf(plot))}
      buttonClass="plot-more"
      class="plot-menu"
    >
      <label>
        {words.title}
        <input
          type="text"
          value={plot.title}
          placeholder={titleOf(plot)}
          maxLength={kNameMax}
          onChange={(event) => plots.setTitle(at, event.currentTarget.value)}
        />
      </label>
      {plot.kind === 'time' && <Thresholds plot={plot} at={at} />}
      <div class="row">
        <button type="button" disabled={at === 0} onClick={() => plots.movePlot(at, -1)}>
          ↑ {words.up}
        </button>
        <button type="button" disabled={at + 1 === count} onClick={() => plots.movePlot(at, 1)}>
          ↓ {words.down}
        </button>
        <button type="button" class="danger" onClick={() => plots.removePlot(at)}>
          {words.removePlot}
        </button>
      </div>
    </Popup>
  );
}

function Thresholds({plot, at}: {plot: Plot; at: number}) {
  const {plots} = useApp();
  const words = texts.value.plots;
  const units = [...new Set(plot.fields.map((path) => plots.data.field(path)?.unit ?? ''))];
  const [typed, setTyped] = useState('');
  const [label, setLabel] = useState('');
  const [unit, setUnit] = useState<string | null>(null);
  const [side, setSide] = useState<Side>('above');
  const value = parsed(typed);
  const isFull = plot.thresholds.length >= kThresholdMax;
  const add = () => {
    if (value === null || isFull) return;
    const named = plain(label, kNameMax);
    const one = {value, unit: unit ?? units[0] ?? '', label: named, side};
    plots.setThresholds(at, [...plot.thresholds, one]);
    setTyped('');
    setLabel('');
  };
  return (
    <fieldset class="thresholds">
      <legend>{words.thresholds}</legend>
      {plot.thresholds.map((one, i) => (
        <p key={i} class="row">
          <span>
            {words[one.side]} {plainNumber(one.value)} {one.unit} {one.label}
          </span>
          <button
            type="button"
            aria-label={words.removeThreshold(`${plainNumber(one.value)} ${one.unit}`)}
            onClick={() =>
              plots.setThresholds(
                at,
                plot.thresholds.filter((_, other) => other !== i),
              )
            }
          >
            ×
          </button>
        </p>
      ))}
      {isFull ? (
        <p class="quiet small">{words.thresholdsFull(kThresholdMax)}</p>
      ) : (
        <div class="row">
          <select
            aria-label={words.side}
            value={side}
            onChange={(event) => setSide(event.currentTarget.value === 'below' ? 'below' : 'above')}
          >
            <option value="above">{words.above}</option>
            <option value="below">{words.below}</option>
          </select>
          <input
            type="text"
            inputMode="decimal"
            aria-label={words.thresholdValue}
            placeholder={words.thresholdValue}
            value={typed}
            onInput={(event) => setTyped(event.currentTarget.value)}
          />
          <select
            aria-label={words.unit}
            value={unit ?? units[0] ?? ''}
            onChange={(event) => setUnit(event.currentTarget.value)}
          >
            {units.map((one) => (
              <option key={one} value={one}>
                {one === '' || one === '1' ? words.noUnit : one}
              </option>
            ))}
          </select>
          <input
            type="text"
            aria-label={words.label}
            placeholder={words.label}
            value={label}
            maxLength={kNameMax}
            onInput={(event) => setLabel(event.currentTarget.value)}
          />
          <button type="button" disabled={value === null} onClick={add}>
            {words.addThreshold}
          </button>
        </div>
      )}
    </fieldset>
  );
}
