import type uPlot from 'uplot';
import type {MarkerList} from '../store/markers';
import {colour} from '../store/theme';

/** Markers and trials of an experiment in charts. */

/** Trials are bands behind the curves; `originS` is where x is 0, on the markers' clock. */
export function drawTrials(chart: uPlot, list: MarkerList | undefined, originS: number): void {
  const {left, top, width, height} = chart.bbox;
  const context = chart.ctx;
  context.save();
  context.fillStyle = colour('accent-soft');
  for (const trial of list?.trials.peek() ?? []) {
    const endS = trial.endNs === null ? Infinity : trial.endNs / 1e9 - originS;
    const from = Math.max(chart.valToPos(trial.beginNs / 1e9 - originS, 'x', true), left);
    const end = endS === Infinity ? Infinity : chart.valToPos(endS, 'x', true);
    const to = Math.min(end, left + width);
    if (from < to) context.fillRect(from, top, to - from, height);
  }
  context.restore();
}

/** Lines at the markers; a label that would cover the one before is left out. */
export function drawMarkers(chart: uPlot, list: MarkerList | undefined, originS: number): void {
  const {left, top, width, height} = chart.bbox;
  const context = chart.ctx;
  const size = 12 * devicePixelRatio;
  const gap = 4 * devicePixelRatio;
  let coveredTo = left;
  context.save();
  context.strokeStyle = context.fillStyle = colour('accent');
  context.lineWidth = devicePixelRatio;
  context.font = `${size}px system-ui, sans-serif`;
  context.textBaseline = 'top';
  for (const marker of list?.rows.peek() ?? []) {
    const x = chart.valToPos(marker.timeNs / 1e9 - originS, 'x', true);
    if (!(x >= left && x <= left + width)) continue;
    context.beginPath();
    context.moveTo(x, top);
    context.lineTo(x, top + height);
    context.stroke();
    const label = marker.label.length > 24 ? `${marker.label.slice(0, 23)}…` : marker.label;
    const textWidth = context.measureText(label).width;
    // Near the right end it is at the left of its line.
    const begin = x + gap + textWidth > left + width ? x - gap - textWidth : x + gap;
    if (begin < coveredTo) continue;
    context.fillText(label, begin, top + gap);
    coveredTo = begin + textWidth + gap;
  }
  context.restore();
}
