import type {ComponentChildren} from 'preact';
import {angle, chooseAngle, chooseMark, mark, type Angle, type Mark} from '../store/settings';
import {theme, type Theme} from '../store/theme';
import {Choice} from '../parts/parts';
import {Popup} from '../parts/popup';
import {choose, language, texts, type Language} from '../texts/texts';
import {OperatorSetting} from './operator';

const kLanguageNames: readonly {readonly value: Language; readonly label: string}[] = [
  {value: 'en', label: 'English'},
  {value: 'de', label: 'Deutsch'},
];
const kMarkNames: readonly {readonly value: Mark; readonly label: string}[] = [
  {value: 'point', label: '12\u202f345.6'},
  {value: 'comma', label: '12\u202f345,6'},
];

/** The choices of this browser. */
export function Settings() {
  const words = texts.value.settings;
  const themes: readonly {value: Theme; label: string}[] = [
    {value: 'system', label: words.system},
    {value: 'light', label: words.light},
    {value: 'dark', label: words.dark},
  ];
  const angles: readonly {value: Angle; label: string}[] = [
    {value: 'degrees', label: words.degrees},
    {value: 'radians', label: words.radians},
  ];
  const icon = (
    <>
      <svg viewBox="0 0 20 20" aria-hidden="true">
        <path d="M3 5h6M13 5h4M3 10h2M9 10h8M3 15h8M15 15h2M9 3v4M5 8v4M11 13v4" />
      </svg>
      <span class="settings-word">{words.title}</span>
    </>
  );
  return (
    <Popup button={icon} label={words.title} buttonClass="settings-button" class="settings">
      <OperatorSetting />
      <Setting name={words.colours}>
        <Choice
          label={words.colours}
          options={themes}
          value={theme.value}
          onChange={(value) => (theme.value = value)}
        />
      </Setting>
      <Setting name={words.language}>
        <Choice
          label={words.language}
          options={kLanguageNames}
          value={language.value}
          onChange={choose}
        />
      </Setting>
      <Setting name={words.angles}>
        <Choice label={words.angles} options={angles} value={angle.value} onChange={chooseAngle} />
      </Setting>
      <Setting name={words.numbers}>
        <Choice
          label={words.numbers}
          options={kMarkNames}
          value={mark.value}
          onChange={chooseMark}
        />
      </Setting>
    </Popup>
  );
}

/** One choice, with its name. */
export function Setting({name, children}: {name: string; children: ComponentChildren}) {
  return (
    <div class="setting">
      <span>{name}</span>
      {children}
    </div>
  );
}
