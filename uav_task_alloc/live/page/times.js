// SPDX-License-Identifier: Apache-2.0
// When tasks are served, as planned and as flown, and when the fleet is done: no DOM, no network.
import {some, span, stamp, until} from './model.js';

const MOST = 8;  // UAVs in the sentence about their ends

const words = (task, what, [since, end]) =>
  `${task} ${what}: ${stamp(since)} to ${stamp(end)}`;

// [{uav, bars}] in the order of the UAVs; times are of the server's clock.
export function timesOf(model) {
  const rows = new Map(model.uavs.map(({id}) => [id, []]));
  const bar = (uav, task, kind, [since, end], text) => rows.get(uav)?.push(
    {task, kind, since, until: end, words: text});
  const window = (uav, task) => {
    const [since, end] = model.times.get(task)?.window || [];
    if (since == null && end == null) return;
    const open = [since ?? Math.min(model.wall, end), end ?? Math.max(model.wall, since)];
    bar(uav, task, 'window', open, words(task, 'may begin', open));
  };
  for (const [uav, list] of model.lists) {
    for (const {id, service} of list) {
      if (!service) continue;
      bar(uav, id, 'planned', service, words(id, 'planned', service));
      window(uav, id);
    }
  }
  for (const [task, {planned, flown}] of model.times) {
    if (!flown || model.turns.has(task)) continue;
    const [uav, ...times] = flown;
    if (planned) bar(uav, task, 'planned', planned.slice(1), words(task, 'planned', planned.slice(1)));
    bar(uav, task, 'flown', times, words(task, 'flown', times));
    window(uav, task);
  }
  return [...rows].filter(([, bars]) => bars.length).map(([uav, bars]) => ({uav, bars}));
}

// When the fleet and each UAV are done, as planned; when the last task was, where none is left.
export function finishText(model) {
  const ends = [...model.lists].flatMap(([uav, list]) =>
    (list.length && list.at(-1).service ? [[uav, list.at(-1).service[1]]] : []));
  if (!ends.length) {
    const flown = [...model.times.values()].flatMap(row => (row.flown ? [row.flown[2]] : []));
    return flown.length ? `Nothing is left to fly; the last task was done at ${
      stamp(Math.max(...flown))}.` : 'No task is planned.';
  }
  const last = Math.max(...ends.map(([, end]) => end));
  return `The fleet is done at ${stamp(last)}, in ${span(until(last, model))}: `
    + `${some(ends.map(([uav, end]) => `${uav} at ${stamp(end)}`), MOST)}.`;
}
