import {useId} from 'preact/hooks';
import type {Form} from '../forms/form';
import {isSame, type Parameter} from '../forms/parameter';
import {lockOf, rangeText, valueText} from '../forms/validate';
import {Badge} from '../parts/parts';
import {texts} from '../texts/texts';

interface Props {
  form: Form;
  parameter: Parameter;
}

/** One parameter: what it is, its value as typed, and what is wrong with it. */
export function Field({form, parameter}: Props) {
  const id = useId();
  const list = form.list.value;
  const words = texts.value.field;
  const lock = lockOf(parameter, list?.isActive ?? false);
  const problem = form.problemOf(parameter);
  const refusal = form.refusals.value.get(parameter.name);
  const conflict = form.conflictOf(parameter);
  const isTyped = form.drafts.value.has(parameter.name);
  const isDefault = isSame(parameter.value, parameter.defaultValue);
  const defaultText = valueText(parameter.defaultValue);
  const range = rangeText(parameter);
  const state = problem !== null || refusal !== undefined ? 'is-wrong' : isTyped ? 'is-typed' : '';
  const shortName = parameter.name.slice(parameter.name.indexOf('.') + 1);
  return (
    <div class={`field ${state}`} data-parameter={parameter.name}>
      <label for={id}>
        <code>{shortName}</code>
        {isTyped && <Badge tone="accent">{words.notApplied}</Badge>}
      </label>
      <p id={`${id}-about`} class="about">
        {parameter.description}
      </p>
      <div class="input-row">
        <Input
          {...{form, parameter, id}}
          isLocked={lock !== null}
          isWrong={problem !== null || refusal !== undefined}
        />
        {parameter.unit !== '' && parameter.unit !== '1' && (
          <span class="unit">{parameter.unit}</span>
        )}
        <button
          type="button"
          class="quiet-button"
          disabled={lock !== null || (isDefault && !isTyped)}
          aria-label={words.typeDefault(parameter.name)}
          onClick={() => form.type(parameter, defaultText)}
        >
          {words.default}
        </button>
      </div>
      <p id={`${id}-range`} class="range">
        {range !== '' && <span>{range}</span>}
        <span>{words.defaultIs(defaultText === '' ? words.empty : defaultText)}</span>
        {isTyped && <span>{words.now(valueText(parameter.value))}</span>}
        {lock !== null && <span class="lock">{lock}</span>}
      </p>
      <div id={`${id}-problem`} aria-live="polite">
        {problem !== null && <p class="problem">{problem}</p>}
        {refusal !== undefined && <p class="problem">{words.refused(refusal)}</p>}
        {conflict !== null && <p class="warn-text">{conflict}</p>}
      </div>
    </div>
  );
}

interface InputProps extends Props {
  id: string;
  isLocked: boolean;
  isWrong: boolean;
}

function Input({form, parameter, id, isLocked, isWrong}: InputProps) {
  const common = {
    id,
    disabled: isLocked,
    'aria-describedby': `${id}-about ${id}-range ${id}-problem`,
    'aria-invalid': isWrong,
  };
  const draft = form.draftOf(parameter);
  if (parameter.type === 'Bool') {
    return (
      <input
        {...common}
        type="checkbox"
        checked={draft === 'true'}
        onChange={(event) => form.type(parameter, String(event.currentTarget.checked))}
      />
    );
  }
  if (parameter.type === 'Choice') {
    return (
      <select
        {...common}
        value={draft}
        onChange={(event) => form.type(parameter, event.currentTarget.value)}
      >
        {parameter.choices.map((one) => (
          <option key={one} value={one}>
            {one}
          </option>
        ))}
      </select>
    );
  }
  const isNumber = parameter.type === 'Integer' || parameter.type === 'Real';
  return (
    <input
      {...common}
      type="text"
      value={draft}
      autocomplete="off"
      spellcheck={false}
      inputMode={isNumber ? 'decimal' : 'text'}
      onInput={(event) => form.type(parameter, event.currentTarget.value)}
      onKeyDown={(event) => {
        if (event.key === 'Escape') form.discard([parameter.name]);
        if (event.key === 'Enter' && form.invalidCount.value === 0) void form.apply();
      }}
    />
  );
}
