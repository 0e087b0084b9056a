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
  overview: {
    waiting: ['Waiting for the console to say what there is.', 'Warte auf die Konsole.'],
    registry: ['Registry', 'Registry'],
    registryHelp: [
      'The name service of this laboratory. While it is silent, no program finds another anew.',
      'Der Namensdienst dieses Labors. Schweigt er, findet kein Programm ein anderes neu.',
    ],
    answers: ['answers', 'antwortet'],
    silent: ['silent', 'schweigt'],
    events: ['Events', 'Ereignisse'],
    eventsHelp: [
      'Events per second that the hub takes from its suppliers, samples of devices included.',
      'Ereignisse pro Sekunde, die der Hub annimmt, einschließlich der Messwerte der Geräte.',
    ],
    consumers: [
      (count: number) => `${count} ${count === 1 ? 'consumer' : 'consumers'}`,
      (count: number) => `${count} Empfänger`,
    ],
    omitted: [
      (count: string, most: string) =>
        `too many sources: ${count} events beyond ${most} channels not shown`,
      (count: string, most: string) =>
        `zu viele Quellen: ${count} Ereignisse jenseits von ${most} Kanälen nicht gezeigt`,
    ],
    dropped: [
      (count: string) => `${count} not shown, as the console was too busy`,
      (count: string) => `${count} nicht gezeigt, da die Konsole überlastet war`,
    ],
    devices: ['Devices', 'Geräte'],
    devicesHelp: [
      'A device is live if its newest sample is at most one second old, without fault or stop.',
      'Ein Gerät ist live, wenn sein Messwert höchstens eine Sekunde alt ist, ohne Fehler und Halt.',
    ],
    noneAtRegistry: ['none at the registry', 'keine bei der Registry'],
    allFresh: ['samples within the last second', 'Messwerte aus der letzten Sekunde'],
    console: ['Console', 'Konsole'],
    consoleHelp: [
      'How long rtpm-console has been running, and how many browsers are connected.',
      'Wie lange rtpm-console läuft, und wie viele Browser verbunden sind.',
    ],
    up: [(time: string) => `up ${time}`, (time: string) => `läuft ${time}`],
    browsers: [
      (count: number) => `${count} ${count === 1 ? 'browser' : 'browsers'}`,
      (count: number) => `${count} Browser`,
    ],
    upToDate: ['all up to date', 'alle aktuell'],
    skipped: [
      (count: string) => `slow browsers skipped ${count} updates; nothing recorded is lost`,
      (count: string) => `langsame ließen ${count} Bilder aus; Aufnahmen sind vollständig`,
    ],
  },
  devices: {
    title: ['Devices', 'Geräte'],
    none: [
      'No device is at the registry. Start one: rtpm-deviced --serve-events.',
      'Kein Gerät bei der Registry. Eines starten: rtpm-deviced --serve-events.',
    ],
    samples: ['Samples', 'Messwerte'],
    samplesHelp: [
      'Samples per second, measured at the hub, of those that the device should send.',
      'Messwerte pro Sekunde, gemessen am Hub, von denen, die das Gerät senden soll.',
    ],
    ofRate: [
      (rate: string, nominal: string) => `${rate} of ${nominal}`,
      (rate: string, nominal: string) => `${rate} von ${nominal}`,
    ],
    goodCycles: ['Good cycles', 'Gute Zyklen'],
    goodCyclesHelp: [
      "The share of the device's last 100 cycles that read it in time and without fault.",
      'Anteil der letzten 100 Zyklen, in denen das Gerät rechtzeitig und fehlerfrei las.',
    ],
    lease: ['Lease', 'Lease'],
    leaseHelp: [
      'Which client may command the device; the stop needs no lease.',
      'Welcher Client das Gerät steuern darf; der Not-Halt braucht keine Lease.',
    ],
    force: ['Force', 'Kraft'],
    forceHelp: [
      'The largest force that the device exerts, by its own description.',
      'Die größte Kraft, die das Gerät nach eigener Angabe ausübt.',
    ],
    upTo: [(newton: string) => `up to ${newton} N`, (newton: string) => `bis ${newton} N`],
    noForce: ['none', 'keine'],
    dismiss: ['Dismiss', 'Ausblenden'],
    dismissQuestion: [
      (name: string) => `Is ${name} off, or not of interest? It shows again when it is back.`,
      (name: string) => `Ist ${name} aus oder unwichtig? Es erscheint wieder, wenn es zurück ist.`,
    ],
    dismissOne: [(name: string) => `Dismiss ${name}`, (name: string) => `${name} ausblenden`],
    lost: ['lost', 'verloren'],
    lostFor: [(time: string) => `lost for ${time}`, (time: string) => `verloren seit ${time}`],
    stopped: ['stopped', 'Not-Halt'],
    fault: ['fault', 'Fehler'],
    stale: ['stale', 'veraltet'],
    good: ['live', 'live'],
    count: [(count: number) => `${count} devices`, (count: number) => `${count} Geräte`],
    found: [
      (found: number, count: number) => `${found} of ${count}`,
      (found: number, count: number) => `${found} von ${count}`,
    ],
    search: ['Search: name, model, state ( / )', 'Suche: Name, Modell, Zustand ( / )'],
    nothingFound: [
      (search: string) => `No device matches “${search}”.`,
      (search: string) => `Kein Gerät passt zu „${search}“.`,
    ],
    rowHelp: [
      'A row: name, state, samples per second, class, and who commands it. The worst stand first. ' +
        'Arrow keys move, Enter opens the device, / searches.',
      'Je Zeile: Name, Zustand, Messwerte pro Sekunde, Klasse und wer es steuert. Das Schlechteste ' +
        'zuerst. Pfeiltasten bewegen, Enter öffnet, / sucht.',
    ],
    noFolder: ['without a folder', 'ohne Ordner'],
    ours: ['ours', 'eigene Lease'],
    held: ['held', 'vergeben'],
  },
  consumers: {
    title: ['Consumers of events', 'Empfänger von Ereignissen'],
    name: ['Consumer', 'Empfänger'],
    host: ['Host', 'Rechner'],
    lag: ['Lag', 'Rückstand'],
    lagHelp: [
      'How late events reach it, at most in the last second.',
      'Wie spät Ereignisse ihn erreichen, höchstens in der letzten Sekunde.',
    ],
    waiting: ['Waiting', 'Wartend'],
    waitingHelp: ['Events in its queue at the hub.', 'Ereignisse in seiner Schlange am Hub.'],
    delivered: ['Delivered', 'Geliefert'],
    deliveredHelp: [
      'Events per second that its filter accepts, since it subscribed.',
      'Ereignisse pro Sekunde, die sein Filter annimmt, seit der Anmeldung.',
    ],
    dropped: ['Dropped', 'Verworfen'],
    droppedHelp: [
      'Events that it missed since it subscribed, because it was too slow.',
      'Ereignisse, die ihm seit der Anmeldung fehlen, weil er zu langsam war.',
    ],
    suspended: ['suspended', 'ruht'],
  },
  servers: {
    title: ['Servers and lanes', 'Server und Lanes'],
    none: ['No server answers.', 'Kein Server antwortet.'],
    others: [
      (count: number) =>
        `${count} other ${count === 1 ? 'server' : 'servers'} on this host, unknown to the registry`,
      (count: number) => `${count} weitere Server auf diesem Rechner, der Registry unbekannt`,
    ],
    host: [(name: string) => `Host ${name}`, (name: string) => `Rechner ${name}`],
    process: [
      (port: number, id: number) => `:${port}, process ${id}`,
      (port: number, id: number) => `:${port}, Prozess ${id}`,
    ],
    lost: ['lost', 'verloren'],
    noLanes: ['no lanes known', 'keine Lanes bekannt'],
    server: ['Server', 'Server'],
    lane: ['Lane', 'Lane'],
    laneHelp: [
      'Threads of a server that handle the calls of one range of priorities.',
      'Threads eines Servers, die die Aufrufe eines Prioritätsbereichs bearbeiten.',
    ],
    priorities: ['Priorities', 'Prioritäten'],
    prioritiesHelp: [
      'Calls of these priorities run in the lane; 32767 is the highest there is.',
      'Aufrufe dieser Prioritäten laufen in der Lane; 32767 ist die höchste.',
    ],
    schedule: ['Schedule', 'Scheduling'],
    scheduleHelp: [
      'How Linux schedules its threads: fifo and rr run before all others, other shares the CPU.',
      'Wie Linux ihre Threads einplant: fifo und rr laufen vor allen anderen, other teilt die CPU.',
    ],
    wait: ['Wait', 'Warten'],
    waitHelp: [
      'How it waits for calls: block sleeps, spin polls and keeps a CPU busy, adaptive does both.',
      'Wie sie auf Aufrufe wartet: block schläft, spin pollt und belegt eine CPU, adaptive beides.',
    ],
    calls: ['Calls', 'Aufrufe'],
    callsHelp: ['Calls per second.', 'Aufrufe pro Sekunde.'],
    drops: ['Drops', 'Verworfen'],
    dropsHelp: [
      'Requests per second that were refused or expired before they ran.',
      'Anfragen pro Sekunde, die abgewiesen wurden oder vor der Ausführung verfielen.',
    ],
    longest: ['Longest cycle', 'Längster Zyklus'],
    longestHelp: [
      'The longest time since the start of the server from receiving a call until its answer was ' +
        'written, with the method.',
      'Die längste Zeit seit dem Start vom Empfang eines Aufrufs bis zur Antwort, samt der Methode.',
    ],
    queued: ['Queued', 'Wartend'],
    queuedHelp: [
      'Calls that wait for a thread now.',
      'Aufrufe, die jetzt auf einen Thread warten.',
    ],
    busy: ['Busy', 'Aktiv'],
    busyHelp: ['Threads that run a method now.', 'Threads, die jetzt eine Methode ausführen.'],
  },
  objects: {
    title: ['Objects', 'Objekte'],
    none: ['The registry has no names.', 'Die Registry hat keine Namen.'],
    name: ['Name', 'Name'],
    interface: ['Interface', 'Schnittstelle'],
    where: ['Where', 'Ort'],
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
  stop: {
    notStopped: [
      (which: string) => `Not stopped: ${which}.`,
      (which: string) => `Nicht gestoppt: ${which}.`,
    ],
    notConfirmed: [
      (why: string) => `Not confirmed: ${why}.`,
      (why: string) => `Nicht bestätigt: ${why}.`,
    ],
    notSent: [
      'Not sent: there was no connection for too long. Press again if it is needed.',
      'Nicht gesendet: zu lange keine Verbindung. Bei Bedarf erneut drücken.',
    ],
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
    notSaved: [
      (why: string) => `It is in force, but not saved: ${why}`,
      (why: string) => `Es gilt, ist aber nicht gespeichert: ${why}`,
    ],
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
    numberHelp: [
      'Counts the events of one type and source, from 1; a filter leaves gaps.',
      'Zählt die Ereignisse eines Typs und einer Quelle, ab 1; ein Filter lässt Lücken.',
    ],
    payload: ['Payload', 'Inhalt'],
    omitted: [
      (count: string) => `${count} events left out`,
      (count: string) => `${count} Ereignisse ausgelassen`,
    ],
  },
  readings: {
    title: ['Now', 'Jetzt'],
    help: [
      'The newest values; a dash: there is none from the last second. x, y, z: the tool in the ' +
        "device's frame. force: how strongly the device pulls. right, up: where it points.",
      'Die neuesten Werte; ein Strich: keiner aus der letzten Sekunde. x, y, z: das Werkzeug im ' +
        'Gerätesystem. Kraft: wie stark das Gerät zieht. rechts, oben: wohin es zeigt.',
    ],
    force: ['force', 'Kraft'],
    right: ['right', 'rechts'],
    up: ['up', 'oben'],
  },
  cameras: {
    name: [(name: string) => `Camera ${name}`, (name: string) => `Kamera ${name}`],
    none: ['no picture yet', 'noch kein Bild'],
    captured: [(age: string) => `captured ${age} ago`, (age: string) => `vor ${age} aufgenommen`],
    rate: [(hertz: number) => `at ${hertz} Hz`, (hertz: number) => `mit ${hertz} Hz`],
    notLive: ['not live', 'nicht live'],
    insecure: [
      'This browser decodes H.264 only from https or localhost. Open the page by one of them, or ' +
        'let the camera give JPEG.',
      'Dieser Browser dekodiert H.264 nur von https oder localhost. Die Seite so öffnen, oder die ' +
        'Kamera JPEG senden lassen.',
    ],
    undecodable: [
      (codec: string, why: string) => `The browser can't decode ${codec}: ${why}`,
      (codec: string, why: string) => `Der Browser kann ${codec} nicht dekodieren: ${why}`,
    ],
    help: [
      'The age of the picture, and by how much its time of capture may be wrong; its size in ' +
        'pixels, and its rate.',
      'Das Alter des Bildes, und um wie viel seine Aufnahmezeit falsch sein kann; seine Größe in ' +
        'Pixeln und seine Rate.',
    ],
  },
  live: {
    none: ['No device is at the registry.', 'Die Registry hat kein Gerät.'],
    device: ['Device', 'Gerät'],
    search: ['Search a device', 'Gerät suchen'],
    found: [
      (shown: number, all: number) => `${shown} of ${all} devices. Arrows choose, Enter shows.`,
      (shown: number, all: number) => `${shown} von ${all} Geräten. Pfeile wählen, Eingabe zeigt.`,
    ],
    charts: ['Charts', 'Diagramme'],
    position: ['Position', 'Position'],
    force: ['Force', 'Kraft'],
    direction: ['Direction', 'Richtung'],
    latencyShort: ['Latency', 'Latenz'],
    now: ['now', 'jetzt'],
    notLive: ['not live', 'nicht live'],
    chart: [
      (title: string, seconds: number) => `${title} over the last ${seconds} seconds; values above`,
      (title: string, seconds: number) => `${title} der letzten ${seconds} Sekunden; Werte darüber`,
    ],
    latency: ['Latency of reads', 'Latenz der Lesezugriffe'],
    latencyHelp: [
      'How long the console waits for the device when it reads its newest sample: 20 times a ' +
        'second, at the lowest priority, over five minutes. A force loop at a higher priority is ' +
        'faster than this. p99 is the time within which 99 % of the reads are answered. Beyond ' +
        '1 ms, a loop of 1 kHz would miss a cycle.',
      'So lange wartet die Konsole, wenn sie den neuesten Messwert des Geräts liest: 20-mal je ' +
        'Sekunde, mit niedrigster Priorität, über fünf Minuten. Eine Kraftregelung mit höherer ' +
        'Priorität ist schneller. p99 ist die Zeit, in der 99 % beantwortet sind. Über 1 ms ' +
        'verpasst eine Regelung mit 1 kHz einen Zyklus.',
    ],
    notMeasured: ['No calls measured yet.', 'Noch keine Aufrufe gemessen.'],
    histogram: [
      (count: string, half: string, within: string) =>
        `Latency of ${count} reads: half within ${half}, ${within} within 1 ms`,
      (count: string, half: string, within: string) =>
        `Latenz von ${count} Zugriffen: die Hälfte in ${half}, ${within} in 1 ms`,
    ],
    half: ['half of the reads take at most this', 'die Hälfte dauert höchstens so lange'],
    share: [
      (share: string) => `${share} of the reads take at most this`,
      (share: string) => `${share} dauern höchstens so lange`,
    ],
    longest: ['max', 'max'],
    longestHelp: ['the slowest read of five minutes', 'der langsamste Zugriff in fünf Minuten'],
    within: [
      (share: string, count: string) =>
        `${share} of ${count} reads within 1 ms, a cycle of a 1 kHz force loop.`,
      (share: string, count: string) =>
        `${share} von ${count} Zugriffen in 1 ms, einem Zyklus einer 1-kHz-Kraftregelung.`,
    ],
    failed: [(count: string) => `${count} failed.`, (count: string) => `${count} fehlgeschlagen.`],
    replayTitle: ['Replay', 'Wiedergabe'],
    replay: [
      (file: string) =>
        `Recorded motion${file === '' ? '' : ` of ${file}`}. Commands are not shown here, so that ` +
        'nobody takes it for the device. The stop above works as ever.',
      (file: string) =>
        `Aufgenommene Bewegung${file === '' ? '' : ` aus ${file}`}. Befehle fehlen hier, damit es ` +
        'niemand für das Gerät hält. Der Not-Halt oben wirkt wie immer.',
    ],
    showLive: ['Show the devices live', 'Geräte live zeigen'],
  },
  plots: {
    search: ['Search fields, such as arm0 position', 'Felder suchen, etwa arm0 position'],
    fields: ['Fields', 'Felder'],
    addTo: ['add to', 'zu'],
    newPlot: ['a new plot', 'neuer Plot'],
    addAll: [(count: number) => `Add all ${count}`, (count: number) => `Alle ${count} hinzufügen`],
    nothingFound: ['No field has these words.', 'Kein Feld enthält diese Wörter.'],
    foundCount: [
      (shown: number, total: string) =>
        `${shown} of ${total}. Arrows choose, Enter adds, Escape closes.`,
      (shown: number, total: string) =>
        `${shown} von ${total}. Pfeile wählen, Eingabe fügt hinzu, Esc schließt.`,
    ],
    needsToken: [
      'Read only: the past and other fields need the URL with the token that rtpm-console printed.',
      'Nur lesen: für Vergangenheit und weitere Felder die URL mit dem Token von rtpm-console öffnen.',
    ],
    tooMany: [
      (plot: number, all: number) =>
        `Not added: a plot has at most ${plot} curves, all together ${all}.`,
      (plot: number, all: number) =>
        `Nicht hinzugefügt: höchstens ${plot} Kurven je Plot, zusammen ${all}.`,
    ],
    window: ['Time shown', 'Gezeigte Zeit'],
    seconds: [
      (count: number) =>
        count < 60 ? `${count} s` : count < 3600 ? `${count / 60} min` : `${count / 3600} h`,
      (count: number) =>
        count < 60 ? `${count} s` : count < 3600 ? `${count / 60} min` : `${count / 3600} h`,
    ],
    range: ['Range of time', 'Zeitbereich'],
    pause: ['Pause', 'Anhalten'],
    follow: ['Follow', 'Folgen'],
    paused: ['Paused: the plots do not follow.', 'Angehalten: die Plots folgen nicht.'],
    earlier: ['Earlier', 'Früher'],
    later: ['Later', 'Später'],
    closer: ['Closer', 'Näher'],
    wider: ['Wider', 'Weiter'],
    help: [
      'Drag over a plot to zoom, Shift and drag to move, wheel to zoom at the pointer, double ' +
        'click to follow again. By keyboard in a plot: arrows move the crosshair, Shift and arrows ' +
        'the range, + and − zoom, Space pauses, Escape follows again. Ranges beyond 90 s are shown ' +
        'by the lowest and highest value of each second, beyond 20 minutes of each 10 seconds.',
      'Über einen Plot ziehen zoomt, mit Umschalt verschiebt es, das Rad zoomt am Zeiger, ' +
        'Doppelklick folgt wieder. Mit Tasten im Plot: Pfeile bewegen das Fadenkreuz, mit Umschalt ' +
        'den Bereich, + und − zoomen, Leertaste hält an, Esc folgt wieder. Über 90 s zeigen die ' +
        'Kurven Minimum und Maximum je Sekunde, über 20 Minuten je 10 Sekunden.',
    ],
    layouts: ['Layouts', 'Layouts'],
    layoutName: ['Name of this layout', 'Name dieses Layouts'],
    save: ['Save', 'Speichern'],
    saved: ['Saved in this browser', 'In diesem Browser gespeichert'],
    noneSaved: ['None yet.', 'Noch keine.'],
    notSaved: ['Not saved: 50 layouts are saved already.', 'Nicht gespeichert: es sind schon 50.'],
    notRenamed: [
      (name: string) => `Not renamed: “${name}” is empty or taken.`,
      (name: string) => `Nicht umbenannt: „${name}“ ist leer oder vergeben.`,
    ],
    copyLink: ['Copy link', 'Link kopieren'],
    copied: ['Copied', 'Kopiert'],
    notCopied: [
      'Not copied: the browser refuses. The address bar has the same link.',
      'Nicht kopiert: der Browser verbietet es. Die Adresszeile hat denselben Link.',
    ],
    rename: ['Rename', 'Umbenennen'],
    renameLayout: [(name: string) => `Rename ${name}`, (name: string) => `${name} umbenennen`],
    newName: [(name: string) => `New name of ${name}`, (name: string) => `Neuer Name von ${name}`],
    delete: ['Delete', 'Löschen'],
    deleteLayout: [(name: string) => `Delete ${name}`, (name: string) => `${name} löschen`],
    ofDevices: ['Layout of a device', 'Layout eines Geräts'],
    chooseDevice: ['Choose a device', 'Gerät wählen'],
    deleted: [(name: string) => `Deleted ${name}.`, (name: string) => `${name} gelöscht.`],
    replaced: [(name: string) => `Replaced ${name}.`, (name: string) => `${name} ersetzt.`],
    renamed: [(name: string) => `Renamed ${name}.`, (name: string) => `${name} umbenannt.`],
    changed: [(name: string) => `Removed ${name}.`, (name: string) => `${name} entfernt.`],
    undo: ['Undo', 'Rückgängig'],
    brokenLink: [
      'The address has no layout that this page can read, so the last one is shown.',
      'Die Adresse enthält kein lesbares Layout; gezeigt wird das letzte.',
    ],
    noPast: [
      (why: string) => `The past is not shown: ${why}.`,
      (why: string) => `Die Vergangenheit fehlt: ${why}.`,
    ],
    empty: [
      'No plots yet. Search a field above, or choose the layout of a device.',
      'Noch keine Plots. Oben ein Feld suchen oder das Layout eines Geräts wählen.',
    ],
    untitled: ['Plot', 'Plot'],
    emptyPlot: ['No curves. Search a field above.', 'Keine Kurven. Oben ein Feld suchen.'],
    curve: ['Curve', 'Kurve'],
    addCurveTo: [
      (title: string) => `Add a curve to ${title}`,
      (title: string) => `Kurve zu ${title} hinzufügen`,
    ],
    value: ['Value', 'Wert'],
    lowest: ['Lowest', 'Min.'],
    highest: ['Highest', 'Max.'],
    remove: ['Remove', 'Entfernen'],
    removeCurve: [(path: string) => `Remove ${path}`, (path: string) => `${path} entfernen`],
    canvas: [
      (title: string) => `Plot of ${title}; the table below has its values`,
      (title: string) => `Plot von ${title}; die Werte stehen in der Tabelle darunter`,
    ],
    legend: [
      (title: string) => `Values of ${title}: at the crosshair or the newest`,
      (title: string) => `Werte von ${title}: am Fadenkreuz oder die neuesten`,
    ],
    more: [(title: string) => `More for ${title}`, (title: string) => `Mehr zu ${title}`],
    title: ['Title', 'Titel'],
    up: ['Up', 'Hoch'],
    down: ['Down', 'Runter'],
    removePlot: ['Remove plot', 'Plot entfernen'],
    thresholds: ['Thresholds', 'Grenzwerte'],
    thresholdsFull: [
      (count: number) => `A plot has at most ${count}.`,
      (count: number) => `Höchstens ${count} je Plot.`,
    ],
    thresholdValue: ['Value', 'Wert'],
    addThreshold: ['Add', 'Hinzufügen'],
    removeThreshold: [
      (value: string) => `Remove threshold ${value}`,
      (value: string) => `Grenzwert ${value} entfernen`,
    ],
    side: ['Passed', 'Verletzt'],
    above: ['above', 'über'],
    below: ['below', 'unter'],
    isAbove: [
      (path: string, limit: string) => `${path} is above ${limit}`,
      (path: string, limit: string) => `${path} liegt über ${limit}`,
    ],
    isBelow: [
      (path: string, limit: string) => `${path} is below ${limit}`,
      (path: string, limit: string) => `${path} liegt unter ${limit}`,
    ],
    unit: ['Unit', 'Einheit'],
    noUnit: ['no unit', 'ohne'],
    label: ['Label', 'Name'],
    memory: [
      (fields: string, used: string, most: string) =>
        `The console keeps four hours of ${fields} fields: ${used} of at most ${most}.`,
      (fields: string, used: string, most: string) =>
        `Die Konsole hält vier Stunden von ${fields} Feldern: ${used} von höchstens ${most}.`,
    ],
    dropped: [
      (count: string) =>
        `The past of ${count} did not fit; it begins anew when one of them is shown.`,
      (count: string) => `${count} passten nicht; sie beginnen neu, sobald man sie zeigt.`,
    ],
    openInPlots: ['Open in plots', 'In Kurven öffnen'],
  },
  space: {
    direction: [
      'Where it points; the numbers are beside',
      'Wohin es zeigt; die Zahlen stehen daneben',
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
  exports: {
    download: ['Download', 'Herunterladen'],
    downloadFile: [(file: string) => `Download ${file}`, (file: string) => `${file} herunterladen`],
    csv: ['CSV', 'CSV'],
    csvOf: [(file: string) => `CSV of ${file}`, (file: string) => `CSV von ${file}`],
    chooseOf: [
      (file: string) => `Choose the tables of ${file}`,
      (file: string) => `Tabellen von ${file} wählen`,
    ],
    making: [
      (file: string) => `Making the tables of ${file}`,
      (file: string) => `Tabellen von ${file} werden erstellt`,
    ],
    made: [
      (name: string) => `${name} is complete; the browser saves it.`,
      (name: string) => `${name} ist fertig; der Browser speichert die Datei.`,
    ],
    leftOut: [
      (topics: string) => `Not in the tables, as they could not be read: ${topics}`,
      (topics: string) => `Nicht in den Tabellen, da nicht lesbar: ${topics}`,
    ],
    title: [(file: string) => `Tables of ${file}`, (file: string) => `Tabellen von ${file}`],
    tables: ['Tables', 'Tabellen'],
    joined: ['One, on one clock', 'Eine, auf einer Uhr'],
    perTopic: ['One per topic', 'Eine je Topic'],
    rows: ['Rows', 'Zeilen'],
    asRecorded: ['As recorded', 'Wie aufgenommen'],
    perSecond: [(rate: number) => `${rate} per second`, (rate: number) => `${rate} pro Sekunde`],
    columns: ['Columns', 'Spalten'],
    columnsLike: ['all, or position_m.* force*', 'alle, oder position_m.* force*'],
    part: ['Part', 'Teil'],
    whole: ['The whole recording', 'Die ganze Aufnahme'],
    times: ['Between two times', 'Zwischen zwei Zeiten'],
    between: ['Between two marks', 'Zwischen zwei Markern'],
    trial: ['Trial', 'Versuch'],
    condition: ['Condition', 'Bedingung'],
    from: ['From', 'Von'],
    to: ['To', 'Bis'],
    topics: ['Topics', 'Topics'],
    all: ['All', 'Alle'],
    none: ['None', 'Keine'],
    reading: ['Reading the recording.', 'Aufnahme wird gelesen.'],
    make: ['Make CSV', 'CSV erstellen'],
  },
  session: {
    title: ['Session', 'Sitzung'],
    participant: ['Participant', 'Versuchsperson'],
    participantHint: ['a code such as P07, not a name', 'ein Kürzel wie P07, kein Name'],
    experiment: ['Experiment', 'Experiment'],
    condition: ['Condition', 'Bedingung'],
    notes: ['Notes', 'Notizen'],
    more: ['File name and devices', 'Dateiname und Geräte'],
    pattern: ['File name', 'Dateiname'],
    patternHint: [
      '{participant} {experiment} {condition} {date} {time}; no file is overwritten',
      '{participant} {experiment} {condition} {date} {time}; keine Datei wird überschrieben',
    ],
    devices: ['Recorded devices', 'Aufgezeichnete Geräte'],
    withMedia: [
      (names: string) => `with picture and sound of ${names}`,
      (names: string) => `mit Bild und Ton von ${names}`,
    ],
    start: ['Start recording', 'Aufnahme starten'],
    stop: ['End the session', 'Sitzung beenden'],
    stopRecording: ['Stop recording', 'Aufnahme beenden'],
    about: [
      'One MCAP file: the session, all events, and the devices’ parameters with each change.',
      'Eine MCAP-Datei: die Sitzung, alle Ereignisse und die Parameter der Geräte mit jeder Änderung.',
    ],
    messages: [(count: string) => `${count} messages`, (count: string) => `${count} Nachrichten`],
    dropped: [(count: string) => `${count} dropped`, (count: string) => `${count} verloren`],
    missing: ['Not in this recording:', 'Nicht in dieser Aufnahme:'],
    recordingTo: [
      (file: string) => `Recording to ${file}.`,
      (file: string) => `Aufnahme in ${file}.`,
    ],
  },
  markers: {
    title: ['Markers', 'Marken'],
    note: ['A note', 'Eine Notiz'],
    mark: ['Mark', 'Markieren'],
    condition: ['Condition', 'Bedingung'],
    response: ['Response', 'Antwort'],
    trial: [(number: number) => `Trial ${number}`, (number: number) => `Durchgang ${number}`],
    begin: [
      (number: number) => `Begin trial ${number}`,
      (number: number) => `Durchgang ${number} beginnen`,
    ],
    end: ['End trial', 'Durchgang beenden'],
    count: [(count: string) => `Markers: ${count}`, (count: string) => `Marken: ${count}`],
    edit: ['Edit', 'Bearbeiten'],
    failed: [
      (label: string, time: string) => `“${label}” at ${time} is not recorded:`,
      (label: string, time: string) => `„${label}“ um ${time} ist nicht aufgezeichnet:`,
    ],
    waits: [
      (label: string, time: string) => `“${label}” at ${time} waits for the connection:`,
      (label: string, time: string) => `„${label}“ um ${time} wartet auf die Verbindung:`,
    ],
    dismiss: ['Dismiss', 'Verwerfen'],
    buttons: ['Buttons and their keys', 'Knöpfe und ihre Tasten'],
    label: ['Label', 'Beschriftung'],
    newLabel: ['new', 'neu'],
    key: [(label: string) => `Key of ${label}`, (label: string) => `Taste für ${label}`],
    remove: [(label: string) => `Remove ${label}`, (label: string) => `${label} entfernen`],
    add: ['Add a button', 'Knopf hinzufügen'],
    twice: [
      (key: string) => `Two buttons have the key ${key}; the first one gets it.`,
      (key: string) => `Zwei Knöpfe haben die Taste ${key}; der erste bekommt sie.`,
    ],
    taken: [
      (key: string) => `${key} begins or ends a trial; now it is this button’s.`,
      (key: string) => `${key} beginnt oder beendet Durchgänge; jetzt gehört sie diesem Knopf.`,
    ],
    none: ['No markers yet.', 'Noch keine Marken.'],
    omitted: [
      (count: string) => `${count} more are not listed here; recordings have them.`,
      (count: string) => `${count} weitere stehen nicht hier; Aufnahmen haben sie.`,
    ],
    list: ['List of markers', 'Liste der Marken'],
    time: ['Time', 'Zeit'],
    length: ['Duration', 'Dauer'],
    running: ['running', 'läuft'],
  },
  recordings: {
    refresh: ['Read the list anew', 'Liste neu lesen'],
    reading: ['Reading the list.', 'Die Liste wird gelesen.'],
    noService: [
      'The list needs a connection that may command.',
      'Die Liste braucht eine Verbindung, die steuern darf.',
    ],
    none: ['No recordings yet.', 'Noch keine Aufnahmen.'],
    noneFound: ['No recording has these words.', 'Keine Aufnahme hat diese Wörter.'],
    search: [
      'Search by file, participant, experiment, condition',
      'Nach Datei, Person, Experiment, Bedingung suchen',
    ],
    count: [
      (shown: string, all: string) => `${shown} of ${all}`,
      (shown: string, all: string) => `${shown} von ${all}`,
    ],
    omitted: [
      (count: string) => `${count} older recordings are in the folder, and not in this list.`,
      (count: string) => `${count} ältere Aufnahmen sind im Ordner, aber nicht in dieser Liste.`,
    ],
    showMore: [
      (count: number) => `Show ${count} more`,
      (count: number) => `${count} weitere zeigen`,
    ],
    file: ['File', 'Datei'],
    participant: ['Participant', 'Person'],
    experiment: ['Experiment', 'Experiment'],
    condition: ['Condition', 'Bedingung'],
    from: ['From', 'Beginn'],
    length: ['Length', 'Dauer'],
    messages: ['Messages', 'Nachrichten'],
    size: ['Size', 'Größe'],
    notComplete: ['not complete', 'unvollständig'],
    replay: ['Replay', 'Abspielen'],
    replayAgain: ['Replay again', 'Erneut abspielen'],
    replayOf: [(file: string) => `Replay ${file}`, (file: string) => `${file} abspielen`],
    deleteOf: [(file: string) => `Delete ${file}`, (file: string) => `${file} löschen`],
    remove: ['Delete', 'Löschen'],
    removed: [(file: string) => `${file} is deleted.`, (file: string) => `${file} ist gelöscht.`],
    undo: ['Undo', 'Rückgängig'],
    purged: [
      (files: string) =>
        `Gone for good, because they were deleted long ago or take too much: ${files}.`,
      (files: string) => `Endgültig entfernt, weil lange gelöscht oder zu groß: ${files}.`,
    ],
    deletedTitle: [
      (count: number, size: string) => `Deleted: ${count}, ${size}`,
      (count: number, size: string) => `Gelöscht: ${count}, ${size}`,
    ],
    deletedText: [
      'They can be restored for 30 days, or until there are more than 200 or 64 GiB.',
      'Sie lassen sich 30 Tage lang wiederherstellen, oder bis es mehr als 200 oder 64 GiB sind.',
    ],
    restore: ['Restore', 'Wiederherstellen'],
    restoreOf: [(file: string) => `Restore ${file}`, (file: string) => `${file} wiederherstellen`],
    restored: [
      (file: string) => `${file} is back in the list.`,
      (file: string) => `${file} ist wieder in der Liste.`,
    ],
    empty: ['Remove all for good', 'Alle endgültig entfernen'],
    emptyQuestion: [
      (count: number) => `Remove ${count} deleted recordings for good? This can't be undone.`,
      (count: number) =>
        `${count} gelöschte Aufnahmen endgültig entfernen? Das lässt sich nicht rückgängig machen.`,
    ],
    renamed: [
      (from: string, to: string) => `${from} is now ${to}.`,
      (from: string, to: string) => `${from} heißt jetzt ${to}.`,
    ],
    complete: [
      (file: string, count: number, dropped: number) =>
        `${file} is complete: ${count} messages, ${dropped > 0 ? dropped : 'none'} dropped.`,
      (file: string, count: number, dropped: number) =>
        `${file} ist vollständig: ${count} Nachrichten, ${dropped > 0 ? dropped : 'keine'} verloren.`,
    ],
  },
  replay: {
    title: ['Replay', 'Wiedergabe'],
    mark: ['REPLAY', 'WIEDERGABE'],
    play: ['Play', 'Abspielen'],
    pause: ['Pause', 'Anhalten'],
    time: ['Time of the replay', 'Zeit der Wiedergabe'],
    timeOf: [
      (at: string, all: string) => `${at} of ${all}`,
      (at: string, all: string) => `${at} von ${all}`,
    ],
    speed: ['Speed', 'Geschwindigkeit'],
  },
  review: {
    opening: ['Opening the recording.', 'Die Aufnahme wird geöffnet.'],
    noService: [
      'A review needs a connection that may command.',
      'Eine Durchsicht braucht eine Verbindung, die steuern darf.',
    ],
    messages: [(count: string) => `${count} messages`, (count: string) => `${count} Nachrichten`],
    notEnded: ['not complete', 'unvollständig'],
    notEndedText: [
      'This recording was not ended: its recorder died, or still runs. What is whole shows here; ' +
        '“rtpm bag recover” saves it in a new file.',
      'Diese Aufnahme wurde nicht beendet: Der Rekorder ist abgestürzt oder läuft noch. Was ganz ' +
        'ist, wird gezeigt; „rtpm bag recover“ rettet es in eine neue Datei.',
    ],
    omittedFields: [
      (count: number) => `${count} further fields are not shown: a review has at most 1024.`,
      (count: number) => `${count} weitere Felder fehlen: Eine Durchsicht hat höchstens 1024.`,
    ],
    unreadable: [
      (topics: string) => `The schemas of these topics can't be read: ${topics}.`,
      (topics: string) => `Die Schemata dieser Themen sind nicht lesbar: ${topics}.`,
    ],
    replayFrom: [(time: string) => `Replay from ${time}`, (time: string) => `Abspielen ab ${time}`],
    addNote: ['Add note', 'Notiz hinzufügen'],
    noteAt: [(time: string) => `Note at ${time}`, (time: string) => `Notiz bei ${time}`],
    cut: ['Cut this part', 'Ausschnitt speichern'],
    cutPart: [
      (from: string, to: string, length: string) => `New file with ${from} – ${to} (${length})`,
      (from: string, to: string, length: string) => `Neue Datei mit ${from} – ${to} (${length})`,
    ],
    cutting: [
      (file: string, percent: number) => `Cutting ${file}: ${percent} %`,
      (file: string, percent: number) => `${file} wird geschnitten: ${percent} %`,
    ],
    cutDone: [(file: string) => `${file} is ready.`, (file: string) => `${file} ist fertig.`],
    rename: ['Rename', 'Umbenennen'],
    newName: ['New name', 'Neuer Name'],
    remove: ['Delete', 'Löschen'],
    runTitle: ['Whole run', 'Gesamter Lauf'],
    strip: [
      (file: string) => `Whole run of ${file}: arrow keys move the crosshair, plus and minus zoom`,
      (file: string) =>
        `Gesamter Lauf von ${file}: Pfeiltasten bewegen das Fadenkreuz, Plus und Minus zoomen`,
    ],
    stripText: [
      (field: string, length: string) => (field === '' ? length : `${field}, ${length}`),
      (field: string, length: string) => (field === '' ? length : `${field}, ${length}`),
    ],
    stripReading: [
      (percent: number) => `Reading the recording: ${percent} %`,
      (percent: number) => `Die Aufnahme wird gelesen: ${percent} %`,
    ],
    slider: [
      (at: string, from: string, to: string) => `${at}; ${from} to ${to} show`,
      (at: string, from: string, to: string) => `${at}; ${from} bis ${to} sichtbar`,
    ],
    hint: [
      'Drag: zoom to a part. Wheel: zoom. Shift and drag: move. Click: set the crosshair.',
      'Ziehen: Ausschnitt. Rad: Zoom. Umschalt und Ziehen: verschieben. Klick: Fadenkreuz.',
    ],
    zoomIn: ['Zoom in', 'Vergrößern'],
    zoomOut: ['Zoom out', 'Verkleinern'],
    showAll: ['Show all', 'Alles zeigen'],
    compare: ['Compare with', 'Vergleichen mit'],
    compareNone: ['no other recording', 'keiner anderen Aufnahme'],
    alignAt: ['Aligned at', 'Ausgerichtet an'],
    alignBegin: ['their beginning', 'ihrem Beginn'],
    charts: ['Charts', 'Kurven'],
    chart: [
      (what: string) => `${what}: arrow keys move the crosshair, plus and minus zoom`,
      (what: string) => `${what}: Pfeiltasten bewegen das Fadenkreuz, Plus und Minus zoomen`,
    ],
    reading: ['reading…', 'wird gelesen …'],
    coarse: ['least and greatest values', 'kleinste und größte Werte'],
    exact: ['read from the file', 'aus der Datei gelesen'],
    chooseFields: [
      (shown: number, all: number) => `Fields: ${shown} of ${all}`,
      (shown: number, all: number) => `Felder: ${shown} von ${all}`,
    ],
    searchFields: ['Search fields, such as “arm0 force”', 'Felder suchen, etwa „arm0 force“'],
    moreFields: ['More fields match: type more.', 'Weitere Felder passen: mehr eingeben.'],
    noneFound: ['No field has these words.', 'Kein Feld hat diese Wörter.'],
    noFields: ['No field is chosen.', 'Kein Feld ist gewählt.'],
    removeField: [(path: string) => `Remove ${path}`, (path: string) => `${path} entfernen`],
    happenings: ['What happened', 'Was geschah'],
    kindsLabel: ['Kinds that show', 'Gezeigte Arten'],
    ofAll: [
      (inside: string, all: string) => `${inside} of ${all} in this part`,
      (inside: string, all: string) => `${inside} von ${all} in diesem Teil`,
    ],
    marker: ['Marker', 'Marke'],
    trial: ['Trial', 'Durchgang'],
    note: ['Note', 'Notiz'],
    fault: ['Fault', 'Störung'],
    stop: ['Stop', 'Halt'],
    lost: ['Lost', 'Verlust'],
    lease: ['Lease', 'Leihe'],
    endless: ['(no end recorded)', '(kein Ende aufgenommen)'],
    thinned: [
      (shown: string, all: string) => `${shown} of ${all} show, evenly chosen: zoom in for all.`,
      (shown: string, all: string) =>
        `${shown} von ${all} werden gezeigt, gleichmäßig gewählt: für alle hineinzoomen.`,
    ],
    nothingHappened: [
      'No markers, trials, notes or incidents.',
      'Keine Marken, Durchgänge, Notizen oder Vorfälle.',
    ],
    nothingHere: ['Nothing in this part.', 'Nichts in diesem Teil.'],
    moreHappenings: [
      (count: number) => `${count} more: zoom in.`,
      (count: number) => `${count} weitere: hineinzoomen.`,
    ],
    removeNote: [
      (text: string) => `Remove note “${text}”`,
      (text: string) => `Notiz „${text}“ entfernen`,
    ],
  },
  operator: {
    title: ['Operator', 'Bediener'],
    name: ['Name', 'Name'],
    room: ['Room', 'Raum'],
    save: ['Save', 'Speichern'],
    unnamed: [
      'Others see no name of yours when you operate a device.',
      'Andere sehen keinen Namen, wenn Sie ein Gerät bedienen.',
    ],
  },
  incidents: {
    title: ['Incidents', 'Vorfälle'],
    counts: [
      (open: number, unseen: number) => `${open} open, ${unseen} not acknowledged`,
      (open: number, unseen: number) => `${open} offen, ${unseen} nicht bestätigt`,
    ],
    which: ['Which incidents', 'Welche Vorfälle'],
    reading: ['Reading the incidents.', 'Vorfälle werden gelesen.'],
    search: ['Search', 'Suchen'],
    csv: ['Export CSV', 'CSV exportieren'],
    acknowledge: ['Acknowledge', 'Bestätigen'],
    acknowledgeAll: [
      (count: number) => `Acknowledge all ${count}`,
      (count: number) => `Alle ${count} bestätigen`,
    ],
    acknowledgeQuestion: [
      (count: number) =>
        `${count === 1 ? 'The incident counts' : `All ${count} incidents count`} as seen by you.`,
      (count: number) =>
        count === 1
          ? 'Der Vorfall gilt als von Ihnen gesehen.'
          : `Alle ${count} Vorfälle gelten als von Ihnen gesehen.`,
    ],
    needsName: [
      'To acknowledge, say who you are. The name is kept in this browser.',
      'Zum Bestätigen bitte einen Namen angeben. Er bleibt in diesem Browser.',
    ],
    notKept: [
      (why: string) => `Incidents are lost when the console ends: ${why}`,
      (why: string) => `Vorfälle gehen mit der Konsole verloren: ${why}`,
    ],
    torn: [
      (count: number) =>
        `${count} ${count === 1 ? 'line' : 'lines'} of the file could not be read, and ` +
        `${count === 1 ? 'is' : 'are'} missing here.`,
      (count: number) =>
        `${count} ${count === 1 ? 'Zeile' : 'Zeilen'} der Datei ` +
        `${count === 1 ? 'war' : 'waren'} nicht lesbar und ` +
        `${count === 1 ? 'fehlt' : 'fehlen'} hier.`,
    ],
    dropped: [
      (count: string) => `${count} older incidents were dropped: the console keeps 10 000.`,
      (count: string) => `${count} ältere Vorfälle verworfen: die Konsole behält 10 000.`,
    ],
    older: [
      (count: string) => `${count} more are in the export, and in rtpm incidents.`,
      (count: string) => `${count} weitere stehen im Export und in rtpm incidents.`,
    ],
    soundOn: ['Sound on', 'Ton an'],
    soundOff: ['Sound off', 'Ton aus'],
    soundWaits: [
      'The browser allows sound after the first press on this page.',
      'Der Browser erlaubt Ton erst nach dem ersten Klick auf dieser Seite.',
    ],
    lasts: ['open', 'offen'],
    for: [(length: string) => `for ${length}`, (length: string) => `seit ${length}`],
    lasted: [(length: string) => `lasted ${length}`, (length: string) => `dauerte ${length}`],
    inRecording: ['In the recording', 'In der Aufnahme'],
    flightRecord: ['Flight record', 'Flugschreiber'],
    flight: [
      (number: number, cause: string) => `newest record: ${number}, ${cause}`,
      (number: number, cause: string) => `neueste Aufzeichnung: ${number}, ${cause}`,
    ],
    flightTip: [
      (device: string) => `The newest cycles around a fault, as by rtpm flight-record ${device}`,
      (device: string) => `Die Zyklen um den neuesten Fehler, wie rtpm flight-record ${device}`,
    ],
    noFlight: ['There is none: no fault yet.', 'Keine: noch kein Fehler.'],
    seenBy: [
      (who: string, time: string) => `${who}, ${time}`,
      (who: string, time: string) => `${who}, ${time}`,
    ],
    toDo: [
      (count: number) => `${count} not acknowledged`,
      (count: number) => `${count} nicht bestätigt`,
    ],
  },
  lease: {
    unknown: ['unknown', 'unbekannt'],
    free: ['free', 'frei'],
    thisConsole: ['this console', 'diese Konsole'],
    another: ['another program', 'ein anderes Programm'],
    thisRoom: ['this room', 'dieser Raum'],
    since: [(time: string) => `since ${time}`, (time: string) => `seit ${time}`],
    for: [(time: string) => `for ${time}`, (time: string) => `seit ${time}`],
    untilReleased: ['until released', 'bis zur Freigabe'],
    gone: [
      (left: string) => `its browser is gone: ${left} left`,
      (left: string) => `der Browser ist weg: noch ${left}`,
    ],
    goneKept: [
      'its browser is gone; held until released',
      'der Browser ist weg; gehalten bis zur Freigabe',
    ],
    ask: ['Ask for it', 'Anfragen'],
    waits: [
      (who: string) => `Asked: ${who} has 30 s to answer.`,
      (who: string) => `Angefragt: ${who} hat 30 s Zeit.`,
    ],
    granted: ['It was handed over to you.', 'An Sie übergeben.'],
    itsOperator: ['the operator', 'der Bediener'],
    somebody: ['Another operator', 'Ein anderer Bediener'],
    asks: [
      (who: string, device: string) => `${who} asks for ${device}.`,
      (who: string, device: string) => `${who} möchte ${device} übernehmen.`,
    ],
    handOver: ['Hand over', 'Übergeben'],
    keep: ['Keep', 'Behalten'],
    keepLabel: ['Hold it while this page is closed, too', 'Auch bei geschlossener Seite halten'],
  },
  commands: {
    notThere: [
      (name: string) => `${name} is not at the registry. It shows again as soon as it is back.`,
      (name: string) => `${name} fehlt an der Registry. Es erscheint, sobald es zurück ist.`,
    ],
    notThereNow: [
      (name: string) =>
        `${name} is not at the registry, as far as was known. It shows again as soon as it is back.`,
      (name: string) =>
        `${name} fehlte zuletzt an der Registry. Es erscheint, sobald es zurück ist.`,
    ],
    state: ['State', 'Zustand'],
    lease: ['Lease', 'Bedienung'],
    faults: ['Faults', 'Fehler'],
    none: ['none', 'keine'],
    readOnly: [
      'Read only: open the URL with the token that rtpm-console printed.',
      'Nur lesen: die URL mit dem Token öffnen, die rtpm-console ausgab.',
    ],
    takeOver: ['Take over', 'Übernehmen'],
    takeOverQuestion: [
      (who: string, device: string) =>
        `${who} commands ${device}. Its force falls to zero, and its commands are refused from ` +
        'then on.',
      (who: string, device: string) =>
        `${who} steuert ${device}. Dessen Kraft fällt auf null, seine Befehle werden ab dann ` +
        'abgelehnt.',
    ],
    takeOverAnyway: ['Take over all the same', 'Trotzdem übernehmen'],
    release: ['Release', 'Freigeben'],
    activate: ['Activate', 'Aktivieren'],
    deactivate: ['Deactivate', 'Deaktivieren'],
    recover: ['Recover', 'Fehler löschen'],
    rearm: ['Rearm', 'Freischalten'],
    rearmAll: ['Rearm all', 'Alle freischalten'],
    rearmOne: [(name: string) => `Rearm ${name}`, (name: string) => `${name} freischalten`],
    rearmMany: [
      (count: number) => `Rearm ${count} devices`,
      (count: number) => `${count} Geräte freischalten`,
    ],
    rearmQuestion: [
      'Is the cause removed, and is nobody in reach who does not expect force? The force returns ' +
        'slowly after this.',
      'Ist die Ursache behoben, und ist niemand in Reichweite, der keine Kraft erwartet? Danach ' +
        'kommt die Kraft langsam zurück.',
    ],
    stop: [(name: string) => `Stop ${name}`, (name: string) => `${name} stoppen`],
    dismiss: ['Dismiss', 'Schließen'],
    done: [(what: string) => `Done: ${what}.`, (what: string) => `Erledigt: ${what}.`],
    doneLease: [
      (what: string) => `Done: ${what}. It lasts until it is released.`,
      (what: string) => `Erledigt: ${what}. Das gilt bis zur Freigabe.`,
    ],
    leaseEnded: [
      'The lease of this console has ended.',
      'Diese Konsole bedient das Gerät nicht mehr.',
    ],
  },
  incidentShow: {
    unseen: ['To do', 'Zu tun'],
    open: ['Open', 'Offen'],
    all: ['All', 'Alle'],
  },
  incidentNone: {
    unseen: ['Nothing is open, and all is acknowledged.', 'Nichts ist offen, alles ist bestätigt.'],
    open: ['Nothing is wrong now.', 'Zur Zeit ist nichts gestört.'],
    all: ['No incident so far.', 'Noch kein Vorfall.'],
  },
  severity: {
    info: ['Info', 'Info'],
    warning: ['Warning', 'Warnung'],
    alarm: ['Alarm', 'Alarm'],
  },
  incidentWhat: {
    lost: ['lost', 'verloren'],
    late: ['no new samples', 'keine neuen Messwerte'],
    stopped: ['emergency stop', 'Not-Halt'],
    'not stopped': ['NOT stopped', 'NICHT gestoppt'],
    fault: ['fault', 'Fehler'],
    limit: ['limit reached', 'Grenze erreicht'],
    lease: ['lease changed', 'Bedienung gewechselt'],
    silent: ['does not answer', 'antwortet nicht'],
    'disk low': ['disk space is low', 'wenig Speicherplatz'],
    'server lost': ['server lost', 'Server verloren'],
    recording: ['recording failed', 'Aufnahme gescheitert'],
    dropped: ['recording lost messages', 'Aufnahme verlor Nachrichten'],
    'clock jumped': ['clock jumped', 'Uhr gesprungen'],
  },
  effects: {
    take_over: ['this console holds the lease', 'diese Konsole bedient das Gerät'],
    release: ['the lease is released', 'freigegeben'],
    activate: ['active', 'aktiv'],
    deactivate: ['inactive, without force', 'inaktiv, ohne Kraft'],
    recover: [
      'recovered; the force returns slowly',
      'Fehler gelöscht; die Kraft kommt langsam zurück',
    ],
    rearm: ['rearmed; the force returns slowly', 'freigeschaltet; die Kraft kommt langsam zurück'],
    dismiss: ['dismissed', 'entfernt'],
  },
  condition: {
    lost: ['lost', 'verloren'],
    stopped: ['in emergency stop', 'im Not-Halt'],
    fault: ['in fault', 'mit Fehler'],
    stale: ['stale', 'veraltet'],
    good: ['live', 'live'],
    none: ['none', 'keine'],
    ofLive: [
      (count: number, all: number) => `${count} of ${all} live`,
      (count: number, all: number) => `${count} von ${all} live`,
    ],
    emergencyStop: ['emergency stop', 'Not-Halt'],
    notLive: ['not live', 'nicht live'],
    lostFor: [(time: string) => `lost for ${time}`, (time: string) => `verloren seit ${time}`],
    noSamples: ['no samples', 'keine Messwerte'],
    staleFor: [(time: string) => `stale for ${time}`, (time: string) => `veraltet seit ${time}`],
    old: [(time: string) => `${time} old`, (time: string) => `${time} alt`],
  },
  banners: {
    silent: ['The console is silent.', 'Die Konsole schweigt.'],
    silentSince: [
      (time: string) => `The console is silent since ${time}.`,
      (time: string) => `Die Konsole schweigt seit ${time}.`,
    ],
    lost: ['The connection to the console is lost.', 'Die Verbindung zur Konsole ist weg.'],
    lostSince: [
      (time: string) => `The connection to the console is lost since ${time}.`,
      (time: string) => `Die Verbindung zur Konsole ist weg seit ${time}.`,
    ],
    notLive: [
      'Nothing below is live. What you typed is kept; the page reconnects by itself.',
      'Nichts darunter ist live. Eingaben bleiben; die Seite verbindet sich selbst wieder.',
    ],
    notSent: [
      'The emergency stop was NOT sent: there is no connection.',
      'Der Not-Halt wurde NICHT gesendet: keine Verbindung.',
    ],
    notSentMore: [
      'Use the hardware stop. It is sent as soon as the console answers.',
      'Not-Halt-Taster drücken! Gesendet wird, sobald die Konsole antwortet.',
    ],
    stop: ['Emergency stop:', 'Not-Halt:'],
    stopNotes: [
      (notes: string) =>
        `every device that is known is stopped, but not all could be asked: ${notes}.`,
      (notes: string) =>
        `alle bekannten Geräte sind gestoppt, aber nicht alle waren erreichbar: ${notes}.`,
    ],
    hardware: ['Use the hardware stop.', 'Not-Halt-Taster drücken!'],
    notStopped: ['NOT stopped: use the hardware stop.', 'NICHT gestoppt: Not-Halt-Taster drücken!'],
    notStoppedFor: [
      (time: string, why: string) => ` for ${time} (${why})`,
      (time: string, why: string) => ` seit ${time} (${why})`,
    ],
    delivered: [
      (count: number) =>
        `The stop is delivered as soon as ${count === 1 ? 'it answers' : 'they answer'}.`,
      (count: number) =>
        `Der Halt wird zugestellt, sobald ${count === 1 ? 'es antwortet' : 'sie antworten'}.`,
    ],
    dismissQuestion: [
      'Is the hardware stop pressed, or the device off? The stop is not delivered any more when ' +
        'it comes back.',
      'Ist der Not-Halt-Taster gedrückt oder das Gerät aus? Der Halt wird nicht mehr zugestellt, ' +
        'wenn es zurückkommt.',
    ],
    dismissOne: [(name: string) => `Dismiss ${name}`, (name: string) => `${name} entfernen`],
    dismissMany: [
      (count: number) => `Dismiss ${count} devices`,
      (count: number) => `${count} Geräte entfernen`,
    ],
    inForce: ['Emergency stop is in force:', 'Not-Halt gilt:'],
    noForce: [
      'No force, and no commands, until rearmed.',
      'Keine Kraft und keine Befehle bis zum Freischalten.',
    ],
    notRearmed: [
      (why: string) => `Not rearmed: ${why}.`,
      (why: string) => `Nicht freigeschaltet: ${why}.`,
    ],
    recordingOpen: ['A recording is open', 'Eine Aufnahme ist offen'],
    replayed: [
      'the Live view shows recorded motion, not the devices.',
      'Live zeigt die Aufnahme, nicht die Geräte.',
    ],
    showDevices: ['Show the devices live', 'Geräte live zeigen'],
    showRecording: ['Show the recording', 'Aufnahme zeigen'],
    complaint: [
      (message: string) => `The console says: ${message}`,
      (message: string) => `Die Konsole meldet: ${message}`,
    ],
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
