// SPDX-License-Identifier: Apache-2.0
// A card for each UAV: what it does, height, speed, battery, what it flies next.
import {themeColours, uavColour} from './layers.js';
import {span, until} from './model.js';
import {$, fill, make, put, taskButton} from './panels.js';

const NEXT = 3;    // tasks on a card that is closed
const MOST = 100;  // on one that is open
const ON_BOARD = {VERIFIED: 'on board', UPLOADING: 'uploading', MIXED: 'MIXED on board',
  FOREIGN: 'FOREIGN mission on board'};

function card(uav, centre) {
  const node = make('details'), summary = make('summary'), head = make('span', '', 'row');
  head.append(make('b', uav.id), make('span'), make('span', '', 'link'));
  summary.append(head, make('span', '', 'row figures'), make('span', '', 'next'),
    make('span', '', 'authority'));
  const body = make('p'), show = make('button', 'on the map');
  show.type = 'button';
  show.onclick = () => centre(uav.id);
  body.append(make('span'), ' ', show);
  node.append(summary, body, make('ol'));
  node.dataset.uav = uav.id;
  node.addEventListener('toggle', () => node.dispatchEvent(new Event('input', {bubbles: true})));
  return node;
}

function when(task, model, before = '') {
  const left = task.at === null ? null : until(task.at, model);
  return left === null ? '' : left <= 0 ? 'due' : `${before}${span(left)}`;
}

function nextText(uav, list, done, model) {
  if (!list.length) return `${done} done, none to fly`;
  const tasks = list.slice(0, NEXT).map(task => `${task.id} ${when(task, model)}`.trim());
  const more = list.length > NEXT ? `, ${list.length - NEXT} more` : '';
  return `next ${tasks.join(', ')}${more}`;
}

function figureNode({name, value, why, low}) {
  const node = make('span', '', low ? 'bad' : '');
  node.append(make('small', name), ` ${value}`);
  node.title = `${name}: ${why}`;
  return node;
}

function update(node, uav, done, model, colours) {
  const list = model.lists.get(uav.id), [summary, body, rows] = node.children;
  const [head, figures, next, authority] = summary.children, [, words, link] = head.children;
  summary.style.borderColor = uavColour(uav.index, colours);
  node.classList.toggle('trouble', uav.trouble);
  put(words, uav.words);
  put(link, uav.link, 'link ' + (uav.lost || uav.health ? 'bad' : uav.silent ? 'faint' : 'good'));
  fill(figures, JSON.stringify(uav.figures), () => uav.figures.map(figureNode));
  put(next, nextText(uav, list, done, model));
  put(authority, uav.authority, uav.calm ? 'authority calm' : 'authority');
  if (!node.open) return;
  const board = list.length && ON_BOARD[uav.mission];
  const fence = uav.fence && uav.fence !== 'OFF' && `fence ${uav.fence}`;
  put(body.firstChild, [uav.place, `${done} done, ${list.length} to fly`, board, fence]
    .filter(Boolean).join('; ') + '.');
  fill(rows, JSON.stringify(list.map(task => task.id)), () => list.slice(0, MOST).map(task => {
    const item = make('li');
    item.append(taskButton(task.id), ' ', make('span'));
    return item;
  }));
  [...rows.children].forEach((item, k) => put(item.lastChild, when(list[k], model, 'in ')));
}

// Those with problems come first, also for the keyboard. centre(id) shows a UAV in the middle of
// the map.
export function showUavs(model, centre) {
  put($('uav-count'), model.uavs.length ? String(model.uavs.length) : '');
  if (!model.uavs.length) return;
  const done = new Map(), colours = themeColours();
  const add = (uav, count) => done.set(uav, (done.get(uav) || 0) + count);
  for (const [id, [state, uav]] of model.statuses) {
    const by = Object.entries(model.works.get(id)?.by || {});
    if (by.length) by.forEach(row => add(...row));  // pieces, also of work that is not done
    else if (state === 'COMPLETED') add(uav, 1);
  }
  const known = new Map([...$('uavs').children].map(node => [node.dataset.uav, node]));  // open ones
  const uavs = [true, false].flatMap(trouble => model.uavs.filter(uav => uav.trouble === trouble));
  fill($('uavs'), JSON.stringify(uavs.map(uav => uav.id)),
    () => uavs.map(uav => known.get(uav.id) || card(uav, centre)));
  uavs.forEach((uav, k) =>
    update($('uavs').children[k], uav, done.get(uav.id) || 0, model, colours));
}

// Open the card of a UAV and bring it into sight.
export function openCard(id) {
  const node = [...$('uavs').children].find(child => child.dataset.uav === id);
  if (!node) return;
  node.open = true;
  node.scrollIntoView({block: 'nearest'});
  node.firstChild.focus({preventScroll: true});
  for (const other of $('uavs').children) other.classList.toggle('found', other === node);
  setTimeout(() => node.classList.remove('found'), 2000);
}
