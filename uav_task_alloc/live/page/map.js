// SPDX-License-Identifier: Apache-2.0
// Draws the map and the chart of solves with plotly.js.
const Plotly = globalThis.Plotly;
const LABELS = 90;  // tasks; with more none is labelled
const COLOURS = 5, DASHES = ['solid', 'dash', 'dot', 'dashdot'];
const CONFIG = {responsive: true, displaylogo: false, scrollZoom: true,
  showSendToCloud: false,  // a default button of plotly's toolbar
  modeBarButtons: [['zoomIn2d', 'zoomOut2d', 'resetScale2d']]};
const TURN = Array.from({length: 49}, (_, k) => k * Math.PI / 24);

export const colour = index => css(`--uav${index % COLOURS}`);
const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
// plotly interprets some HTML in texts
const plain = text => text.replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/>/g, '&gt;');

function outline(zone, margin) {
  if (zone.shape !== 'POLYGON') {
    const r = zone.radius + margin;
    return TURN.map(a => [zone.center[0] + r * Math.cos(a), zone.center[1] + r * Math.sin(a)]);
  }
  return [...zone.vertices, zone.vertices[0]];
}

function joined(lines) {
  const x = [], y = [];
  for (const line of lines) {
    for (const point of line) { x.push(point[0]); y.push(point[1]); }
    x.push(null); y.push(null);
  }
  return {x, y};
}

function size(zone) {
  if (zone.shape === 'HEMISPHERE') return `dome, ${zone.radius} m high`;
  const low = zone.z_min === null ? 'ground' : `${zone.z_min} m`;
  return zone.z_max === null ? `above ${low}, no top` : `${low} to ${zone.z_max} m high`;
}

function zoneTraces(zones) {
  const tops = zones.map(zone => outline(zone, 0).reduce((a, b) => b[1] > a[1] ? b : a));
  return [
    {...joined(zones.map(zone => outline(zone, 0))), mode: 'lines', fill: 'toself',
      fillcolor: css('--zone') + '40', line: {color: css('--zone'), width: 2},
      name: 'no-fly zone', hoverinfo: 'skip'},
    {...joined(zones.filter(zone => zone.margin && zone.shape !== 'POLYGON')
      .map(zone => outline(zone, zone.margin))), mode: 'lines',
      line: {color: css('--zone'), width: 1, dash: 'dot'}, showlegend: false,
      hoverinfo: 'skip'},
    {x: tops.map(top => top[0]), y: tops.map(top => top[1]), textposition: 'top center',
      mode: 'text', text: zones.map(zone => plain(zone.id)), showlegend: false,
      textfont: {color: css('--bad'), size: 13}, hoverinfo: 'text',
      hovertext: zones.map(zone => `zone ${plain(zone.id)}: ${size(zone)}`)}];
}

// One trace for each UAV; beyond 20 UAVs one for each colour, which is much faster to draw.
function routeTraces(view) {
  const groups = new Map(), heads = {x: [], y: [], angle: [], color: []};
  const many = view.routes.length > COLOURS * DASHES.length;
  view.routes.forEach(route => {
    const key = many ? route.index % COLOURS : route.index;
    if (!groups.has(key)) groups.set(key, {lines: [], route});
    groups.get(key).lines.push(route.points);
    for (let k = 1; k < route.points.length && !many; k++) {
      const [a, b] = [route.points[k - 1], route.points[k]];
      heads.x.push((a[0] + b[0]) / 2); heads.y.push((a[1] + b[1]) / 2);
      heads.angle.push(Math.atan2(b[0] - a[0], b[1] - a[1]) * 180 / Math.PI);
      heads.color.push(colour(route.index));
    }
  });
  const traces = [...groups.values()].map(({lines, route}) => ({
    ...joined(lines), mode: 'lines', showlegend: false, hoverinfo: 'skip', opacity: many ? .4 : 1,
    line: {color: colour(route.index), width: many ? 1 : 2.5,
      dash: many ? 'solid' : DASHES[Math.floor(route.index / COLOURS) % DASHES.length]}}));
  const picked = view.routes.filter(route => route.index === view.pickedIndex);
  traces.push({...joined(picked.map(route => route.points)), mode: 'lines', showlegend: false,
    hoverinfo: 'skip', line: {color: css('--ink'), width: 4}, opacity: many ? 1 : .35});
  traces.push({x: heads.x, y: heads.y, mode: 'markers', hoverinfo: 'skip', showlegend: false,
    marker: {symbol: 'triangle-up', size: 9, angle: heads.angle, color: heads.color}});
  return traces;
}

