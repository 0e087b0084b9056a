import type {ComponentChildren, JSX} from 'preact';
import {useRef, useState} from 'preact/hooks';
import {useId} from './parts';

export interface Option {
  readonly key: string;
  readonly label: ComponentChildren;
  /** At the right. */
  readonly aside?: ComponentChildren;
}

interface Props {
  label: string;
  placeholder: string;
  /** Shown in the field while the list is closed. */
  value?: string;
  query: string;
  onQuery: (query: string) => void;
  options: readonly Option[];
  onChoose: (index: number) => void;
  /** More than one is chosen, one after the other. */
  isMultiple?: boolean;
  isOpen: boolean;
  onOpen: (isOpen: boolean) => void;
  /** Below the list. */
  note: ComponentChildren;
  inputRef?: {current: HTMLInputElement | null};
}

/** A field with a list of what its words find, by pointer and keyboard. */
export function Combobox(props: Props) {
  const {options, isOpen, onOpen} = props;
  const id = useId('combobox');
  const list = useRef<HTMLUListElement>(null);
  const [chosen, setChosen] = useState(0);
  const at = Math.min(chosen, options.length - 1);
  const choose = (index: number) => {
    if (options[index] === undefined) return;
    props.onChoose(index);
    if (props.isMultiple !== true) onOpen(false);
  };
  const move = (to: number) => {
    const bounded = Math.min(options.length - 1, Math.max(0, to));
    onOpen(true);
    setChosen(bounded);
    list.current?.children[bounded]?.scrollIntoView({block: 'nearest'});
  };
  const onKeyDown = (event: JSX.TargetedKeyboardEvent<HTMLInputElement>) => {
    if (event.key === 'ArrowDown') move(isOpen ? at + 1 : 0);
    else if (event.key === 'ArrowUp') move(at - 1);
    else if (event.key === 'Enter' && isOpen) choose(at);
    else if (event.key === 'Escape' && isOpen) onOpen(false);
    else return;
    event.preventDefault();
  };
  return (
    <div
      class="combobox"
      onFocusOut={(event) => {
        if (!event.currentTarget.contains(event.relatedTarget as Node | null)) onOpen(false);
      }}
    >
      <input
        {...(props.inputRef === undefined ? {} : {ref: props.inputRef})}
        type="text"
        role="combobox"
        aria-label={props.label}
        placeholder={props.placeholder}
        aria-expanded={isOpen}
        aria-controls={`${id}-list`}
        aria-autocomplete="list"
        {...(isOpen && options.length > 0 ? {'aria-activedescendant': `${id}-${at}`} : {})}
        value={isOpen ? props.query : (props.value ?? props.query)}
        spellcheck={false}
        autocomplete="off"
        maxLength={200}
        onFocus={() => onOpen(true)}
        onClick={() => onOpen(true)}
        onInput={(event) => {
          props.onQuery(event.currentTarget.value);
          setChosen(0);
          onOpen(true);
        }}
        onKeyDown={onKeyDown}
      />
      <div class={`combobox-list ${isOpen ? '' : 'is-closed'}`}>
        <ul id={`${id}-list`} ref={list} role="listbox" aria-label={props.label}>
          {isOpen &&
            options.map((one, i) => (
              <li
                key={one.key}
                id={`${id}-${i}`}
                role="option"
                aria-selected={i === at}
                data-option={one.key}
                // The field keeps the focus, so that typing goes on.
                onMouseDown={(event) => event.preventDefault()}
                onClick={() => choose(i)}
              >
                <span>{one.label}</span>
                <span class="unit">{one.aside}</span>
              </li>
            ))}
        </ul>
        {isOpen && <p class="quiet small">{props.note}</p>}
      </div>
    </div>
  );
}
