import {centred, lengthOf, moved, timeAt, zoomed, type Span} from '../model/span';

/** The gestures and keys of a time axis: those of Foxglove's and Grafana's plots. */
export interface TimeAxis {
  /** The element's width. */
  readonly view: Span;
  /** The part that shows, which is zoomed and moved. */
  readonly span: Span;
  readonly whole: Span;
  /** The pixels left and right of the axis. */
  readonly leftPx: number;
  readonly rightPx: number;
  /** Where keys act; null: in the middle. */
  readonly pinnedS: number | null;
  readonly setSpan: (span: Span) => void;
  /** The pointer is at this moment; null: it is elsewhere. */
  readonly hover: (atS: number | null) => void;
  readonly pin: (atS: number) => void;
  /** While a part is drawn; null: no more. */
  readonly brush: (span: Span | null) => void;
}

/** So far a pointer may move in a click. */
const kClickPx = 4;
const kWheelZoom = 1.0015;
const kKeyZoom = 1.5;

/**
 * Dragging shows the drawn part, with Shift or the middle button it moves what shows; the wheel
 * zooms, sideways it moves; a click pins a moment; a double click shows all. One finger moves, two
 * zoom.
 */
export function attachGestures(element: HTMLElement, axis: () => TimeAxis): () => void {
  const pointers = new Map<number, number>();
  let downPx = 0;
  let downS = 0;
  let action: 'none' | 'brush' | 'move' | 'pinch' = 'none';
  let hasMoved = false;
  let pinch = {lengthPx: 1, atS: 0, span: {fromS: 0, toS: 1}};

  const shareAt = (px: number) => {
    const box = element.getBoundingClientRect();
    const {leftPx, rightPx} = axis();
    const widthPx = Math.max(box.width - leftPx - rightPx, 1);
    return Math.min(1, Math.max(0, (px - box.left - leftPx) / widthPx));
  };
  const timeOf = (px: number) => timeAt(axis().view, shareAt(px));
  const spread = () => {
    const [a = 0, b = 0] = [...pointers.values()];
    return {lengthPx: Math.max(Math.abs(a - b), 1), middlePx: (a + b) / 2};
  };

  const onDown = (event: PointerEvent) => {
    if (event.pointerType === 'mouse' && event.button > 1) return;
    pointers.set(event.pointerId, event.clientX);
    element.setPointerCapture(event.pointerId);
    if (pointers.size === 2) {
      const {lengthPx, middlePx} = spread();
      pinch = {lengthPx, atS: timeOf(middlePx), span: axis().span};
      action = 'pinch';
      axis().brush(null);
      return;
    }
    downPx = event.clientX;
    downS = timeOf(downPx);
    hasMoved = false;
    const isMove = event.pointerType !== 'mouse' || event.shiftKey || event.button === 1;
    action = isMove ? 'move' : 'brush';
    if (event.button === 1) event.preventDefault();
  };
  const onMove = (event: PointerEvent) => {
    const now = axis();
    if (!pointers.has(event.pointerId)) {
      if (event.pointerType === 'mouse') now.hover(timeOf(event.clientX));
      return;
    }
    pointers.set(event.pointerId, event.clientX);
    hasMoved ||= Math.abs(event.clientX - downPx) > kClickPx;
    if (action === 'pinch') {
      const {lengthPx} = spread();
      now.setSpan(zoomed(pinch.span, pinch.lengthPx / lengthPx, pinch.atS, now.whole));
    } else if (action === 'brush' && hasMoved) {
      const atS = timeOf(event.clientX);
      now.hover(atS);
      now.brush({fromS: Math.min(downS, atS), toS: Math.max(downS, atS)});
    } else if (action === 'move' && hasMoved) {
      const box = element.getBoundingClientRect();
      const widthPx = Math.max(box.width - now.leftPx - now.rightPx, 1);
      const byS = ((downPx - event.clientX) / widthPx) * lengthOf(now.view);
      downPx = event.clientX;
      now.setSpan(moved(now.span, byS / lengthOf(now.span), now.whole));
    }
  };
  const onUp = (event: PointerEvent) => {
    if (!pointers.delete(event.pointerId)) return;
    const now = axis();
    const atS = timeOf(event.clientX);
    if (event.type === 'pointerup' && action === 'brush' && hasMoved) {
      now.setSpan({fromS: Math.min(downS, atS), toS: Math.max(downS, atS)});
    } else if (event.type === 'pointerup' && action !== 'pinch' && !hasMoved) {
      now.pin(atS);
    }
    now.brush(null);
    if (pointers.size === 0) action = 'none';
  };
  const onLeave = () => {
    if (pointers.size === 0) axis().hover(null);
  };
  const onWheel = (event: WheelEvent) => {
    const now = axis();
    event.preventDefault();
    const unit = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1;
    const isSideways = event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY);
    if (isSideways) {
      const by = (Math.abs(event.deltaX) > 0 ? event.deltaX : event.deltaY) * unit;
      now.setSpan(moved(now.span, by / 1000, now.whole));
    } else {
      const factor = kWheelZoom ** (event.deltaY * unit);
      now.setSpan(zoomed(now.span, factor, timeOf(event.clientX), now.whole));
    }
  };
  const onDouble = () => axis().setSpan(axis().whole);

  element.addEventListener('pointerdown', onDown);
  element.addEventListener('pointermove', onMove);
  element.addEventListener('pointerup', onUp);
  element.addEventListener('pointercancel', onUp);
  element.addEventListener('pointerleave', onLeave);
  element.addEventListener('wheel', onWheel, {passive: false});
  element.addEventListener('dblclick', onDouble);
  return () => {
    element.removeEventListener('pointerdown', onDown);
    element.removeEventListener('pointermove', onMove);
    element.removeEventListener('pointerup', onUp);
    element.removeEventListener('pointercancel', onUp);
    element.removeEventListener('pointerleave', onLeave);
    element.removeEventListener('wheel', onWheel);
    element.removeEventListener('dblclick', onDouble);
  };
}

