// SPDX-License-Identifier: Apache-2.0
// The chart of the solver: time and fit of each plan over mission time, as SVG.
import {roundStep} from './geo.js';

export const SVG = 'http://www.w3.org/2000/svg';
const LEFT = 46, RIGHT = 8, TOP = 8, ROW = 56, GAP = 14;  // [px]
const MOST_DOTS = 200;

export function add(parent, tag, values, text) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(values)) node.setAttribute(name, value);
  if (text !== undefined) node.textContent = text;
  parent.append(node);
  return node;
}

// A row of the chart from `top`; step: drawn as stairs, as it holds until the next plan.
function drawRow(svg, rows, {top, name, kind, step, x}) {
  const most = Math.max(...rows.map(row => row.y), 1e-9), y = v => top + ROW * (1 - v / most);
  const half = roundStep(most);
  for (const value of [0, half]) {
    add(svg, 'line', {class: 'axis', x1: LEFT, x2: x.end, y1: y(value), y2: y(value)});
    add(svg, 'text', {x: LEFT - 4, y: y(value) + 4, 'text-anchor': 'end'}, value);
  }
  add(svg, 'text', {x: 0, y: top + ROW / 2 - 8}, name);
  const points = rows.flatMap((row, k) => [
    ...(step && k ? [[x.at(row.x), y(rows[k - 1].y)]] : []), [x.at(row.x), y(row.y)]]);
  add(svg, 'polyline', {class: kind, points: points.map(p => p.map(v => v.toFixed(1))).join(' ')});
  for (const row of rows.slice(-MOST_DOTS)) {
    const dot = add(svg, 'circle', {class: kind, r: 3, cx: x.at(row.x), cy: y(row.y)});
    add(dot, 'title', {}, row.text);
  }
}

// plans: with `fit`; seconds(wall): mission time [s].
export function drawChart(node, plans, seconds) {
  const svg = document.createElementNS(SVG, 'svg'), width = node.clientWidth || 300;
  node.replaceChildren(svg);
  if (!plans.length) return;
  const times = plans.map(plan => seconds(plan.wall)), first = Math.min(0, ...times);
  const end = width - RIGHT, last = Math.max(...times, first + 1);
  const x = {end, at: t => LEFT + (end - LEFT) * (t - first) / (last - first)};
  const words = ({revision, trigger, ms, fit}) =>
    `plan ${revision}: ${trigger}: ${ms} ms, fit ${fit.toPrecision(4)}`;
  const rows = value => plans.map((plan, k) => ({x: times[k], y: value(plan), text: words(plan)}));
  drawRow(svg, rows(plan => plan.ms), {top: TOP, name: 'ms', kind: 'ms', x});
  drawRow(svg, rows(plan => plan.fit),
    {top: TOP + ROW + GAP, name: 'fit', kind: 'fit', step: true, x});
  const foot = TOP + 2 * ROW + GAP + 13, step = roundStep((last - first) / 2);
  for (let t = Math.ceil(first / step) * step; t <= last; t += step) {
    add(svg, 'text', {x: x.at(t), y: foot, 'text-anchor': 'middle'}, `${t} s`);
  }
}