function taskTraces(view) {
  const kinds = {
    fly: {name: 'to fly', marker: {symbol: 'circle', size: 10, color: []}},
    wait: {name: 'waiting',
      marker: {symbol: 'diamond-open', size: 11, color: css('--ink')}},
    left: {name: 'left out', marker: {symbol: 'x', size: 12, color: css('--bad')}},
    done: {name: 'done',
      marker: {symbol: 'circle', size: 6, color: css('--faint'), opacity: .6}}};
  for (const kind of Object.values(kinds)) {
    Object.assign(kind, {x: [], y: [], customdata: [], text: [], hovertext: []});
  }
  for (const task of view.tasks) {
    const kind = kinds[task.kind];
    if (!kind) continue;
    kind.x.push(task.position[0]); kind.y.push(task.position[1]); kind.customdata.push(task.id);
    kind.hovertext.push(plain(task.words));
    kind.text.push(task.kind === 'done' ? ''
      : '\u00a0\u00a0' + plain((task.place ? `${task.place}·` : '') + task.id));
    if (task.kind === 'fly') kind.marker.color.push(colour(task.index));
  }
  const label = kinds.fly.x.length + kinds.left.x.length <= LABELS;
  const big = view.tasks.length > 1000 ? .5 : 1;
  return Object.values(kinds).map(kind => ({...kind, hoverinfo: 'text',
    mode: label ? 'markers+text' : 'markers', textposition: 'middle right', cliponaxis: false,
    textfont: {size: 12, color: css('--ink')},
    marker: {...kind.marker, size: kind.marker.size * big}}));
}

function rings(points, name, colour_, size_) {
  return {x: points.map(p => p[0]), y: points.map(p => p[1]), mode: 'markers', name,
    hoverinfo: 'skip', showlegend: points.length > 0,
    marker: {symbol: 'circle-open', size: size_, color: colour_, line: {width: 3}}};
}

function uavTrace(view) {
  const shown = view.uavs.filter(uav => uav.position[0] !== null && uav.position[1] !== null);
  return {x: shown.map(u => u.position[0]), y: shown.map(u => u.position[1]), name: 'UAV',
    mode: view.uavs.length <= 60 ? 'markers+text' : 'markers', textposition: 'bottom center',
    text: shown.map(u => `<b>${plain(u.id)}</b>${u.silent ? ' silent' : ''}`),
    textfont: {size: 14, color: css('--ink')}, hoverinfo: 'text',
    hovertext: shown.map(u => `${plain(u.id)}: ${plain(u.words)}`),
    marker: {symbol: shown.map(u => u.silent ? 'star-triangle-up-open' : 'star-triangle-up'),
      size: view.uavs.length <= 60 ? 17 : 10, color: shown.map(u => colour(u.index)),
      line: {color: css('--ink'), width: 1.5}}};
}

function axis(title, more) {
  return {title: {text: title, standoff: 6}, color: css('--ink'), gridcolor: css('--line'),
    zeroline: false, ...more};
}

const frame = right => ({paper_bgcolor: 'rgba(0,0,0,0)', plot_bgcolor: 'rgba(0,0,0,0)',
  font: {color: css('--ink'), size: 13}, margin: {l: 58, r: right, t: 8, b: 42}});

// pick(id) is called when a task is clicked.
export function drawMap(node, view, pick) {
  const traces = [...routeTraces(view), ...zoneTraces(view.zones),
    rings(view.changed, 'just given', css('--mark'), 20), ...taskTraces(view),
    uavTrace(view), rings(view.picked, 'looked for', css('--ink'), 28)];
  const narrow = node.clientWidth < 500;
  const layout = {...frame(narrow ? 36 : 60), uirevision: 'same', dragmode: 'pan',
    hovermode: 'closest', legend: {orientation: 'h', y: 1.01, yanchor: 'bottom',
      x: narrow ? -.18 : 0, font: {size: narrow ? 11 : 13}, entrywidthmode: 'fraction',
      entrywidth: narrow ? .4 : .22, itemclick: false, itemdoubleclick: false},
    xaxis: axis('east [m]'), yaxis: axis('north [m]', {scaleanchor: 'x', scaleratio: 1})};
  const first = !node.on;
  Plotly.react(node, traces, layout, CONFIG);
  if (first) node.on('plotly_click', event => {
    const id = event.points[0].customdata;
    if (typeof id === 'string') pick(id);
  });
}

export function drawChart(node, plans, seconds) {
  const x = plans.map(plan => seconds(plan.wall));
  const hovertext = plans.map(plan => plain(`plan ${plan.revision}: ${plan.trigger}`));
  const series = (values, name, more) => ({x, y: values, name, hovertext, mode: 'lines+markers',
    hovertemplate: '%{hovertext}<br>%{y:.4g}<extra></extra>', showlegend: false, ...more});
  Plotly.react(node, [
    series(plans.map(plan => plan.ms), 'time', {line: {shape: 'linear', color: colour(0)}}),
    series(plans.map(plan => plan.fit), 'fit', {yaxis: 'y2', line: {shape: 'hv', color: colour(1)},
      marker: {symbol: 'square'}})],
  {...frame(10), uirevision: 'same', grid: {rows: 2, columns: 1, pattern: 'coupled'},
    xaxis: axis('time since the first task [s]'), yaxis: axis('[ms]', {rangemode: 'tozero'}),
    yaxis2: axis('fit', {rangemode: 'tozero'})},
  {...CONFIG, displayModeBar: false, scrollZoom: false});
}