/** The keys of a time axis; returns whether the key is one. */
export function takeKey(event: KeyboardEvent, axis: TimeAxis): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  const {span, whole} = axis;
  const atS = axis.pinnedS ?? timeAt(span, 0.5);
  const isInside = atS >= span.fromS && atS <= span.toS;
  const aroundS = isInside ? atS : timeAt(span, 0.5);
  const step = event.shiftKey ? 0.1 : 0.01;
  const pin = (toS: number) => {
    const pinnedS = Math.min(Math.max(toS, whole.fromS), whole.toS);
    axis.pin(pinnedS);
    if (pinnedS < span.fromS) axis.setSpan(moved(span, -0.5, whole));
    if (pinnedS > span.toS) axis.setSpan(moved(span, 0.5, whole));
  };
  switch (event.key) {
    case 'ArrowLeft':
      pin(aroundS - step * (span.toS - span.fromS));
      return true;
    case 'ArrowRight':
      pin(aroundS + step * (span.toS - span.fromS));
      return true;
    case '+':
    case '=':
    case 'ArrowUp':
      axis.setSpan(zoomed(span, 1 / kKeyZoom, aroundS, whole));
      return true;
    case '-':
    case 'ArrowDown':
      axis.setSpan(zoomed(span, kKeyZoom, aroundS, whole));
      return true;
    case 'PageUp':
      axis.setSpan(moved(span, -0.9, whole));
      return true;
    case 'PageDown':
      axis.setSpan(moved(span, 0.9, whole));
      return true;
    case 'Home':
      pin(whole.fromS);
      axis.setSpan(centred(span, whole.fromS, whole));
      return true;
    case 'End':
      pin(whole.toS);
      axis.setSpan(centred(span, whole.toS, whole));
      return true;
    case '0':
    case 'Escape':
      axis.setSpan(whole);
      return true;
    default:
      return false;
  }
}
