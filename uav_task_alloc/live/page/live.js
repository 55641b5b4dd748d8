// SPDX-License-Identifier: Apache-2.0
// The live page: applies the updates of the stream, shows the present or a moment of the past.
// It only reads: all requests are GET.
import {drawChart, drawMap} from './map.js';
import {$, fill, make, pick, put, showAnswer, showEvents, showHead, showLeft, showPlans, showUavs}
  from './panels.js';
import {answer, kindOf, live, readModel, seconds, span} from './model.js';

const STALE = 3;     // [s] without an update from the server
const KEPT = 1000;   // entries of each log, as on the server
let past = null;     // {wall, parts}: the moment shown instead of the present
let receivedAt = performance.now();
let requests = 0;    // of moments of the past
let due = 0, cost = 0, charted = '';

function showMap(model, picked) {
  const at = id => model.where.get(id);
  const last = model.plans.findLast(plan => plan.changes.length && !plan.first);
  const given = last ? last.changes.flatMap(row => row.added.map(([task]) => task)) : [];
  const tasks = [...model.where].map(([id, position]) => ({...model.turns.get(id), id, position,
    kind: kindOf(id, model), words: answer(id, model).text}));
  const routes = model.uavs.filter(uav => model.lists.get(uav.id).length).map(uav => ({
    index: uav.index, points: [uav.position, ...model.lists.get(uav.id).flatMap(
      task => [...task.via, at(task.id)])].filter(point => point && point[0] !== null)}));
  drawMap($('map'), {zones: model.zones, routes, tasks, uavs: model.uavs,
    changed: given.filter(id => at(id) && model.turns.has(id)).map(at),
    pickedIndex: model.turns.get(picked)?.index, picked: at(picked) ? [at(picked)] : []}, pick);
}

function showChart(model) {
  const key = `${model.plans.length} ${model.plans.at(-1)?.wall} ${live.clock.start} ${theme()}`;
  if (key === charted) return;
  charted = key;
  drawChart($('chart'), model.plans.filter(plan => plan.fit !== null), seconds);
}

function show() {
  const begun = performance.now(), model = readModel(past);
  due = 0;
  showHead(model, past);
  const picked = showAnswer(model);
  for (const panel of [showPlans, showLeft, showUavs, showEvents, showChart]) panel(model);
  showMap(model, picked);
  cost = performance.now() - begun;
  document.body.dataset.cost = cost.toFixed(0);  // [ms]
}

// Drawing takes at most a third of the time, so that the page stays usable with a big fleet.
function draw() {
  if (!due && live.clock.wall !== undefined) due = setTimeout(show, 2 * cost);
}

function apply(update) {
  receivedAt = performance.now();
  if (update.all) Object.assign(live, {parts: {}, events: [], plans: []});
  live.clock = update.clock;
  Object.assign(live.parts, update.parts);
  for (const log of ['events', 'plans']) live[log] = [...live[log], ...update[log]].slice(-KEPT);
  if (update.parts.tasks) {
    const names = Object.keys(update.parts.tasks);
    fill($('names'), String(names.length), () => names.slice(0, KEPT).map(
      name => Object.assign(make('option'), {value: name})));
  }
  if (past) showHead(readModel(past), past);
  else draw();
}

function connect() {
  const source = new EventSource('stream');  // reconnects automatically unless it was refused
  source.onmessage = message => apply(JSON.parse(message.data));
  source.onerror = () => {
    if (source.readyState === EventSource.CLOSED) setTimeout(connect, 2000);
  };
}

setInterval(() => {
  const age = (performance.now() - receivedAt) / 1000;
  $('banner').hidden = age <= STALE;
  if (age > STALE) put($('banner'), `No data from live_view for ${span(age)} min. `
    + 'What you see is old. Trying again…');
}, 500);

async function goTo(wall) {
  const mine = ++requests, response = await fetch(`at?wall=${wall}`).catch(() => null);
  const then = response && response.ok ? await response.json() : null;
  if (!then || mine !== requests) return;
  past = {wall, parts: then.parts};
  draw();
}

function goLive() {
  requests++;
  past = null;
  draw();
}

function theme(name) {
  if (name) {
    document.documentElement.dataset.theme = name;
    $('uavs').dataset.key = '';
    draw();
  }
  return document.documentElement.dataset.theme;
}

$('scrub').oninput = event => goTo(Number(event.target.value));
$('live').onclick = goLive;
$('find').oninput = draw;
$('uavs').oninput = draw;
$('theme').onclick = () => theme(theme() === 'dark' ? 'light' : 'dark');
addEventListener('resize', draw);
theme(matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light');
connect();
