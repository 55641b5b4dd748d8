// SPDX-License-Identifier: Apache-2.0
// The text panels: answer, re-plans, tasks left out, UAVs, events. Texts from the network are set
// as textContent, never as HTML.
import {colour} from './map.js';
import {LEFT, answer, live, ofDay, some, span, stamp, stateOf, until} from './model.js';

const MOST = 100;  // rows of one list
const KINDS = {fault: 'bad', zone: 'bad', good: 'good'};
const ON_BOARD = {VERIFIED: 'on board', UPLOADING: 'uploading', MIXED: 'MIXED on board',
  FOREIGN: 'FOREIGN mission on board'};

export const $ = id => document.getElementById(id);

export function put(node, text, kind) {
  if (node.textContent !== text) node.textContent = text;
  if (kind !== undefined && node.className !== kind) node.className = kind;
  return node;
}

export function make(tag, text = '', kind = '') {
  return put(document.createElement(tag), text, kind);
}

// Replace the children of a node only where its key differs from that of the last call.
export function fill(node, key, nodes) {
  if (node.dataset.key === key) return;
  node.dataset.key = key;
  node.replaceChildren(...nodes());
}

export function pick(id) {
  $('find').value = id;
  $('find').dispatchEvent(new Event('input'));
}

function taskButton(id) {
  const button = make('button', id, 'task');
  button.type = 'button';
  button.onclick = () => pick(id);
  return button;
}

export function showHead(model, past) {
  const done = model.ids.filter(id => stateOf(id, model)[0] === 'COMPLETED').length;
  const silent = model.uavs.filter(uav => uav.silent).length, {clock} = live;
  put($('clock'), `${model.ids.length ? stamp(model.wall) : '–'} (${ofDay(model.wall)})`);
  $('progress').max = model.ids.length || 1;
  $('progress').value = done;
  put($('counts'), `${done} of ${model.ids.length} tasks done, ${model.turns.size} to fly; `
    + `${model.uavs.length} UAVs${silent ? `, ${silent} silent` : ''}; ${model.zones.length} zones; `
    + `${model.plans.length} plans`);
  Object.assign($('scrub'), {min: clock.begin, max: clock.wall});
  if (!past) $('scrub').value = clock.wall;
  put($('moment'), past ? `${stamp(past.wall)}, ${span(until(clock.wall, model))} ago`
    : clock.live ? 'now' : 'end of the record');
  put($('live'), (past ? '↦ To ' : '● ') + (clock.live ? 'live' : 'the end'));
  $('live').setAttribute('aria-pressed', String(!past));
  document.body.classList.toggle('past', !!past);
}

// Returns the id of the task searched for, '' where there is none.
export function showAnswer(model) {
  const typed = $('find').value.trim();
  const show = (text, bad) => put($('answer'), text, bad ? 'bad' : '');
  if (!typed) return show('Type the name of a task, or click one on the map or in a list.'), '';
  const known = model.where.has(typed) || model.statuses.has(typed);
  const near = known ? [typed]
    : model.ids.filter(id => id.toLowerCase().includes(typed.toLowerCase()));
  if (near.length !== 1) {
    show(near.length ? `Which one: ${some(near, 8)}?` : `There is no task ${typed}.`);
    return '';
  }
  const {text, bad} = answer(near[0], model);
  show(text, bad);
  return near[0];
}

// re-plans

function changeNode(row, model) {
  const entry = (task, sign, kind, words) => {
    const part = make('span', `${sign} `, kind);
    part.append(taskButton(task), ` (${words})`);
    return part;
  };
  const parts = [
    ...row.added.slice(0, MOST).map(([task, from]) =>
      entry(task, '+', 'good', from ? `from ${from}` : 'new in the plan')),
    ...row.removed.slice(0, MOST).map(([task, to]) =>
      entry(task, '−', 'bad', to ? `now ${to}` : stateOf(task, model)[0].toLowerCase())),
    ...(row.reordered ? [make('span', '↻ order changed')] : [])];
  const item = make('li');
  item.append(make('b', row.uav), ...parts.flatMap((part, k) => [k ? ', ' : ': ', part]));
  return item;
}

function planNodes(plan, model) {
  const head = make('p', `Plan ${plan.revision}, ${stamp(plan.wall)}, `
    + `solved in ${Math.round(plan.ms)} ms. `);
  head.append(make('b', 'Because: '), `${plan.trigger}.`);
  const rows = make('ul', '', 'changes');
  if (plan.first) {
    rows.append(make('li', 'The first plan received; there is none to compare it with.', 'faint'));
  } else if (!plan.changes.length) {
    rows.append(make('li', 'Nothing changed for any UAV.', 'faint'));
  } else {
    rows.append(...plan.changes.map(row => changeNode(row, model)));
  }
  return [head, rows];
}

