// SPDX-License-Identifier: Apache-2.0
// The live page: applies the updates of the stream, shows the present or a moment of the past.
// It only reads: all requests are GET.
import {openCard, showUavs} from './cards.js';
import {drawChart} from './chart.js';
import {drawGantt} from './gantt.js';
import {pointsAhead} from './geo.js';
import {FleetMap} from './map.js';
import {$, fill, make, pick, put, showAnswer, showEvents, showHead, showLeft, showNodes,
  showOrders, showPlans}
  from './panels.js';
import {answer, kindOf, live, ofDay, readModel, seconds, some, span, stamp} from './model.js';
import {finishText, timesOf} from './times.js';

const STALE = 3;     // [s] without an update from the server
const KEPT = 1000;   // entries of each log, as on the server
const THEME = 'uav_task_alloc theme';
let past = null;     // {wall, parts}: the moment shown instead of the present
let receivedAt = performance.now();
let requests = 0;    // of moments of the past
let due = 0, cost = 0, charted = '';
const map = new FleetMap($('map-box'), pick, openCard);

function zoneWords(zone) {
  const low = zone.z_min === null ? 'ground' : `${zone.z_min} m`;
  const size = zone.shape === 'HEMISPHERE' ? `dome, ${zone.radius} m high`
    : zone.z_max === null ? `above ${low}, no top` : `${low} to ${zone.z_max} m high`;
  return `zone ${zone.id}: ${size}`;
}

function uavWords(uav) {
  const figures = uav.figures.map(({name, value}) => `${name} ${value}`);
  return `${uav.id}: ${[uav.words, uav.link, ...figures, uav.place].filter(Boolean).join(', ')}`;
}

const WORDS = {uav: uavWords, zone: zoneWords};

function showMap(model, picked) {
  const at = id => model.where.get(id);
  const last = model.replans.at(-1);
  const rows = last && !last.first ? last.changes : [];
  const given = rows.flatMap(row => row.added.map(([id]) => id));
  const tasks = [...model.where].map(([id, position]) =>
    ({...model.turns.get(id), id, position, kind: kindOf(id, model)}));
  const flying = model.uavs.filter(uav => model.lists.get(uav.id).length && !uav.lost);
  const routes = flying.map(uav => ({
    index: uav.index, points: [uav.position, ...model.lists.get(uav.id).flatMap(
      ({id, via, way}) => way && id === uav.active ? pointsAhead(uav.position, [...via, ...way])
        : [...via, ...way || [at(id)]])].filter(point => point && point[0] !== null)}));
  const waits = model.uavs.filter(uav => model.waits.get(uav.id).length && !uav.lost).map(uav =>
    ({index: uav.index, points: [...uav.position[0] === null ? [] : [uav.position],
      ...pointsAhead(uav.position, model.waits.get(uav.id))]}));
  const works = [...model.works].map(([id, work]) => ({...work, position: at(id)}))
    .filter(work => work.position && work.position[0] !== null);
  map.show({origin: model.origin, zones: model.zones, area: model.area, routes, waits, tasks,
    works, uavs: model.uavs,
    changed: given.filter(id => at(id) && model.turns.has(id)).map(at),
    pickedId: picked, pickedIndex: model.turns.get(picked)?.index,
    picked: at(picked) ? [at(picked)] : [],
    words: (kind, thing) => (WORDS[kind] ? WORDS[kind](thing) : answer(thing.id, model).text)});
}

function showChart(model) {
  const size = $('chart').clientWidth;
  const key = `${model.plans.length} ${model.plans.at(-1)?.wall} ${live.clock.start} ${size}`;
  if (key === charted) return;
  charted = key;
  drawChart($('chart'), model.plans.filter(plan => plan.fit !== null), seconds);
}

function showTimes(model) {
  const rows = timesOf(model), at = seconds(model.wall);
  put($('finish'), finishText(model));
  drawGantt($('gantt'), rows.map(row => ({...row, bars: row.bars.map(bar => ({...bar,
    since: seconds(bar.since), until: seconds(bar.until)}))})), at);
}

function centre(id) {
  const uav = readModel(past).uavs.find(other => other.id === id);
  if (uav && uav.position[0] !== null) map.center(uav.position);
  $('map').scrollIntoView({block: 'nearest'});
}

