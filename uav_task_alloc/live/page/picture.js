// SPDX-License-Identifier: Apache-2.0
// What the page knows, made ready to be shown: no DOM, no network.
const SILENT = 2;  // [s] without a word from a UAV
export const LEFT = ['UNASSIGNED', 'REJECTED', 'FAILED'];

export const live = {clock: {}, parts: {}, events: [], plans: []};  // the newest

// times: `wall` is in unix seconds, what people read is the scenario's

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

// Everything the page shows, of the moment `past` {wall, parts} or of now. Ids come from outside:
// they are keys of Maps, never of objects, which have keys of their own.
export function picture(past) {
  const {parts} = past || live, wall = past ? past.wall : live.clock.wall;
  const map = name => new Map(Object.entries(parts[name] || {}));
  const seen = {wall, where: map('tasks'), statuses: map('statuses'), zones: parts.zones || [],
    lists: new Map(), turns: new Map()};
  const states = map('uavs'), holders = map('authority');
  const lists = Object.keys(parts).filter(name => name.startsWith('list '));
  const names = [...new Set([...states.keys(), ...lists.map(name => name.slice(5))])]
    .sort((a, b) => a.localeCompare(b, 'en', {numeric: true}));
  names.forEach((uav, index) => {
    const tasks = parts['list ' + uav]?.tasks || [];
    seen.lists.set(uav, tasks);
    tasks.forEach(({id, at}, k) => seen.turns.set(id, {uav, index, place: k + 1, at}));
  });
  seen.ids = [...new Set([...seen.where.keys(), ...seen.statuses.keys()])];
  seen.uavs = names.map((id, index) => ({id, index, ...inWords(states.get(id), wall),
    holder: holder(holders.get(id), wall)}));
  seen.plans = live.plans.filter(plan => plan.wall <= wall);
  seen.events = live.events.filter(event => event.wall <= wall);
  return seen;
}

function inWords(state, wall) {
  if (!state) return {position: [null, null], words: 'not heard', link: 'not heard', silent: true};
  const age = wall - state.wall, silent = age > SILENT;
  const mode = state.mode.toLowerCase().replace('_', ' ');
  return {...state, silent,
    words: (silent ? `last seen ${mode}` : mode) + (state.available ? '' : ', not available'),
    link: silent ? `silent for ${span(age)}` : state.health || 'link good'};
}

// Who has a UAV, since when, why, and what gives it back; why it is not available.
function holder(authority, wall) {
  const {state, why, since, back, reason} = authority || {}, said = [];
  if (state && state !== 'UNKNOWN') {
    said.push(`Authority ${state}`
      + (since == null ? '' : ` since ${ofDay(since)} (${span(wall - since)})`)
      + (why ? `: ${why}` : '') + '.' + (back ? ` Given back by ${back}.` : ''));
  }
  if (reason && !(why && reason.includes(why))) said.push(`Not available: ${reason}.`);
  return said.join(' ');
}

// [state, UAV, reason] of a task
export const stateOf = (id, seen) => seen.statuses.get(id) || ['PENDING', '', ''];

export function kindOf(id, seen) {
  if (seen.turns.has(id)) return 'fly';
  const [state] = stateOf(id, seen);
  if (state === 'COMPLETED') return 'done';
  if (state === 'CANCELLED') return 'gone';
  return LEFT.includes(state) ? 'left' : 'wait';
}

// [s] of the scenario from the moment shown until `wall`
export const until = (wall, seen) => (wall - seen.wall) * live.clock.speedup;

// Who flies a task, or why nobody does: {text, bad}.
export function answer(id, seen) {
  const [state, uav, reason] = stateOf(id, seen), turn = seen.turns.get(id);
  if (turn) return {text: inTurn(id, turn, seen)};
  if (state === 'COMPLETED') return {text: `${id} is done: ${uav || 'somebody'} completed it.`};
  if (state === 'CANCELLED') return {text: `${id} was withdrawn. Nobody flies it.`};
  if (LEFT.includes(state) || reason) {
    const what = {FAILED: 'it failed', REJECTED: 'it was refused'}[state] || 'it is left out';
    const why = reason || 'no reason was told';
    return {text: `Nobody flies ${id}: ${what}. Why: ${why}.`, bad: true};
  }
  if (state === 'PENDING') return {text: `${id} waits for the next plan.`};
  return {text: `${id} is given to ${uav}, whose list is not heard yet.`};
}

function inTurn(id, {uav, place, at}, seen) {
  const left = at === null ? null : until(at, seen);
  const when = left === null ? '' : left <= 0 ? '; it should be there by now'
    : `; it gets there in about ${span(10 * Math.ceil(left / 10))} min`;  // calm for the ear
  if (place === 1) return `${uav} flies ${id} next${when}.`;
  const ahead = seen.lists.get(uav).slice(0, place - 1).map(task => task.id);
  return `${uav} flies ${id} as number ${place} of its list, after ${some(ahead, 8)}${when}.`;
}
