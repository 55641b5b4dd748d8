// SPDX-License-Identifier: Apache-2.0
// The text panels: answer, re-plans, tasks left out, events. Texts from the network are set
// as textContent, never as HTML.
import {LEFT, answer, live, ofDay, placeText, some, span, stamp, stateOf, until} from './model.js';

const MOST = 100;  // rows of one list
const ROW = 12;    // tasks of one reason that are always shown
const opened = new Set();  // reasons of which all tasks are shown
const WAITS = 'waits for the next plan';
const KINDS = {fault: 'bad', zone: 'bad', good: 'good'};

export const $ = id => document.getElementById(id);

export function put(node, text, kind) {
  if (node.textContent !== text) node.textContent = text;
  if (kind !== undefined && node.className !== kind) node.className = kind;
  return node;
}

export function make(tag, text = '', kind = '') {
  return put(document.createElement(tag), text, kind);
}

const nameOf = node => node.dataset.name ?? node.textContent;

// Replace the children of a node only where its key differs from that of the last call. The focus
// stays where it was, or at a button of the same text, or a summary of the same name.
export function fill(node, key, nodes) {
  if (node.dataset.key === key) return;
  node.dataset.key = key;
  const active = node.contains(document.activeElement) ? document.activeElement : null;
  node.replaceChildren(...nodes());
  if (!active) return;
  const same = node.contains(active) ? active : [...node.querySelectorAll('button, summary')]
    .find(other => nameOf(other) === nameOf(active));
  same?.focus({preventScroll: true});
}

export function pick(id) {
  $('find').value = id;
  $('find').dispatchEvent(new Event('input'));
}

export function taskButton(id) {
  const button = make('button', id, 'task');
  button.type = 'button';
  button.onclick = () => pick(id);
  return button;
}

const many = (count, word) => `${count} ${word}${count === 1 ? '' : 's'}`;

// In lists are the pieces of a task, not the task.
function leftToFly(model, done) {
  const left = [...model.lists.values()].flat().length;
  return left > model.ids.length - done ? `${many(left, 'piece')} to fly` : `${left} to fly`;
}

export function showHead(model, past) {
  const done = model.ids.filter(id => stateOf(id, model)[0] === 'COMPLETED').length;
  const silent = model.uavs.filter(uav => uav.lost).length, {clock} = live;
  const replans = model.replans.filter(plan => !plan.first).length;
  put($('clock'), `${model.ids.length ? stamp(model.wall) : '–'} (${
    ofDay(model.wall, {timeStyle: 'long'})})`);
  $('progress').max = model.ids.length || 1;
  $('progress').value = done;
  put($('counts'), model.uavs.length + model.ids.length === 0 ? 'waiting for UAVs and tasks'
    : `${done} of ${many(model.ids.length, 'task')} done, ${leftToFly(model, done)}; `
    + `${many(model.uavs.length, 'UAV')}${silent ? `, ${silent} silent` : ''}; `
    + `${many(model.zones.length, 'zone')}; ${many(replans, 're-plan')}`);
  const rate = Number(clock.rate.toPrecision(3));
  put($('rate'), rate === 1 ? '' : `at ${rate} × real time`);
  showAlarm(model.uavs.filter(uav => uav.trouble));
  Object.assign($('scrub'), {min: clock.begin, max: clock.wall});
  if (!past) $('scrub').value = clock.wall;
  put($('moment'), past ? `${stamp(past.wall)}, ${span(until(clock.wall, model))} ago`
    : live.closed ? 'last received' : clock.live ? 'now' : 'end of the record');
  const end = live.closed || !clock.live;
  put($('live'), (past ? '↦ To ' : end ? '■ ' : '● ') + (end ? 'the end' : 'live'));
  $('live').setAttribute('aria-pressed', String(!past));
  document.body.classList.toggle('past', !!past);
}

// UAVs with a problem; without times, as screen readers announce each change.
function showAlarm(uavs) {
  const why = uav => (uav.lost ? 'silent' : uav.taken ? 'authority LOST'
    : uav.mode === 'FAULT' ? 'fault' : uav.health);
  $('alarm').hidden = !uavs.length;
  $('alarm').dataset.uav = uavs[0]?.id ?? '';
  put($('alarm'), `▲ ${some(uavs.map(uav => `${uav.id}: ${why(uav)}`), 3)}`);
}

// What is wrong with nodes, links and other parts.
export function showNodes({nodes: {silent, bridges, warnings}}) {
  const since = wall => `has not reported since ${stamp(wall)} (${ofDay(wall)})`;
  const texts = Object.entries(bridges).map(([name, wall]) => `${name} ${since(wall)}: its UAVs `
    + 'fly the missions that they have, get no new list and are not seen. Start it again.');
  if (silent !== null) {
    texts.unshift(`The allocator ${since(silent)}: nothing is planned or counted as done, new `
      + 'zones are not avoided, and UAVs go on with the lists that they have. Start it again.');
  }
  texts.push(...warnings);
  $('nodes').hidden = !texts.length;
  fill($('nodes'), JSON.stringify(texts), () =>
    texts.slice(0, MOST).map(text => make('li', `▲ ${text}`)));
}