function show() {
  const begun = performance.now(), model = readModel(past);
  due = 0;
  showHead(model, past);
  const picked = showAnswer(model);
  for (const panel of [showNodes, showPlans, showOrders, showLeft, showEvents, showChart,
    showTimes]) {
    panel(model);
  }
  showUavs(model, centre);
  showMap(model, picked);
  showState();
  cost = performance.now() - begun;
  document.body.dataset.cost = cost.toFixed(0);  // [ms]
}

// Drawing takes at most a third of the time, so that the page stays usable with a big fleet.
function draw() {
  if (!due && live.clock.wall !== undefined) due = setTimeout(show, 2 * cost);
}

function apply(update) {
  const {beat} = update.clock;  // of a node that lives; a server may outlive it
  if (beat === undefined || beat !== live.clock.beat) receivedAt = performance.now();
  live.closed = false;
  if (update.all) Object.assign(live, {parts: {}, events: [], plans: []});
  live.clock = update.clock;
  Object.assign(live.parts, update.parts);
  for (const log of ['events', 'plans']) live[log] = [...live[log], ...update[log]].slice(-KEPT);
  if (update.parts.tasks) {
    const names = Object.keys(update.parts.tasks).slice(0, KEPT);
    fill($('names'), JSON.stringify(names), () => names.map(
      name => Object.assign(make('option'), {value: name})));
  }
  if (past) showHead(readModel(past), past);
  else draw();
  showState();
}

function connect() {
  const source = new EventSource('stream');  // reconnects automatically unless it was refused
  source.onmessage = message => apply(JSON.parse(message.data));
  source.addEventListener('end', () => {
    live.closed = true;
    draw();
    showState();
  });
  source.onerror = () => {
    if (source.readyState === EventSource.CLOSED) setTimeout(connect, 2000);
  };
}

// [text of the badge, its class, text of the banner] for the state of the connection and the run.
function stateTexts() {
  const {clock} = live, age = (performance.now() - receivedAt) / 1000, known = clock.wall;
  if (live.closed) {
    const at = known ? ` at ${stamp(clock.wall)} (${ofDay(clock.wall)})` : '';
    return clock.ended
      ? ['■ run ended', '', `Run ended${at}: every task is settled, ${restText()}, and `
        + 'live_view has exited. The page keeps its last picture.']
      : ['■ stopped', '', `live_view was stopped${at}. UAVs may still be flying. The page keeps `
        + 'its last picture, and goes on when live_view starts again.'];
  }
  if (age > STALE) {
    return ['✕ no data', 'bad', `No data from live_view for ${span(age)} min. What you see is `
      + 'old. Trying again…'];
  }
  if (!known) return ['connecting', '', ''];
  if (clock.still && !clock.ended) {
    return ['✕ clock stands still', 'bad', `The simulated clock stands still at ${stamp(known)}: `
      + 'the simulation is paused or has ended. What you see may be old.'];
  }
  if (past) return ['◷ past', 'past', ''];
  if (!clock.live) return ['■ recording', '', ''];
  return clock.ended ? ['■ run ended', '', ''] : ['● live', 'good', ''];
}

function restText() {
  const lost = readModel(null).uavs.filter(uav => uav.lost).map(uav => uav.id);
  if (!lost.length) return 'all UAVs are at rest';
  const are = lost.length > 1 ? 'are' : 'is';
  return `${some(lost, 4)} ${are} silent, all other UAVs are at rest`;
}

function showState() {
  const [badge, kind, text] = stateTexts();
  put($('state'), badge, kind);
  $('banner').hidden = !text;
  $('banner').setAttribute('role', kind === 'bad' ? 'alert' : 'status');
  put($('banner'), text, kind);
  $('scrub').disabled = live.closed;
}

setInterval(showState, 500);

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
    draw();
  }
  return document.documentElement.dataset.theme;
}

$('scrub').oninput = event => goTo(Number(event.target.value));
$('live').onclick = goLive;
$('find').oninput = draw;
$('alarm').onclick = () => openCard($('alarm').dataset.uav);
$('asks').onclick = () => $('order-box').scrollIntoView({block: 'nearest'});
$('uavs').oninput = draw;
$('theme').onclick = () => {
  theme(theme() === 'dark' ? 'light' : 'dark');
  localStorage.setItem(THEME, theme());
};
addEventListener('resize', draw);
theme(localStorage.getItem(THEME)
  || (matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light'));
connect();
fetch('tiles.json').then(answer_ => answer_.json()).then(source => map.setTiles(source))
  .catch(() => null);  // the page is complete without tiles
