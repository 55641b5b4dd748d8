// SPDX-License-Identifier: Apache-2.0
// The live page: folds what the server streams, shows the newest or a moment of the past.
// It only reads: nothing here sends anything but GET.
import {drawChart, drawMap} from './map.js';
import {$, fill, make, pick, put, showAnswer, showEvents, showHead, showLeft, showPlans, showUavs}
  from './panels.js';
import {answer, kindOf, live, picture, seconds, span} from './picture.js';

const STALE = 3;     // [s] without a word from the server
const KEPT = 1000;   // entries of each log, as the server keeps
let past = null;     // {wall, parts}: the moment that is shown instead of now
let heardAt = performance.now();
let asked = 0;       // moments of the past asked for
let due = 0, cost = 0, charted = '';

function showMap(seen, picked) {
  const at = id => seen.where.get(id);
  const last = seen.plans.findLast(plan => plan.changes.length && !plan.first);
  const given = last ? last.changes.flatMap(row => row.added.map(([task]) => task)) : [];
  const tasks = [...seen.where].map(([id, position]) => ({...seen.turns.get(id), id, position,
    kind: kindOf(id, seen), words: answer(id, seen).text}));
  const routes = seen.uavs.filter(uav => seen.lists.get(uav.id).length).map(uav => ({
    index: uav.index, points: [uav.position, ...seen.lists.get(uav.id).flatMap(
      task => [...task.via, at(task.id)])].filter(point => point && point[0] !== null)}));
  drawMap($('map'), {zones: seen.zones, routes, tasks, uavs: seen.uavs,
    changed: given.filter(id => at(id) && seen.turns.has(id)).map(at),
    pickedIndex: seen.turns.get(picked)?.index, picked: at(picked) ? [at(picked)] : []}, pick);
}

function showChart(seen) {
  const key = `${seen.plans.length} ${seen.plans.at(-1)?.wall} ${live.clock.start} ${theme()}`;
  if (key === charted) return;
  charted = key;
  drawChart($('chart'), seen.plans.filter(plan => plan.fit !== null), seconds);
}

function show() {
  const begun = performance.now(), seen = picture(past);
  due = 0;
  showHead(seen, past);
  const picked = showAnswer(seen);
  for (const panel of [showPlans, showLeft, showUavs, showEvents, showChart]) panel(seen);
  showMap(seen, picked);
  cost = performance.now() - begun;
  document.body.dataset.cost = cost.toFixed(0);  // [ms]
}

// Drawing takes at most a third of the time, so that a big fleet leaves the page usable.
function draw() {
  if (!due && live.clock.wall !== undefined) due = setTimeout(show, 2 * cost);
}

function take(news) {
  heardAt = performance.now();
  if (news.all) Object.assign(live, {parts: {}, events: [], plans: []});
  live.clock = news.clock;
  Object.assign(live.parts, news.parts);
  for (const log of ['events', 'plans']) live[log] = [...live[log], ...news[log]].slice(-KEPT);
  if (news.parts.tasks) {
    const names = Object.keys(news.parts.tasks);
    fill($('names'), String(names.length), () => names.slice(0, KEPT).map(
      name => Object.assign(make('option'), {value: name})));
  }
  if (past) showHead(picture(past), past);
  else draw();
}

function connect() {
  const source = new EventSource('stream');  // tries again by itself unless it was refused
  source.onmessage = message => take(JSON.parse(message.data));
  source.onerror = () => {
    if (source.readyState === EventSource.CLOSED) setTimeout(connect, 2000);
  };
}

setInterval(() => {
  const age = (performance.now() - heardAt) / 1000;
  $('banner').hidden = age <= STALE;
  if (age > STALE) put($('banner'), `No word from live_view for ${span(age)} min. `
    + 'What you see is old. Trying again…');
}, 500);

async function goTo(wall) {
  const mine = ++asked, got = await fetch(`at?wall=${wall}`).catch(() => null);
  const then = got && got.ok ? await got.json() : null;
  if (!then || mine !== asked) return;
  past = {wall, parts: then.parts};
  draw();
}

function goLive() {
  asked++;
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
