/** All texts of the page: English, then German. A section a view; `texts.value.live` is shown. */
import {computed, effect, signal} from '@preact/signals';
import {recall, remember} from '../store/kept';

export const kTexts = {
  views: {
    overview: ['Overview', 'Übersicht'],
    live: ['Live', 'Live'],
    plots: ['Plots', 'Kurven'],
    parameters: ['Parameters', 'Parameter'],
    recordings: ['Recordings', 'Aufnahmen'],
    incidents: ['Incidents', 'Vorfälle'],
    events: ['Events', 'Ereignisse'],
  },
  numbers: {
    notOne: ['not a number', 'keine Zahl'],
    days: [(count: number) => `${count} days`, (count: number) => `${count} Tage`],
  },
  parts: {
    cancel: ['Cancel', 'Abbrechen'],
    close: ['Close', 'Schließen'],
    help: [(subject: string) => `Help: ${subject}`, (subject: string) => `Hilfe: ${subject}`],
  },
  checks: {
    range: [
      (low: string, high: string) => `${low} to ${high}`,
      (low: string, high: string) => `${low} bis ${high}`,
    ],
    atLeast: [(low: string) => `at least ${low}`, (low: string) => `mindestens ${low}`],
    atMost: [(high: string) => `at most ${high}`, (high: string) => `höchstens ${high}`],
    below: [
      (value: string, range: string) => `${value} is below the range: ${range}.`,
      (value: string, range: string) => `${value} liegt unter dem Bereich: ${range}.`,
    ],
    above: [
      (value: string, range: string) => `${value} is above the range: ${range}.`,
      (value: string, range: string) => `${value} liegt über dem Bereich: ${range}.`,
    ],
    typeNumber: ['Type a number.', 'Eine Zahl eingeben.'],
    typeWhole: ['Type a whole number.', 'Eine ganze Zahl eingeben.'],
    noNumber: [
      (typed: string, like: string, large: string) =>
        `“${typed}” is not a number or is ambiguous. Write it like ${like}, ${large} or 2e-3.`,
      (typed: string, like: string, large: string) =>
        `„${typed}“ ist keine Zahl oder mehrdeutig. Schreibweise: ${like}, ${large} oder 2e-3.`,
    ],
    tooLarge: [
      (typed: string) => `${typed} is too large for a number.`,
      (typed: string) => `${typed} ist zu groß für eine Zahl.`,
    ],
    typeNumbers: [
      (wanted: number, typed: number) => `Type ${wanted} numbers; there are ${typed}.`,
      (wanted: number, typed: number) => `${wanted} Zahlen eingeben; es sind ${typed}.`,
    ],
    element: [
      (index: number, problem: string) => `Number ${index}: ${problem}`,
      (index: number, problem: string) => `Zahl ${index}: ${problem}`,
    ],
    chooseOne: [
      (choices: string) => `Choose one of: ${choices}.`,
      (choices: string) => `Eines wählen: ${choices}.`,
    ],
    readOnly: ['Read only', 'Nur lesbar'],
    onlyInactive: [
      'Changes only while the device is inactive: deactivate it first',
      'Nur bei inaktivem Gerät änderbar: zuerst deaktivieren',
    ],
  },
  form: {
    changedElsewhere: [
      (from: string, to: string) => `Changed elsewhere meanwhile, from ${from} to ${to}.`,
      (from: string, to: string) => `Inzwischen woanders geändert, von ${from} zu ${to}.`,
    ],
    applied: [
      (count: number, name: string) =>
        `Applied ${count} ${count === 1 ? 'change' : 'changes'} to ${name}.`,
      (count: number, name: string) =>
        `${count} ${count === 1 ? 'Änderung' : 'Änderungen'} an ${name} übernommen.`,
    ],
    allDefaults: [
      'All parameters have their defaults.',
      'Alle Parameter haben ihren Standardwert.',
    ],
    defaults: [
      (names: string, count: number) =>
        `${names} ${count === 1 ? 'has its default' : 'have their defaults'}.`,
      (names: string, count: number) =>
        `${names} ${count === 1 ? 'hat den' : 'haben ihren'} Standardwert.`,
    ],
    saved: [
      'Saved for the next start of the device server.',
      'Für den nächsten Start des Geräteservers gespeichert.',
    ],
    stale: [
      'Nothing was changed: another client changed parameters first. The values above are the ' +
        'present ones; what you typed is kept. Check it, and apply again.',
      'Nichts geändert: ein anderer Client hat zuerst Parameter geändert. Oben stehen die jetzigen ' +
        'Werte, die Eingaben bleiben. Bitte prüfen und erneut übernehmen.',
    ],
    refused: [
      (words: string) => `Nothing was changed: ${words}`,
      (words: string) => `Nichts geändert: ${words}`,
    ],
  },
  settings: {
    title: ['Settings', 'Einstellungen'],
    colours: ['Colours', 'Farben'],
    system: ['Auto', 'Auto'],
    light: ['Light', 'Hell'],
    dark: ['Dark', 'Dunkel'],
    language: ['Language', 'Sprache'],
    angles: ['Angles', 'Winkel'],
    degrees: ['Degrees', 'Grad'],
    radians: ['Radians', 'Radiant'],
    numbers: ['Numbers', 'Zahlen'],
  },
  header: {
    views: ['Views', 'Ansichten'],
    skip: ['Skip to the content', 'Zum Inhalt springen'],
    connecting: ['Connecting', 'Verbinde'],
    live: ['Live', 'Live'],
    silent: ['No data', 'Keine Daten'],
    lost: ['Not connected', 'Getrennt'],
    mayCommand: ['may command', 'darf steuern'],
    readOnly: ['read only', 'nur lesen'],
    notStopped: ['NOT stopped', 'NICHT gestoppt'],
    recording: [
      (file: string, seconds: number) => `Recording ${file}, ${seconds} seconds`,
      (file: string, seconds: number) => `Aufnahme ${file}, ${seconds} Sekunden`,
    ],
    stopAll: ['STOP ALL', 'NOT-HALT'],
    stopping: ['STOPPING', 'HÄLT AN'],
    stopped: ['STOPPED', 'GESTOPPT'],
    stopKey: ['Ctrl+Shift+Space', 'Strg+Umsch+Leer'],
    stopReadOnly: ['read only: use the hardware stop', 'nur lesen: Not-Halt-Taster!'],
    titleNotConnected: ['not connected: ', 'getrennt: '],
    titleNotStopped: ['NOT STOPPED: ', 'NICHT GESTOPPT: '],
    titleStopped: ['STOPPED: ', 'GESTOPPT: '],
  },
  parameters: {
    of: ['Parameters of', 'Parameter von'],
    none: [
      'Nothing that has parameters is at the registry.',
      'Die Registry hat nichts mit Parametern.',
    ],
    needsToken: [
      'Read only: open the URL with the token that rtpm-console printed to see parameters.',
      'Nur lesen: für Parameter die URL mit dem Token öffnen, die rtpm-console ausgab.',
    ],
    reading: ['Reading the parameters.', 'Parameter werden gelesen.'],
    notThere: [
      (name: string) => `${name} is not there now.`,
      (name: string) => `${name} fehlt zur Zeit.`,
    ],
    active: ['active', 'aktiv'],
    inactive: ['inactive', 'inaktiv'],
    unsaved: ['changed since saved', 'ungespeichert'],
    gone: [
      (name: string) =>
        `${name} is gone. What you typed is kept, and can be applied when it is back.`,
      (name: string) =>
        `${name} ist weg. Die Eingaben bleiben und lassen sich übernehmen, sobald es zurück ist.`,
    ],
    notRead: [
      (problem: string) => `Not read anew: ${problem}`,
      (problem: string) => `Nicht neu gelesen: ${problem}`,
    ],
    general: ['general', 'allgemein'],
    invalid: [
      (count: number) =>
        `${count} ${count === 1 ? 'field' : 'fields'} can't be sent as typed; see above.`,
      (count: number) =>
        `${count} ${count === 1 ? 'Feld ist' : 'Felder sind'} so nicht sendbar; siehe oben.`,
    ],
    apply: ['Apply', 'Übernehmen'],
    applyChanges: [
      (count: number) => `Apply ${count} ${count === 1 ? 'change' : 'changes'}`,
      (count: number) => `${count} ${count === 1 ? 'Änderung' : 'Änderungen'} übernehmen`,
    ],
    discard: ['Discard what I typed', 'Eingaben verwerfen'],
    resetAll: ['Reset all', 'Alle zurücksetzen'],
    resetQuestion: [
      (name: string) => `Sets every parameter of ${name} to its default, at once.`,
      (name: string) => `Setzt alle Parameter von ${name} auf einmal auf den Standardwert.`,
    ],
    save: ['Save', 'Speichern'],
    notPersistent: [
      "Can't be saved: its server has no folder for settings.",
      'Nicht speicherbar: der Server hat keinen Ordner dafür.',
    ],
  },
  field: {
    notApplied: ['not applied yet', 'noch nicht übernommen'],
    default: ['Default', 'Standard'],
    typeDefault: [
      (name: string) => `Type the default of ${name}`,
      (name: string) => `Standardwert von ${name} eingeben`,
    ],
    defaultIs: [(value: string) => `default ${value}`, (value: string) => `Standard ${value}`],
    empty: ['empty', 'leer'],
    now: [(value: string) => `now ${value}`, (value: string) => `jetzt ${value}`],
    refused: [(why: string) => `Refused: ${why}`, (why: string) => `Abgelehnt: ${why}`],
  },
  calibration: {
    title: ['Calibration', 'Kalibrierung'],
    open: [(name: string) => `Calibrate ${name}`, (name: string) => `${name} kalibrieren`],
    none: ['It offers no calibration.', 'Es gibt keine Kalibrierung.'],
    start: ['Start', 'Starten'],
    progress: ['Progress', 'Fortschritt'],
    running: ['Running', 'Läuft'],
    prompt: ['Waits for you', 'Wartet auf Eingabe'],
    done: ['Done: keep the result?', 'Fertig: Ergebnis behalten?'],
    failed: ['Failed', 'Fehlgeschlagen'],
    kept: ['The result is in force', 'Das Ergebnis gilt'],
    keptAndSaved: ['The result is kept and saved', 'Das Ergebnis gilt und ist gespeichert'],
    discarded: ['Discarded', 'Verworfen'],
    savesOthers: [
      "Saves the device's other changed parameters, too.",
      'Speichert auch andere geänderte Parameter des Geräts.',
    ],
    keep: ['Keep and save', 'Behalten und speichern'],
    discard: ['Discard', 'Verwerfen'],
    discardQuestion: [
      'The result of this calibration is lost.',
      'Das Ergebnis dieser Kalibrierung geht verloren.',
    ],
  },
  events: {
    title: ['Events', 'Ereignisse'],
    filter: ['Filter', 'Filter'],
    which: ['Which events?', 'Welche Ereignisse?'],
    choose: ['Choose one below, or type.', 'Unten wählen oder eingeben.'],
    show: ['Show', 'Zeigen'],
    noFilter: ['no filter set', 'kein Filter gesetzt'],
    count: [
      (count: number, text: string) => `${text} ${count === 1 ? 'event' : 'events'}`,
      (count: number, text: string) => `${text} ${count === 1 ? 'Ereignis' : 'Ereignisse'}`,
    ],
    pause: ['Pause', 'Pause'],
    end: ['End', 'Beenden'],
    clear: ['Clear', 'Leeren'],
    setFilter: ['Set a filter to see events.', 'Für Ereignisse einen Filter setzen.'],
    nothingYet: ['Nothing has passed the filter yet.', 'Noch hat nichts den Filter passiert.'],
    newestLast: ['Events, newest last', 'Ereignisse, neueste zuletzt'],
    time: ['Time', 'Zeit'],
    type: ['Type', 'Typ'],
    from: ['From', 'Von'],
    number: ['Number', 'Nummer'],
    payload: ['Payload', 'Inhalt'],
    omitted: [
      (count: string) => `${count} events left out`,
      (count: string) => `${count} Ereignisse ausgelassen`,
    ],
  },
  readings: {
    title: ['Now', 'Jetzt'],
    force: ['force', 'Kraft'],
    right: ['right', 'rechts'],
    up: ['up', 'oben'],
  },
  space: {
    direction: [
      'Where it points; the numbers are beside',
      'Blickrichtung; die Zahlen stehen daneben',
    ],
    view: [
      (name: string) => `3-D view of ${name}; arrow keys turn it, plus and minus zoom`,
      (name: string) => `3D-Ansicht von ${name}; Pfeiltasten drehen, Plus und Minus zoomen`,
    ],
    problem: [
      (problem: string) =>
        `The 3-D view does not start: ${problem}. It needs WebGL. The numbers are correct.`,
      (problem: string) =>
        `Die 3D-Ansicht startet nicht: ${problem}. Sie braucht WebGL. Die Zahlen stimmen.`,
    ],
    tool: ['tool', 'Werkzeug'],
    proxy: ['proxy', 'Proxy'],
    touched: ['touched', 'berührt'],
    forceScale: [
      (length: string) => `force, ${length} mm = 1 N`,
      (length: string) => `Kraft, ${length} mm = 1 N`,
    ],
    viewpoint: ['Viewpoint', 'Blickpunkt'],
    corner: ['Corner', 'Ecke'],
    front: ['Front', 'Vorn'],
    side: ['Side', 'Seite'],
    top: ['Top', 'Oben'],
    noSamples: ['no samples yet', 'noch keine Messwerte'],
    lastKnown: ['last known position; not live', 'letzte bekannte Position; nicht live'],
    noForceNode: ['(no force node)', '(kein Kraftknoten)'],
  },
} as const;

export const kLanguages = ['en', 'de'] as const;
export type Language = (typeof kLanguages)[number];

type Widened<T> = T extends string ? string : T;
type Section<T> = {
  readonly [Key in keyof T]: T[Key] extends readonly [infer English, unknown]
    ? Widened<English>
    : never;
};
export type Texts = {readonly [Name in keyof typeof kTexts]: Section<(typeof kTexts)[Name]>};

const kKey = 'rtpm.language';
const wanted = recall(kKey) ?? globalThis.navigator?.language.slice(0, 2);
export const language = signal<Language>(kLanguages.find((one) => one === wanted) ?? 'en');
export const texts = computed(() => inLanguage(language.value));

effect(() => {
  if ('document' in globalThis) document.documentElement.lang = language.value;
});

export function choose(wantedLanguage: Language): void {
  language.value = wantedLanguage;
  remember(kKey, wantedLanguage);
}

function inLanguage(wantedLanguage: Language): Texts {
  const at = kLanguages.indexOf(wantedLanguage);
  const sections = Object.entries(kTexts).map(([name, section]) => [
    name,
    Object.fromEntries(Object.entries(section).map(([key, both]) => [key, both[at]])),
  ]);
  return Object.fromEntries(sections) as Texts;
}
