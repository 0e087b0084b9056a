import type {ComponentChildren, JSX} from 'preact';
import {useEffect, useRef, useState} from 'preact/hooks';
import {texts} from '../texts/texts';

/** The small parts of which the views are made. */

export type Tone = 'plain' | 'good' | 'warn' | 'bad' | 'replay' | 'accent';

export function Badge({tone = 'plain', children}: {tone?: Tone; children: ComponentChildren}) {
  return <span class={`badge badge-${tone}`}>{children}</span>;
}

interface CardProps {
  title: ComponentChildren;
  /** At the right of the title. */
  aside?: ComponentChildren;
  class?: string;
  children: ComponentChildren;
}

let lastId = 0;
export function useId(prefix: string): string {
  return useState(() => `${prefix}-${++lastId}`)[0];
}

export function Card({title, aside, children, class: extra = ''}: CardProps) {
  const id = useId('card');
  return (
    <section class={`card ${extra}`} aria-labelledby={id}>
      <div class="card-head">
        <h2 id={id}>{title}</h2>
        {aside}
      </div>
      {children}
    </section>
  );
}

export function Notice({
  tone,
  children,
  role,
}: {
  tone: Tone;
  children: ComponentChildren;
  role?: 'alert' | 'status';
}) {
  return (
    <div class={`notice notice-${tone}`} {...(role ? {role} : {})}>
      {children}
    </div>
  );
}

export function Empty({children}: {children: ComponentChildren}) {
  return <p class="empty">{children}</p>;
}

/** Why something did not go; empty: it did. */
export function Problem({text}: {text: string}) {
  if (text === '') return null;
  return (
    <p class="problem" role="alert">
      {text}
    </p>
  );
}

interface ConfirmProps {
  label: string;
  question: string;
  confirm: string;
  onConfirm: () => void;
  class?: string;
  disabled?: boolean;
}

/** A button that asks before it acts. */
export function Confirm(props: ConfirmProps) {
  const [isAsking, setAsking] = useState(false);
  const first = useRef<HTMLButtonElement>(null);
  const opener = useRef<HTMLButtonElement>(null);
  const wasAsking = useRef(false);
  useEffect(() => {
    if (isAsking) first.current?.focus();
    else if (wasAsking.current) opener.current?.focus();
    wasAsking.current = isAsking;
  }, [isAsking]);
  if (!isAsking) {
    return (
      <button
        ref={opener}
        type="button"
        class={props.class}
        disabled={props.disabled}
        onClick={() => setAsking(true)}
      >
        {props.label}…
      </button>
    );
  }
  const onKeyDown = (event: JSX.TargetedKeyboardEvent<HTMLDivElement>) => {
    if (event.key === 'Escape') setAsking(false);
  };
  const act = () => {
    setAsking(false);
    props.onConfirm();
  };
  return (
    <div class="confirm" role="group" aria-label={props.label} onKeyDown={onKeyDown}>
      <p>{props.question}</p>
      <div class="row">
        <button ref={first} type="button" onClick={() => setAsking(false)}>
          {texts.value.parts.cancel}
        </button>
        <button type="button" class="strong" disabled={props.disabled} onClick={act}>
          {props.confirm}
        </button>
      </div>
    </div>
  );
}

interface ChoiceProps<T extends string | number> {
  label: string;
  options: readonly {readonly value: T; readonly label: string}[];
  value: T;
  onChange: (value: T) => void;
}

/** A few options side by side, of which one is chosen. */
export function Choice<T extends string | number>({
  label,
  options,
  value,
  onChange,
}: ChoiceProps<T>) {
  return (
    <div class="choice" role="group" aria-label={label}>
      {options.map((one) => (
        <button
          type="button"
          key={one.value}
          aria-pressed={one.value === value}
          onClick={() => onChange(one.value)}
        >
          {one.label}
        </button>
      ))}
    </div>
  );
}
