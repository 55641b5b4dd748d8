// SPDX-License-Identifier: Apache-2.0
// Services over mission time, a row for each UAV: as planned, as flown, and their windows, as SVG.
import {add, SVG} from './chart.js';
import {roundStep} from './geo.js';

const RIGHT = 8, TOP = 4, ROW = 22, BAR = 12, FOOT = 16;  // [px]
const MOST_ROWS = 40, LEAST = 2;  // UAVs; [px] of a bar
const GAP = 8, MOST_NAMES = 0.35;  // [px] after the names; of the width

// Write the names of the rows, long ones shortened; returns where the bars may begin [px].
function writeNames(svg, names, most) {
  const nodes = names.map((name, k) => add(svg, 'text', {x: 0, y: TOP + ROW * k + BAR}, name));
  nodes.forEach((node, k) => {
    for (let kept = names[k].length - 1; kept > 0 && node.getBBox().width > most; kept--) {
      node.textContent = `${names[k].slice(0, kept)}…`;
    }
    add(node, 'title', {}, names[k]);
  });
  return Math.max(...nodes.map(node => node.getBBox().width)) + GAP;
}

// rows: [{uav, bars: [{task, kind, since, until, words}]}], kind: planned, flown or window; times
// in [s] of the mission; `now`: the moment shown.
export function drawGantt(node, rows, now) {
  const svg = document.createElementNS(SVG, 'svg'), width = node.clientWidth || 300;
  node.replaceChildren(svg);
  const shown = rows.slice(0, MOST_ROWS), bars = shown.flatMap(row => row.bars);
  if (!bars.length) return;
  const first = Math.min(0, ...bars.map(bar => bar.since));
  const last = Math.max(now, first + 1, ...bars.map(bar => bar.until));
  const left = writeNames(svg, shown.map(row => row.uav), MOST_NAMES * width);
  const end = width - RIGHT, height = TOP + ROW * shown.length;
  const x = t => left + (end - left) * (t - first) / (last - first);
  svg.setAttribute('height', height + FOOT);
  shown.forEach((row, k) => {
    const top = TOP + ROW * k;
    for (const {task, kind, since, until, words} of row.bars) {
      const flat = kind === 'window', wide = Math.max(LEAST, x(until) - x(since));
      const bar = add(svg, 'rect', {class: kind, 'data-task': task, x: x(since).toFixed(1),
        y: flat ? top + BAR + 2 : top + (kind === 'flown' ? 3 : 0), width: wide.toFixed(1),
        height: flat ? 3 : kind === 'flown' ? BAR - 6 : BAR});
      add(bar, 'title', {}, words);
    }
  });
  add(svg, 'line', {class: 'now', x1: x(now), x2: x(now), y1: TOP, y2: height});
  const step = roundStep((last - first) / 3);
  for (let t = Math.ceil(first / step) * step; t <= last; t += step) {
    add(svg, 'text', {x: x(t), y: height + FOOT - 4, 'text-anchor': 'middle'}, `${t} s`);
  }
}