export function showPlans(model) {
  const last = model.plans.at(-1);
  if (!last) return fill($('replan'), 'none', () => [make('p', 'No plan yet.', 'none')]);
  const changed = model.plans.findLast(plan => plan.changes.length && !plan.first);
  fill($('replan'), `${last.revision} ${last.wall}`, () => [...planNodes(last, model),
    ...(changed && changed !== last
      ? [make('h3', 'The last that changed something'), ...planNodes(changed, model)] : [])]);
  fill($('replans'), `${model.plans.length} ${last.wall}`, () =>
    model.plans.slice(-21, -1).reverse().map(plan => {
      const item = make('li'), uavs = plan.changes.map(row => row.uav);
      item.append(make('time', stamp(plan.wall)), ` plan ${plan.revision}: ${plan.trigger}: `
        + (uavs.length ? `changed ${some(uavs, 4)}` : 'nothing changed'));
      return item;
    }));
}

// lists

export function showLeft(model) {
  const groups = new Map();
  for (const id of model.ids) {
    const [state, , reason] = stateOf(id, model), waits = state === 'PENDING';
    if (model.turns.has(id) || !(waits || LEFT.includes(state))) continue;
    const why = reason || (waits ? 'waits for the next plan' : state.toLowerCase());
    groups.set(why, [...(groups.get(why) || []), id]);
  }
  put($('left-count'), String([...groups.values()].reduce((sum, ids) => sum + ids.length, 0)));
  fill($('left'), JSON.stringify([model.ids.length > 0, ...groups]), () => groups.size
    ? [...groups].map(([why, ids]) => {
      const item = make('li');
      item.append(...ids.slice(0, 12).flatMap((id, k) => [k ? ', ' : '', taskButton(id)]),
        ids.length > 12 ? ` and ${ids.length - 12} more: ` : ': ', make('span', why, 'bad'));
      return item;
    }) : [make('li', model.ids.length ? 'Every task has a UAV.' : 'No task yet.', 'none')]);
}

function uavNode(uav, open) {
  const node = make('details'), summary = make('summary'), name = make('b', uav.id);
  name.style.borderColor = colour(uav.index);
  summary.append(name, ...Array.from({length: 4}, () => make('span')));
  node.append(summary, make('p', '', 'authority'), make('ol'));
  node.open = open;
  node.addEventListener('toggle', () => node.dispatchEvent(new Event('input', {bubbles: true})));
  return node;
}

function showUav(node, uav, done, model) {
  const list = model.lists.get(uav.id), board = list.length && ON_BOARD[uav.mission];
  const [, words, link, battery, count] = node.firstChild.children, rows = node.lastChild;
  put(words, uav.words);
  node.classList.toggle('trouble', Boolean(uav.silent || uav.health));  // sorted first
  put(link, uav.link, node.classList.contains('trouble') ? 'bad' : 'good');
  put(battery, [uav.battery == null ? '' : `battery ${Math.round(100 * uav.battery)} %`,
    uav.range == null ? '' : `range ${uav.range} m`].filter(Boolean).join(', '));
  put(count, `${done} done, ${list.length} to fly${board ? `, ${board}` : ''}`);
  if (!node.open) return;
  put(node.children[1], uav.authority);
  fill(rows, JSON.stringify(list.map(task => task.id)), () => list.slice(0, MOST).map(task => {
    const item = make('li');
    item.append(taskButton(task.id), ' ', make('span'));
    return item;
  }));
  [...rows.children].forEach((item, k) => {
    const left = list[k].at === null ? null : until(list[k].at, model);
    put(item.lastChild, left === null ? '' : left <= 0 ? 'due' : `in ${span(left)}`);
  });
}

export function showUavs(model) {
  if (!model.uavs.length) return;
  const done = new Map(), few = model.uavs.length <= 8;
  for (const [state, uav] of model.statuses.values()) {
    if (state === 'COMPLETED') done.set(uav, (done.get(uav) || 0) + 1);
  }
  fill($('uavs'), JSON.stringify(model.uavs.map(uav => uav.id)),
    () => model.uavs.map(uav => uavNode(uav, few)));
  model.uavs.forEach((uav, k) => showUav($('uavs').children[k], uav, done.get(uav.id) || 0, model));
}

export function showEvents(model) {
  const last = model.events.at(-1);
  fill($('events'), last ? `${model.events.length} ${last.wall}` : '', () =>
    model.events.slice(-MOST).reverse().map(event => {
      const item = make('li');
      item.append(make('time', stamp(event.wall)),
        make('span', event.text, KINDS[event.kind] || ''));
      return item;
    }));
}
