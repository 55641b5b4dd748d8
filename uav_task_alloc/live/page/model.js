// SPDX-License-Identifier: Apache-2.0
// The data of the page, prepared for display: no DOM, no network.
import {degreesText, frameOf} from './geo.js';

const SILENT_AFTER = 2;   // [s] of real time without a state of a UAV, as in record/run_state.py
const AT_REST = ['STANDBY', 'HOLD'];  // modes of a UAV that may fall silent when the run is over
export const LEFT = ['UNASSIGNED', 'REJECTED', 'FAILED'];

// the present; `closed`: the server has ended in order
export const live = {clock: {}, parts: {}, events: [], plans: [], closed: false};

// times: `wall` is in unix seconds, of /clock where the server lives by it; the page shows mission
// time: `speedup` of its seconds in one of `wall`, `rate` in one of real time

export function span(seconds) {
  const s = Math.max(0, Math.round(seconds)), two = n => String(n).padStart(2, '0');
  const hours = Math.floor(s / 3600), minutes = Math.floor(s / 60) % 60;
  return hours ? `${hours}:${two(minutes)}:${two(s % 60)}` : `${minutes}:${two(s % 60)}`;
}

export const seconds = wall => (wall - live.clock.start) * live.clock.speedup;
export const stamp = wall => span(seconds(wall));
export const mission = wallSeconds => wallSeconds * live.clock.speedup;
export const ofDay = (wall, zone = {}) => new Date(wall * 1000).toLocaleTimeString('en-GB', zone);

export function some(names, most, comma = ', ') {
  const more = names.length - most;
  return names.slice(0, most).join(comma) + (more > 0 ? ` and ${more} more` : '');
}

