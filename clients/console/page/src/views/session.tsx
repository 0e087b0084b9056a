import {signal, useSignal} from '@preact/signals';
import {useEffect} from 'preact/hooks';
import {useApp} from '../store/app';
import {recall, remember} from '../store/kept';
import type {Recording} from '../model/state';
import {Badge, Card, Notice, useId} from '../parts/parts';
import {momentText} from '../model/span';
import {bytes, thousands} from '../parts/text';
import {texts} from '../texts/texts';

const kExperimentKey = 'rtpm.session.experiment';
const kConditionKey = 'rtpm.session.condition';
const kPatternKey = 'rtpm.session.pattern';
const kPattern = '{experiment}_{participant}_{condition}_{date}_{time}';

/** Typed texts stay while other views show. The participant is never proposed. */
const participant = signal('');
const experiment = signal(recall(kExperimentKey) ?? '');
const condition = signal(recall(kConditionKey) ?? '');
const notes = signal('');
const pattern = signal(recall(kPatternKey) ?? kPattern);
const withMedia = signal(true);
/** Devices that are left out. */
const omitted = signal<ReadonlySet<string>>(new Set());

/** Starts and ends a session: a recording that states who, what and how. */
export function SessionCard() {
  const app = useApp();
  const recording = app.state.value?.recording;
  const isOn = recording !== undefined && recording.file !== null;
  const words = texts.value.session;
  return (
    <Card title={words.title} class="live-zone session">
      {isOn ? <Running recording={recording} /> : <Start />}
      {recording !== undefined && recording.problem !== '' && (
        <Notice tone="bad" role="alert">
          {recording.problem}
        </Notice>
      )}
    </Card>
  );
}

function Running({recording}: {recording: Recording}) {
  const app = useApp();
  const isUsable = app.isLive.value && app.mayCommand.value;
  const words = texts.value.session;
  const {session} = recording;
  const facts =
    session === null ? [] : [session.participant, session.experiment, session.condition];
  const named = facts.filter((one) => one !== '');
  return (
    <>
      <div class="row">
        <button
          type="button"
          class="record is-on"
          data-testid="record"
          disabled={!isUsable}
          onClick={() => void app.recordings.stop()}
        >
          <i aria-hidden="true" />
          {session === null ? words.stopRecording : words.stop}
        </button>
        <div class="session-facts">
          {named.length > 0 && <p class="session-name">{named.join(' · ')}</p>}
          <p class="record-facts">
            <b>{recording.file}</b> {momentText(recording.timeS, 0)} ·{' '}
            {words.messages(thousands(recording.messageCount))} · {bytes(recording.byteCount)}
            {recording.dropCount > 0 && (
              <>
                {' '}
                · <Badge tone="warn">{words.dropped(thousands(recording.dropCount))}</Badge>
              </>
            )}
          </p>
        </div>
      </div>
      {session !== null && session.notes !== '' && <p class="quiet">{session.notes}</p>}
      {recording.missing.length > 0 && (
        <Notice tone="warn" role="status">
          <p>{words.missing}</p>
          <ul>
            {recording.missing.map((one) => (
              <li key={one}>{one}</li>
            ))}
          </ul>
        </Notice>
      )}
    </>
  );
}

function Start() {
  const app = useApp();
  const isUsable = app.isLive.value && app.mayCommand.value;
  const isStarting = useSignal(false);
  const words = texts.value.session;
  const media = (app.state.value?.media ?? []).map((one) => one.name);
  const devices = app.devices.value.map((one) => one.name);
  const chosen = devices.filter((name) => !omitted.value.has(name));
  const start = async () => {
    isStarting.value = true;
    remember(kExperimentKey, experiment.value);
    remember(kConditionKey, condition.value);
    remember(kPatternKey, pattern.value);
    const isDone = await app.recordings.startSession({
      participant: participant.value.trim(),
      experiment: experiment.value.trim(),
      condition: condition.value.trim(),
      notes: notes.value.trim(),
      pattern: pattern.value.trim(),
      devices: chosen.length === devices.length ? [] : chosen,
      media: withMedia.value ? media : [],
    });
    isStarting.value = false;
    if (!isDone) return;
    participant.value = '';
    notes.value = '';
  };
  // Only what starts now may be left out.
  useEffect(() => {
    const here = new Set(devices);
    const left = [...omitted.value].filter((name) => here.has(name));
    if (left.length < omitted.value.size) omitted.value = new Set(left);
  }, [devices.join('\n')]);
  return (
    <form
      class="session-form"
      autocomplete="off"
      onSubmit={(event) => {
        event.preventDefault();
        if (isUsable && !isStarting.value) void start();
      }}
    >
      <div class="session-fields">
        <Text
          label={words.participant}
          hint={words.participantHint}
          value={participant}
          size={100}
        />
        <Text label={words.experiment} value={experiment} size={100} />
        <Text label={words.condition} value={condition} size={100} />
        <Text label={words.notes} value={notes} size={4000} />
      </div>
      <details class="session-more">
        <summary>{words.more}</summary>
        <div class="session-fields">
          <Text label={words.pattern} hint={words.patternHint} value={pattern} size={100} />
        </div>
        {devices.length > 0 && (
          <fieldset class="session-devices">
            <legend>{words.devices}</legend>
            {devices.map((name) => (
              <label key={name}>
                <input
                  type="checkbox"
                  checked={!omitted.value.has(name)}
                  onChange={(event) => {
                    const next = new Set(omitted.value);
                    if (event.currentTarget.checked) next.delete(name);
                    else next.add(name);
                    omitted.value = next;
                  }}
                />
                {name}
              </label>
            ))}
          </fieldset>
        )}
      </details>
      {media.length > 0 && (
        <label class="session-media">
          <input
            type="checkbox"
            checked={withMedia.value}
            onChange={(event) => (withMedia.value = event.currentTarget.checked)}
          />
          {words.withMedia(media.join(', '))}
        </label>
      )}
      <div class="row">
        <button
          type="submit"
          class="record"
          data-testid="record"
          disabled={!isUsable || isStarting.value || (devices.length > 0 && chosen.length === 0)}
        >
          <i aria-hidden="true" />
          {words.start}
        </button>
        <p class="quiet">{words.about}</p>
      </div>
    </form>
  );
}

interface TextProps {
  label: string;
  hint?: string;
  value: {value: string};
  size: number;
}

function Text({label, hint, value, size}: TextProps) {
  const id = useId('session');
  return (
    <div class="session-field">
      <label for={id}>{label}</label>
      <input
        type="text"
        id={id}
        value={value.value}
        maxLength={size}
        autocomplete="off"
        {...(hint === undefined ? {} : {'aria-describedby': `${id}-hint`})}
        onInput={(event) => (value.value = event.currentTarget.value)}
      />
      {hint !== undefined && (
        <p class="session-hint" id={`${id}-hint`}>
          {hint}
        </p>
      )}
    </div>
  );
}
