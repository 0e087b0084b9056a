import {useState} from 'preact/hooks';
import {deviceLayout, kNameMax} from '../model/layout';
import {Popup} from '../parts/popup';
import {useApp} from '../store/app';
import {writeRoute} from '../store/route';
import {Problem} from '../parts/parts';
import {texts} from '../texts/texts';

const kOfferedMax = 200;

/** The saved layouts, those of devices, and the link to what is shown. */
export function LayoutMenu() {
  const {plots, devices} = useApp();
  const words = texts.value.plots;
  const layout = plots.layout.value;
  const [name, setName] = useState(layout.name);
  const [renamed, setRenamed] = useState<string | null>(null);
  const [problem, setProblem] = useState('');
  const [isCopied, setCopied] = useState(false);
  const save = (event: Event) => {
    event.preventDefault();
    setProblem(plots.save(name) ? '' : words.notSaved);
  };
  const rename = (before: string, after: string) => {
    const isDone = plots.rename(before, after);
    setProblem(isDone ? '' : words.notRenamed(after));
    if (isDone) setRenamed(null);
  };
  const link = new URL(writeRoute('plots', plots.subject), window.location.href).href;
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(link);
      setCopied(true);
    } catch {
      // Without the right to it, the address bar has the same link.
      setProblem(words.notCopied);
    }
  };
  return (
    <Popup
      button={`${words.layouts}${layout.name === '' ? '' : `: ${layout.name}`}`}
      buttonClass="layouts-button"
      class="layouts"
    >
      <form class="row" onSubmit={save}>
        <input
          type="text"
          aria-label={words.layoutName}
          placeholder={words.layoutName}
          value={name}
          maxLength={kNameMax}
          onInput={(event) => setName(event.currentTarget.value)}
        />
        <button type="submit" disabled={name.trim() === ''}>
          {words.save}
        </button>
        <button type="button" onClick={() => void copy()}>
          {isCopied ? words.copied : words.copyLink}
        </button>
      </form>
      <Problem text={problem} />
      <h3>{words.saved}</h3>
      {plots.saved.value.length === 0 && <p class="quiet small">{words.noneSaved}</p>}
      <ul>
        {plots.saved.value.map((one) => (
          <li key={one.name} class="row" data-layout={one.name}>
            {renamed === one.name ? (
              <input
                type="text"
                aria-label={words.newName(one.name)}
                value={one.name}
                maxLength={kNameMax}
                onChange={(event) => rename(one.name, event.currentTarget.value)}
              />
            ) : (
              <button
                type="button"
                class="layout-open"
                onClick={() => {
                  setName(one.name);
                  plots.show(one);
                }}
              >
                {one.name}
              </button>
            )}
            <button
              type="button"
              aria-label={words.renameLayout(one.name)}
              onClick={() => setRenamed(renamed === one.name ? null : one.name)}
            >
              {words.rename}
            </button>
            <button
              type="button"
              aria-label={words.deleteLayout(one.name)}
              onClick={() => plots.remove(one.name)}
            >
              {words.delete}
            </button>
          </li>
        ))}
      </ul>
      <h3>{words.ofDevices}</h3>
      <label class="row">
        <select
          aria-label={words.ofDevices}
          value=""
          onChange={(event) => {
            const wanted = event.currentTarget.value;
            const device = devices.value.find((one) => one.name === wanted);
            if (device !== undefined) plots.show(deviceLayout(device));
          }}
        >
          <option value="">{words.chooseDevice}</option>
          {devices.value.slice(0, kOfferedMax).map((one) => (
            <option key={one.name} value={one.name}>
              {one.name}
            </option>
          ))}
        </select>
      </label>
    </Popup>
  );
}