// All that the page shows, at the moment `past` {wall, parts} or at present. Ids come from the
// network: they are keys of Maps, never of objects, which have keys of their own.
export function readModel(past) {
  const {parts} = past || live, wall = past ? past.wall : live.clock.wall;
  const map = name => new Map(Object.entries(parts[name] || {}));
  const model = {wall, where: map('tasks'), statuses: map('statuses'), zones: parts.zones || [],
    area: parts.fence_area || [],
    lists: new Map(), waits: new Map(), turns: new Map(), times: map('times'), works: map('works'), origin: parts.origin || null,
    frame: parts.origin ? frameOf(parts.origin) : null, over: !past && Boolean(live.clock.ended)};
  const states = map('uavs'), authorities = map('authority');
  const lists = Object.keys(parts).filter(name => name.startsWith('list '));
  const names = [...new Set([...states.keys(), ...lists.map(name => name.slice(5))])]
    .sort((a, b) => a.localeCompare(b, 'en', {numeric: true}));
  names.forEach((uav, index) => {
    const tasks = parts['list ' + uav]?.tasks || [];
    model.lists.set(uav, tasks);
    model.waits.set(uav, parts['list ' + uav]?.waits || []);
    tasks.forEach(({id, at}, k) => {
      const turn = {uav, index, place: k + 1, at}, whole = id.replace(/#\d+$/, '');
      model.turns.set(id, turn);
      const known = model.turns.get(whole);  // of work: its next piece
      if (whole !== id && !(known?.place <= turn.place)) model.turns.set(whole, turn);
    });
  });
  model.ids = [...new Set([...model.where.keys(), ...model.statuses.keys()])];
  model.uavs = names.map((id, index) => {
    const uav = {id, index, ...describe(states.get(id), model),
      ...authorityOf(authorities.get(id), wall)};
    if (model.waits.get(id)?.length && !uav.silent) uav.words += ', waits for tasks';
    uav.trouble = uav.lost || Boolean(uav.health) || uav.mode === 'FAULT' || uav.taken;
    return uav;
  });
  const {orders = [], proposal = null} = parts.orders || {};
  const {nodes = {silent: null, bridges: {}, warnings: []}} = parts;
  Object.assign(model, {orders, proposal, nodes});
  model.plans = live.plans.filter(plan => plan.wall <= wall);
  model.replans = model.plans.filter(plan => plan.first || plan.changes.length);
  model.events = live.events.filter(event => event.wall <= wall);
  return model;
}

function describe(state, {wall, over, frame}) {
  const none = 'no state received';
  if (!state) return {position: [null, null], words: none, link: none, silent: true, figures: []};
  const age = wall - state.wall, silent = age * live.clock.speedup > SILENT_AFTER * live.clock.rate;
  const lost = silent && !(over && AT_REST.includes(state.mode));
  const mode = state.mode.toLowerCase().replace('_', ' '), figures = figuresOf(state);
  const words = (silent ? `last ${mode}` : mode) + (state.available ? '' : ', not available');
  const link = silent ? `silent for ${span(mission(age))}` : state.health || 'link good';
  return {...state, silent, lost, words, link, figures,
    note: lost ? `silent ${span(mission(age))}` : figures.length ? figures[0].value : '',
    place: placeText(state.position, frame)};
}

// [{name, value, why, low}] of height, speed, battery and range, as far as they are known.
function figuresOf(state) {
  const {home, speed, course, battery, low, range} = state, up = state.position[2], figures = [];
  const add = (name, value, why, low = false) => figures.push({name, value, why, low});
  if (up !== null) {
    add('height', `${Math.round(up - (home ?? 0))} m`,
      home == null ? 'above the origin' : 'above the home of the UAV');
  }
  if (speed != null) {
    add('speed', `${speed.toFixed(1)} m/s`, course == null ? 'over ground'
      : `over ground, course ${String(course).padStart(3, '0')}°`);
  }
  const reach = range == null ? '' : `${(range / 1000).toFixed(1)} km`;
  if (battery != null) {
    add('battery', [`${Math.round(100 * battery)} %`, low && 'low', reach].filter(Boolean)
      .join(', '), `charge left${reach && `; it can still fly ${reach}`}`, low);
  } else if (reach) {
    add('range', reach, 'that it can still fly');
  }
  return figures;
}

// Degrees, where the origin is known, and the height.
export function placeText(position, frame) {
  if (!frame || position.some(v => v === null)) return '';
  return `${degreesText(frame, position, 6)}, ${Math.round(frame.degrees(position)[2])} m AMSL`;
}

// Authority over a UAV: since when, why, what gives it back; why it is not available.
// `taken`: another has the aircraft.
function authorityOf(authority, wall) {
  const {state, why, since, back, reason} = authority || {}, texts = [];
  if (state && state !== 'UNKNOWN') {
    texts.push(`Authority ${state}`
      + (since == null ? '' : ` since ${ofDay(since)} (${span(mission(wall - since))})`)
      + (why ? `: ${why}` : '') + '.' + (back ? ` Given back by ${back}.` : ''));
  }
  if (reason && !(why && reason.includes(why))) texts.push(`Not available: ${reason}.`);
  return {authority: texts.join(' '), taken: state === 'LOST', calm: !reason && state !== 'LOST'};
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
export const until = (wall, model) => mission(wall - model.wall);

// Which UAV flies a task, or why none does: {text, bad}.
export function answer(id, model) {
  const [state, uav, reason] = stateOf(id, model), turn = model.turns.get(id);
  const work = model.works.get(id);
  if (work?.pieces && (turn || state === 'COMPLETED')) return {text: workText(id, work, model)};
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

// Of work that is flown in pieces: how much is done, and who flies the rest.
function workText(id, {done, pieces}, model) {
  const flown = `${done} of ${pieces} pieces of ${id} are flown`;
  const listed = [...model.lists].map(([uav, list]) =>
    [uav, list.filter(task => task.id.startsWith(`${id}#`)).length]).filter(([, count]) => count);
  const uavs = listed.map(([uav]) => uav), count = listed.reduce((sum, row) => sum + row[1], 0);
  const names = uavs.length === 2 ? uavs.join(' and ') : some(uavs, 8);
  const open = pieces - done - count;
  const rest = open > 0 ? `${count} more; no UAV has the other ${open}` : 'the rest';
  return uavs.length ? `${flown}; ${names} ${uavs.length > 1 ? 'fly' : 'flies'} ${rest}.`
    : `${flown}.`;
}

function turnText(id, {uav, place, at}, model) {
  const left = at === null ? null : until(at, model);
  // changes only every 10 s: screen readers announce it
  const when = left === null ? '' : left <= 0 ? '; it should be there by now'
    : `; it gets there in about ${span(10 * Math.ceil(left / 10))} min`;
  if (place === 1) return `${uav} flies ${id} next${when}.`;
  const ahead = model.lists.get(uav).slice(0, place - 1).map(task => task.id);
  return `${uav} flies ${id} as number ${place} of its list, after ${some(ahead, 8)}${when}.`;
}
