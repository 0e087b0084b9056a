import {centred, lengthOf, moved, timeAt, zoomed, type Span} from '../model/span';

/** The gestures and keys of a time axis: those of Foxglove's and Grafana's plots. */
export interface TimeAxis {
  /** The element's width. */
  readonly view: Span;
  /** The pixels left and right of the axis. */
  readonly leftPx: number;
  readonly rightPx: number;
  /** The pointer is at this moment; null: it is elsewhere. */
  readonly hover: (atS: number | null) => void;
  /** null: what shows stays, and the wheel is the page's. */
  readonly zoom: Zoom | null;
}

/** A part of a whole that is zoomed and moved. */
export interface Zoom {
  readonly span: Span;
  readonly whole: Span;
  /** Where keys act; null: in the middle. */
  readonly pinnedS: number | null;
  readonly setSpan: (span: Span) => void;
  /** Shows what is shown without gestures. */
  readonly reset: () => void;
  readonly pin: (atS: number) => void;
  /** While a part is drawn; null: no more. */
  readonly brush: (span: Span | null) => void;
}

/** So far a pointer may move in a click. */
const kClickPx = 4;
const kWheelZoom = 1.0015;
const kKeyZoom = 1.5;
const kKeyStep = 0.01;
const kKeyMove = 0.1;

/** The moment under a pointer, and how long a pixel is. */
export function underPointer(
  element: HTMLElement,
  clientX: number,
  {view, leftPx, rightPx}: Pick<TimeAxis, 'view' | 'leftPx' | 'rightPx'>,
): {readonly atS: number; readonly perPx: number} {
  const box = element.getBoundingClientRect();
  const widthPx = Math.max(box.width - leftPx - rightPx, 1);
  const share = Math.min(1, Math.max(0, (clientX - box.left - leftPx) / widthPx));
  return {atS: timeAt(view, share), perPx: lengthOf(view) / widthPx};
}

function spanOf(a: number, b: number): Span {
  return {fromS: Math.min(a, b), toS: Math.max(a, b)};
}

/**
 * Dragging shows the drawn part, with Shift or the middle button it moves what shows; the wheel
 * zooms, sideways it moves; a click pins a moment; a double click shows all. One finger moves, two
 * zoom.
 */