// Returns the id of the task searched for, '' where there is none.
export function showAnswer(model) {
  const typed = $('find').value.trim();
  put($('where'), '');
  const show = (text, bad) => put($('answer'), text, bad ? 'bad' : '');
  if (!typed) return show('Type the name of a task, or click one on the map or in a list.'), '';
  const known = model.where.has(typed) || model.statuses.has(typed);
  const near = known ? [typed]
    : model.ids.filter(id => id.toLowerCase().includes(typed.toLowerCase()));
  if (near.length !== 1) {
    show(near.length ? `Which one: ${some(near, 8)}?` : `There is no task ${typed}.`);
    return '';
  }
  const {text, bad} = answer(near[0], model), place = model.where.get(near[0]);
  show(text, bad);
  put($('where'), place && model.frame ? `It is at ${placeText(place, model.frame)}.` : '');
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
  rows.append(...plan.first
    ? [make('li', 'The first plan received; there is none to compare it with.', 'faint')]
    : plan.changes.map(row => changeNode(row, model)));
  return [head, rows];
}

// A plan that changed nothing for any UAV is no re-plan: it is counted, and drawn in the chart.
export function showPlans(model) {
  const {replans} = model, last = replans.at(-1), newest = model.plans.at(-1);
  if (!last) {
    return fill($('replan'), 'none', () => [make('p', newest ? 'None has changed anything yet.'
      : 'No plan yet.', 'none')]);
  }
  const since = model.plans.length - model.plans.lastIndexOf(last) - 1;
  const states = last.changes.flatMap(row => row.removed.map(([task]) => stateOf(task, model)[0]));
  fill($('replan'), `${last.revision} ${last.wall} ${since} ${states}`, () => [...planNodes(last, model),
    ...(since ? [make('p', `Since then ${since} ${since > 1 ? 'plans' : 'plan'} changed nothing, `
      + `the last at ${stamp(newest.wall)}.`, 'faint')] : [])]);
  fill($('replans'), `${replans.length} ${last.wall}`, () =>
    replans.slice(-21, -1).reverse().map(plan => {
      const item = make('li'), uavs = plan.changes.map(row => row.uav);
      item.append(make('time', stamp(plan.wall)), ` plan ${plan.revision}: ${plan.trigger}: `
        + (plan.first ? 'the first plan received' : `changed ${some(uavs, 4)}`));
      return item;
    }));
}

// lists

const buttons = ids => ids.flatMap((id, k) => [k ? ', ' : '', taskButton(id)]);

// The other tasks of a reason, made once it is opened; it stays open where they change.
function moreNode(why, ids) {
  const node = make('details'), summary = make('summary', `${ids.length} more`);
  summary.dataset.name = `more ${why}`;
  node.append(summary);
  node.open = opened.has(why);
  if (node.open) node.append(...buttons(ids));
  node.ontoggle = () => {
    opened[node.open ? 'add' : 'delete'](why);
    if (node.open && node.children.length === 1) node.append(...buttons(ids));
  };
  return node;
}

export function showLeft(model) {
  const groups = new Map();
  for (const id of model.ids) {
    const [state, , reason] = stateOf(id, model), waits = state === 'PENDING';
    if (model.turns.has(id) || !(waits || LEFT.includes(state))) continue;
    const why = reason || (waits ? WAITS : state.toLowerCase());
    groups.set(why, [...(groups.get(why) || []), id]);
  }
  put($('left-count'), String([...groups.values()].reduce((sum, ids) => sum + ids.length, 0)));
  fill($('left'), JSON.stringify([model.ids.length > 0, ...groups]), () => groups.size
    ? [...groups].map(([why, ids]) => {
      const item = make('li');
      item.append(...buttons(ids.slice(0, ROW)), ids.length > ROW ? ' and more: ' : ': ',
        make('span', why, why === WAITS ? 'faint' : 'bad'));
      if (ids.length > ROW) item.append(moreNode(why, ids.slice(ROW)));
      return item;
    }) : [make('li', model.ids.length ? 'Every task has a UAV.' : 'No task yet.', 'none')]);
}

// Orders in force, and the plan that waits for an operator. The page only shows them.
export function showOrders({orders, proposal}) {
  put($('order-count'), `${orders.length || 'none'} in force`);
  $('asks').hidden = !proposal;
  put($('asks'), proposal
    ? `Plan ${proposal.revision} waits for approval until ${stamp(proposal.deadline)}` : '');
  fill($('proposal'), JSON.stringify(proposal), () => {
    if (!proposal) return [];
    const {revision, trigger, deadline, accepted, changes} = proposal;
    const rows = make('ul', '', 'changes');
    rows.append(...changes.slice(0, MOST).map(text => make('li', text)));
    const head = make('p');
    head.append(make('b', `Plan ${revision} waits for approval`), ` (${trigger}), until `
      + `${stamp(deadline)}: it is ${accepted ? 'accepted' : 'rejected'} then. `
      + `uav_task_alloc order accept ${revision} decides before.`);
    return [head, rows];
  });
  fill($('orders'), JSON.stringify(orders), () => orders.slice(0, MOST).map(([id, text]) => {
    const item = make('li');
    item.append(make('b', id), ` ${text}`);
    return item;
  }));
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
