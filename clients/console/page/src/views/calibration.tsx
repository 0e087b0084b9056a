import {useEffect, useRef} from 'preact/hooks';
import {useApp} from '../store/app';
import {isOver, type Calibration, type Run} from '../store/calibration';
import {valueText} from '../forms/validate';
import {Card, Confirm, Empty, Notice} from '../parts/parts';
import {texts, type Texts} from '../texts/texts';

interface Props {
  name: string;
  isOpen: boolean;
  setOpen: (isOpen: boolean) => void;
}

/** The dialogue of a calibration. It does not cover the page: the stop stays in reach. */
export function CalibrationPanel({name, isOpen, setOpen}: Props) {
  const app = useApp();
  const calibration = app.calibration(name);
  const isServed = app.link.services.value.has(`${name}/config/calibrations`);
  useEffect(() => {
    if (!isServed) return undefined;
    void calibration.open();
    return () => calibration.close();
  }, [calibration, isServed]);
  const run = calibration.run.value;
  const opener = useRef<HTMLButtonElement>(null);
  const isShown = isOpen || run !== null;
  if (calibration.offers.value.length === 0 && run === null) return null;
  const close = () => {
    calibration.forget();
    setOpen(false);
    requestAnimationFrame(() => opener.current?.focus());
  };
  return (
    <Card title={texts.value.calibration.title} class="calibration">
      {isShown ? (
        <Dialogue
          calibration={calibration}
          isUsable={isServed && app.isLive.value}
          onClose={close}
        />
      ) : (
        <button ref={opener} type="button" onClick={() => setOpen(true)}>
          {texts.value.calibration.open(name)}
        </button>
      )}
    </Card>
  );
}

interface DialogueProps {
  calibration: Calibration;
  isUsable: boolean;
  onClose: () => void;
}

function Dialogue({calibration, isUsable, onClose}: DialogueProps) {
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => box.current?.focus(), []);
  const run = calibration.run.value;
  const problem = calibration.problem.value;
  return (
    <div
      ref={box}
      class="dialogue"
      role="dialog"
      aria-label={texts.value.calibration.title}
      tabIndex={-1}
      onKeyDown={(event) => {
        if (event.key === 'Escape' && (run === null || isOver(run.phase))) onClose();
      }}
    >
      {run === null ? (
        <Offers {...{calibration, isUsable, onClose}} />
      ) : (
        <Running {...{calibration, isUsable, onClose, run}} />
      )}
      {problem !== '' && (
        <Notice tone="bad" role="alert">
          {problem}
        </Notice>
      )}
    </div>
  );
}

function Offers({calibration, isUsable, onClose}: DialogueProps) {
  return (
    <>
      {calibration.offers.value.length === 0 && <Empty>{texts.value.calibration.none}</Empty>}
      <ul class="offers">
        {calibration.offers.value.map((offer) => (
          <li key={offer.name}>
            <div>
              <code>{offer.name}</code>
              <p class="about">{offer.description}</p>
            </div>
            <button
              type="button"
              disabled={!isUsable}
              onClick={() => void calibration.start(offer.name)}
            >
              {texts.value.calibration.start}
            </button>
          </li>
        ))}
      </ul>
      <button type="button" onClick={onClose}>
        {texts.value.parts.close}
      </button>
    </>
  );
}

const kPhaseWords = {
  Running: 'running',
  Prompt: 'prompt',
  Done: 'done',
  Failed: 'failed',
  Kept: 'kept',
  Discarded: 'discarded',
} as const satisfies Readonly<Record<Run['phase'], keyof Texts['calibration']>>;

function Running({calibration, isUsable, onClose, run}: DialogueProps & {run: Run}) {
  const words = texts.value.calibration;
  const percent = Math.round(100 * run.progress);
  return (
    <>
      <p class="run-head" role="status" data-testid="calibration-phase">
        <code>{run.name}</code>{' '}
        <b>
          {run.phase === 'Kept' && calibration.isSaved.value
            ? words.keptAndSaved
            : words[kPhaseWords[run.phase]]}
        </b>
      </p>
      {(run.phase === 'Running' || run.phase === 'Prompt') && (
        <div
          class="progress"
          role="progressbar"
          aria-label={words.progress}
          aria-valuenow={percent}
          aria-valuemin={0}
          aria-valuemax={100}
        >
          <i style={{width: `${percent}%`}} />
        </div>
      )}
      {run.text !== '' && <p class="run-text">{run.text}</p>}
      {run.settings.length > 0 && (
        <dl class="facts">
          {run.settings.map((one) => (
            <div key={one.name}>
              <dt>
                <code>{one.name}</code>
              </dt>
              <dd>{valueText(one.value)}</dd>
            </div>
          ))}
        </dl>
      )}
      {run.phase === 'Done' && <p class="quiet small">{words.savesOthers}</p>}
      <div class="row">
        {run.phase === 'Prompt' &&
          run.answers.map((answer, i) => (
            <button
              key={answer}
              type="button"
              class={i === 0 ? 'strong' : ''}
              disabled={!isUsable}
              onClick={() => void calibration.answer(answer)}
            >
              {answer}
            </button>
          ))}
        {run.phase === 'Done' && (
          <button
            type="button"
            class="strong"
            disabled={!isUsable}
            onClick={() => void calibration.keep()}
          >
            {words.keep}
          </button>
        )}
        {!isOver(run.phase) && (
          <Confirm
            label={run.phase === 'Done' ? words.discard : texts.value.parts.cancel}
            disabled={!isUsable}
            confirm={words.discard}
            question={words.discardQuestion}
            onConfirm={() => void calibration.discard()}
          />
        )}
        {isOver(run.phase) && (
          <button type="button" onClick={onClose}>
            {texts.value.parts.close}
          </button>
        )}
      </div>
    </>
  );
}