export function attachGestures(element: HTMLElement, axisOf: () => TimeAxis | null): () => void {
  const pointers = new Map<number, number>();
  let downPx = 0;
  let downS = 0;
  let action: 'none' | 'brush' | 'move' | 'pinch' = 'none';
  let hasMoved = false;
  let pinch = {lengthPx: 1, atS: 0, span: {fromS: 0, toS: 1}};

  const spread = () => {
    const [a = 0, b = 0] = [...pointers.values()];
    return {lengthPx: Math.max(Math.abs(a - b), 1), middlePx: (a + b) / 2};
  };
  /** Calls `act` with the axis, and the moment under the pointer, where there is an axis. */
  const withAxis =
    <E extends MouseEvent>(
      act: (event: E, axis: TimeAxis, atS: number, zoom: Zoom | null, perPx: number) => void,
    ) =>
    (event: E) => {
      const axis = axisOf();
      if (axis === null) return;
      const {atS, perPx} = underPointer(element, event.clientX, axis);
      act(event, axis, atS, axis.zoom, perPx);
    };

  const onDown = withAxis<PointerEvent>((event, axis, atS, zoom) => {
    if (zoom === null || (event.pointerType === 'mouse' && event.button > 1)) return;
    pointers.set(event.pointerId, event.clientX);
    element.setPointerCapture(event.pointerId);
    if (pointers.size === 2) {
      const {lengthPx, middlePx} = spread();
      pinch = {lengthPx, atS: underPointer(element, middlePx, axis).atS, span: zoom.span};
      action = 'pinch';
      zoom.brush(null);
      return;
    }
    downPx = event.clientX;
    downS = atS;
    hasMoved = false;
    const isMove = event.pointerType !== 'mouse' || event.shiftKey || event.button === 1;
    action = isMove ? 'move' : 'brush';
    if (event.button === 1) event.preventDefault();
  });
  const onMove = withAxis<PointerEvent>((event, axis, atS, zoom, perPx) => {
    if (zoom === null || !pointers.has(event.pointerId)) {
      if (event.pointerType === 'mouse') axis.hover(atS);
      return;
    }
    pointers.set(event.pointerId, event.clientX);
    hasMoved ||= Math.abs(event.clientX - downPx) > kClickPx;
    if (action === 'pinch') {
      const {lengthPx} = spread();
      zoom.setSpan(zoomed(pinch.span, pinch.lengthPx / lengthPx, pinch.atS, zoom.whole));
    } else if (action === 'brush' && hasMoved) {
      axis.hover(atS);
      zoom.brush(spanOf(downS, atS));
    } else if (action === 'move' && hasMoved) {
      const byS = (downPx - event.clientX) * perPx;
      downPx = event.clientX;
      zoom.setSpan(moved(zoom.span, byS / lengthOf(zoom.span), zoom.whole));
    }
  });
  const onUp = withAxis<PointerEvent>((event, _, atS, zoom) => {
    if (!pointers.delete(event.pointerId) || zoom === null) return;
    const isEnd = event.type === 'pointerup';
    if (isEnd && action === 'brush' && hasMoved) zoom.setSpan(spanOf(downS, atS));
    else if (isEnd && action !== 'pinch' && !hasMoved) zoom.pin(atS);
    zoom.brush(null);
    if (pointers.size === 0) action = 'none';
  });
  const onLeave = withAxis<PointerEvent>((event, axis) => {
    if (pointers.size === 0 && event.pointerType === 'mouse') axis.hover(null);
  });
  const onWheel = withAxis<WheelEvent>((event, _, atS, zoom) => {
    if (zoom === null) return;
    event.preventDefault();
    const unit = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1;
    const isSideways = event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY);
    if (isSideways) {
      const by = (Math.abs(event.deltaX) > 0 ? event.deltaX : event.deltaY) * unit;
      zoom.setSpan(moved(zoom.span, by / 1000, zoom.whole));
    } else {
      const factor = kWheelZoom ** (event.deltaY * unit);
      zoom.setSpan(zoomed(zoom.span, factor, atS, zoom.whole));
    }
  });
  const onDouble = () => axisOf()?.zoom?.reset();

  const ending = new AbortController();
  const {signal} = ending;
  element.addEventListener('pointerdown', onDown, {signal});
  element.addEventListener('pointermove', onMove, {signal});
  element.addEventListener('pointerup', onUp, {signal});
  element.addEventListener('pointercancel', onUp, {signal});
  element.addEventListener('pointerleave', onLeave, {signal});
  element.addEventListener('wheel', onWheel, {passive: false, signal});
  element.addEventListener('dblclick', onDouble, {signal});
  return () => ending.abort();
}

/** The keys of a time axis; returns whether the key is one. */
export function takeKey(event: KeyboardEvent, zoom: Zoom): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  const {span, whole, setSpan} = zoom;
  const pinnedS = zoom.pinnedS ?? NaN;
  const atS = pinnedS >= span.fromS && pinnedS <= span.toS ? pinnedS : timeAt(span, 0.5);
  const move = (share: number) => setSpan(moved(span, share, whole));
  const pin = (toS: number) => {
    const at = Math.min(Math.max(toS, whole.fromS), whole.toS);
    zoom.pin(at);
    if (at < span.fromS) move(-0.5);
    if (at > span.toS) move(0.5);
  };
  const step = (sign: number) =>
    event.shiftKey ? move(sign * kKeyMove) : pin(atS + sign * kKeyStep * lengthOf(span));
  const scale = (factor: number) => setSpan(zoomed(span, factor, atS, whole));
  const goTo = (toS: number) => {
    pin(toS);
    setSpan(centred(span, toS, whole));
  };
  const actions: Readonly<Record<string, () => void>> = {
    ArrowLeft: () => step(-1),
    ArrowRight: () => step(1),
    '+': () => scale(1 / kKeyZoom),
    '=': () => scale(1 / kKeyZoom),
    ArrowUp: () => scale(1 / kKeyZoom),
    '-': () => scale(kKeyZoom),
    ArrowDown: () => scale(kKeyZoom),
    PageUp: () => move(-0.9),
    PageDown: () => move(0.9),
    // A live axis has no beginning.
    Home: () => (Number.isFinite(whole.fromS) ? goTo(whole.fromS) : undefined),
    End: () => goTo(whole.toS),
    '0': zoom.reset,
    Escape: zoom.reset,
  };
  const act = actions[event.key];
  act?.();
  return act !== undefined;
}
