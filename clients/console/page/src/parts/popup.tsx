import type {ComponentChildren, JSX} from 'preact';
import {useEffect, useRef} from 'preact/hooks';
import {texts} from '../texts/texts';
import {useId} from './parts';

/** Beside the edges of the page. */
const kMarginPx = 8;

interface PopupProps {
  /** The button's content, and its name where that is no text. */
  button: ComponentChildren;
  label?: string;
  buttonClass: string;
  class: string;
  /** Opens also while the pointer is over the button, and closes when the page scrolls. */
  isHint?: boolean;
  children: ComponentChildren;
}

/**
 * A button that opens a panel beside it. Escape and a press elsewhere close it. It is never over
 * the header, where the stop is.
 */
export function Popup(props: PopupProps) {
  const id = useId('popup');
  const button = useRef<HTMLButtonElement>(null);
  const panel = useRef<HTMLDivElement>(null);
  const isHint = props.isHint ?? false;
  useEffect(() => {
    if (!isHint) return undefined;
    const hide = () => panel.current?.hidePopover();
    window.addEventListener('scroll', hide, {capture: true, passive: true});
    return () => window.removeEventListener('scroll', hide, {capture: true});
  }, [isHint]);
  const place = (event: JSX.TargetedEvent<HTMLDivElement, Event>) => {
    if ((event as unknown as ToggleEvent).newState !== 'open' || button.current === null) return;
    placeBeside(button.current, event.currentTarget);
  };
  const hover = (event: JSX.TargetedPointerEvent<HTMLButtonElement>) => {
    if (event.pointerType !== 'mouse') return;
    if (event.type === 'pointerenter') panel.current?.showPopover();
    else panel.current?.hidePopover();
  };
  return (
    <>
      <button
        ref={button}
        type="button"
        class={props.buttonClass}
        popovertarget={id}
        {...(isHint ? {onPointerEnter: hover, onPointerLeave: hover} : {})}
        {...(isHint ? {popovertargetaction: 'show' as const} : {})}
        {...(props.label === undefined ? {} : {'aria-label': props.label})}
      >
        {props.button}
      </button>
      <div
        ref={panel}
        id={id}
        popover="auto"
        class={`popup ${props.class}`}
        onBeforeToggle={place}
        onClick={(event) => {
          // A link leads elsewhere.
          if (event.target instanceof HTMLAnchorElement) event.currentTarget.hidePopover();
        }}
      >
        {props.children}
      </div>
    </>
  );
}

/** Below the button, or above it where there is more room. */
function placeBeside(button: HTMLElement, panel: HTMLElement): void {
  const {left, top, bottom} = button.getBoundingClientRect();
  const {clientWidth, clientHeight} = document.documentElement;
  const headerBottom = document.querySelector('.header')?.getBoundingClientRect().bottom ?? 0;
  const roomBelow = clientHeight - bottom;
  const roomAbove = top - headerBottom;
  const isBelow = roomBelow >= roomAbove;
  const edge = isBelow ? Math.max(bottom, headerBottom) : clientHeight - top;
  panel.style.top = isBelow ? `${edge + kMarginPx / 2}px` : 'auto';
  panel.style.bottom = isBelow ? 'auto' : `${edge + kMarginPx / 2}px`;
  panel.style.maxHeight = `${Math.max(0, (isBelow ? clientHeight - edge : roomAbove) - kMarginPx)}px`;
  panel.style.setProperty('--page', `${clientWidth}px`);
  panel.style.setProperty('--x', `${left}px`);
}

/** Says what a number or a word means: by pointer, keyboard or touch. */
export function Help({of, children}: {of: string; children: ComponentChildren}) {
  return (
    <Popup
      isHint
      button={<span aria-hidden="true">?</span>}
      label={texts.value.parts.help(of)}
      buttonClass="help"
      class="help-text"
    >
      {children}
    </Popup>
  );
}

/** The head of a table's column, with its help. */
export function Column(props: {name: string; help?: string; isNumber?: boolean}) {
  return (
    <th scope="col" class={props.isNumber === true ? 'number' : ''}>
      {props.name}
      {props.help !== undefined && <Help of={props.name}>{props.help}</Help>}
    </th>
  );
}
