// SPDX-License-Identifier: Apache-2.0
// The data of the page, prepared for display: no DOM, no network.
const SILENT_AFTER = 2;  // [s] without a state of a UAV, as in record/progress.py
export const LEFT = ['UNASSIGNED', 'REJECTED', 'FAILED'];

export const live = {clock: {}, parts: {}, events: [], plans: []};  // the present

// times: `wall` is in unix seconds, the page shows scenario time

export function span(seconds) {
  const s = Math.max(0, Math.round(seconds)), two = n => String(n).padStart(2, '0');
  const hours = Math.floor(s / 3600), minutes = Math.floor(s / 60) % 60;
  return hours ? `${hours}:${two(minutes)}:${two(s % 60)}` : `${minutes}:${two(s % 60)}`;
}

export const seconds = wall => (wall - live.clock.start) * live.clock.speedup;
export const stamp = wall => span(seconds(wall));
export const ofDay = wall => new Date(wall * 1000).toLocaleTimeString('en-GB');

export function some(names, most) {
  const more = names.length - most;
  return names.slice(0, most).join(', ') + (more > 0 ? ` and ${more} more` : '');
}

// All that the page shows, at the moment `past` {wall, parts} or at present. Ids come from the
// network: they are keys of Maps, never of objects, which have keys of their own.
export function readModel(past) {
  const {parts} = past || live, wall = past ? past.wall : live.clock.wall;
  const map = name => new Map(Object.entries(parts[name] || {}));
  const model = {wall, where: map('tasks'), statuses: map('statuses'), zones: parts.zones || [],
    lists: new Map(), turns: new Map()};
  const states = map('uavs'), authorities = map('authority');
  const lists = Object.keys(parts).filter(name => name.startsWith('list '));
  const names = [...new Set([...states.keys(), ...lists.map(name => name.slice(5))])]
    .sort((a, b) => a.localeCompare(b, 'en', {numeric: true}));
  names.forEach((uav, index) => {
    const tasks = parts['list ' + uav]?.tasks || [];
    model.lists.set(uav, tasks);
    tasks.forEach(({id, at}, k) => model.turns.set(id, {uav, index, place: k + 1, at}));
  });
  model.ids = [...new Set([...model.where.keys(), ...model.statuses.keys()])];
  model.uavs = names.map((id, index) => ({id, index, ...describe(states.get(id), wall),
    authority: authorityText(authorities.get(id), wall)}));
  model.plans = live.plans.filter(plan => plan.wall <= wall);
  model.events = live.events.filter(event => event.wall <= wall);
  return model;
}

function describe(state, wall) {
  if (!state) return {position: [null, null], words: 'no state received', link: 'no state received', silent: true};
  const age = wall - state.wall, silent = age > SILENT_AFTER;
  const mode = state.mode.toLowerCase().replace('_', ' ');
  return {...state, silent,
    words: (silent ? `last model ${mode}` : mode) + (state.available ? '' : ', not available'),
    link: silent ? `silent for ${span(age)}` : state.health || 'link good'};
}

// Authority over a UAV: since when, why, what gives it back; why it is not available.
function authorityText(authority, wall) {
  const {state, why, since, back, reason} = authority || {}, texts = [];
  if (state && state !== 'UNKNOWN') {
    texts.push(`Authority ${state}`
      + (since == null ? '' : ` since ${ofDay(since)} (${span(wall - since)})`)
      + (why ? `: ${why}` : '') + '.' + (back ? ` Given back by ${back}.` : ''));
  }
  if (reason && !(why && reason.includes(why))) texts.push(`Not available: ${reason}.`);
  return texts.join(' ');
}

// [state, UAV, reason] of a task
export const stateOf = (id, model) => model.statuses.get(id) || ['PENDING', '', ''];

export function kindOf(id, model) {
  if (model.turns.has(id)) return 'fly';
  const [state] = stateOf(id, model);
  if (state === 'COMPLETED') return 'done';
  if (state === 'CANCELLED') return 'cancelled';
  return LEFT.includes(state) ? 'left' : 'wait';
}

// [s] of the scenario from the moment shown until `wall`
export const until = (wall, model) => (wall - model.wall) * live.clock.speedup;

// Which UAV flies a task, or why none does: {text, bad}.
export function answer(id, model) {
  const [state, uav, reason] = stateOf(id, model), turn = model.turns.get(id);
  if (turn) return {text: turnText(id, turn, model)};
  if (state === 'COMPLETED') return {text: `${id} is done: ${uav || 'a UAV'} completed it.`};
  if (state === 'CANCELLED') return {text: `${id} was withdrawn. No UAV flies it.`};
  if (LEFT.includes(state) || reason) {
    const what = {FAILED: 'it failed', REJECTED: 'it was refused'}[state] || 'it is left out';
    const why = reason || 'no reason given';
    return {text: `No UAV flies ${id}: ${what}. Why: ${why}.`, bad: true};
  }
  if (state === 'PENDING') return {text: `${id} waits for the next plan.`};
  return {text: `${id} is given to ${uav}, whose list has not arrived yet.`};
}

function turnText(id, {uav, place, at}, model) {
  const left = at === null ? null : until(at, model);
  const when = left === null ? '' : left <= 0 ? '; it should be there by now'
    : `; it gets there in about ${span(10 * Math.ceil(left / 10))} min`;  // changes only every 10 s: screen readers announce it
  if (place === 1) return `${uav} flies ${id} next${when}.`;
  const ahead = model.lists.get(uav).slice(0, place - 1).map(task => task.id);
  return `${uav} flies ${id} as number ${place} of its list, after ${some(ahead, 8)}${when}.`;
}
