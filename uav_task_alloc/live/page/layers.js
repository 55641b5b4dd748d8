// SPDX-License-Identifier: Apache-2.0
// What the canvas of the map shows, layer by layer: grid, zones, routes, tasks, rings.
import {metresText, roundStep} from './geo.js';

export const COLOURS = 5;
const DASHES = [[], [9, 6], [2, 5], [11, 4, 2, 4]];
const MANY = COLOURS * DASHES.length;  // UAVs; the routes of more are thin
const TURN = Array.from({length: 49}, (_, k) => k * Math.PI / 24);
const GRID_STEP = 130;  // [px] at least between two lines

// The colours of the theme, read once for a drawing.
export function themeColours() {
  const style = getComputedStyle(document.documentElement);
  const css = name => style.getPropertyValue('--' + name).trim();
  const names = ['ink', 'faint', 'line', 'card', 'zone', 'bad', 'mark', 'veil', 'heat'];
  const colours = Object.fromEntries(names.map(name => [name, css(name)]));
  return {...colours, uavs: Array.from({length: COLOURS}, (_, k) => css(`uav${k}`))};
}

export const uavColour = (index, colours) => colours.uavs[index % COLOURS];

function line(context, points, close) {
  context.beginPath();
  points.forEach(([x, y], k) => k ? context.lineTo(x, y) : context.moveTo(x, y));
  if (close) context.closePath();
}

// grid

// Lines {points, text, side} of a grid in degrees, or in metres where the origin is not known.
function gridLines(view) {
  const [west, north] = view.point(0, 0), [east, south] = view.point(view.width, view.height);
  if (!view.frame) {
    const step = roundStep(GRID_STEP / view.scale * 2);
    return [
      ...steps(west, east, step).map(x => ({points: [[x, south], [x, north]],
        text: metresText([x, 0]).split(',')[0], side: 'bottom'})),
      ...steps(south, north, step).map(y => ({points: [[west, y], [east, y]],
        text: metresText([0, y]).split(', ')[1], side: 'left'}))];
  }
  const middle = [(west + east) / 2, (south + north) / 2], {frame} = view;
  const at = point => frame.degrees(point);
  const [lat0, lat1] = [at([middle[0], south])[0], at([middle[0], north])[0]];
  const [lon0, lon1] = [at([west, middle[1]])[1], at([east, middle[1]])[1]];
  const step = roundStep(2 * GRID_STEP * (lat1 - lat0) / view.height);
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  const mid = (a, b) => (a + b) / 2;
  return [
    ...steps(lon0, lon1, step).map(lon => ({side: 'bottom', text: `${lon.toFixed(digits)}°`,
      points: [lat0, mid(lat0, lat1), lat1].map(lat => frame.enu(lat, lon))})),
    ...steps(lat0, lat1, step).map(lat => ({side: 'left', text: `${lat.toFixed(digits)}°`,
      points: [lon0, mid(lon0, lon1), lon1].map(lon => frame.enu(lat, lon))}))];
}

function steps(from, to, step) {
  const first = Math.ceil(from / step), count = Math.floor(to / step) - first + 1;
  if (!(count > 0 && count < 50)) return [];
  return Array.from({length: count}, (_, k) => (first + k) * step);
}

// Returns the boxes of its texts, on which no label may be.
export function drawGrid(context, view, colours) {
  const boxes = [];
  context.font = '11px system-ui, "DejaVu Sans", sans-serif';
  context.lineWidth = 1;
  for (const {points, text, side} of gridLines(view)) {
    const pixels = points.map(view.pixel), w = context.measureText(text).width;
    context.strokeStyle = colours.line;
    line(context, pixels);
    context.stroke();
    const [x, y] = side === 'bottom' ? [pixels[0][0] + 4, view.height - 6] : [4, pixels[0][1] - 4];
    const box = {x: x - 2, y: y - 11, w: w + 4, h: 14};
    if (x + w > view.width || y < 14 || boxes.some(b => Math.abs(b.x - box.x) < b.w + 2
        && Math.abs(b.y - box.y) < 16)) continue;
    halo(context, text, x, y, colours);
    boxes.push(box);
  }
  return boxes;
}

function halo(context, text, x, y, colours) {
  context.lineJoin = 'round';
  context.strokeStyle = colours.card;
  context.lineWidth = 3;
  context.strokeText(text, x, y);
  context.lineWidth = 1;
  context.fillStyle = colours.faint;
  context.fillText(text, x, y);
}

// zones

export function zoneOutline(zone, margin = 0) {
  if (zone.shape === 'POLYGON') return zone.vertices;
  const r = zone.radius + margin;
  return TURN.map(a => [zone.center[0] + r * Math.cos(a), zone.center[1] + r * Math.sin(a)]);
}

export function isInside(zone, [x, y]) {
  if (zone.shape !== 'POLYGON') {
    return Math.hypot(x - zone.center[0], y - zone.center[1]) <= zone.radius;
  }
  const rim = zone.vertices;
  return rim.reduce((odd, [ax, ay], k) => {
    const [bx, by] = rim[(k + 1) % rim.length];
    return (ay > y) !== (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax) ? !odd : odd;
  }, false);
}

export function drawZones(context, view, zones, colours) {
  context.strokeStyle = colours.zone;
  for (const zone of zones) {
    line(context, zoneOutline(zone).map(view.pixel), true);
    context.fillStyle = colours.zone + '40';
    context.fill();
    context.lineWidth = 2;
    context.stroke();
    if (!zone.margin || zone.shape === 'POLYGON') continue;
    context.setLineDash([2, 3]);
    context.lineWidth = 1;
    line(context, zoneOutline(zone, zone.margin).map(view.pixel), true);
    context.stroke();
    context.setLineDash([]);
  }
}

// The area that plans stay in: all outside of it is covered like a zone.
export function drawArea(context, view, area, colours) {
  if (!area.length) return;
  const pixels = area.map(view.pixel);
  context.beginPath();
  context.rect(0, 0, view.width, view.height);
  pixels.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.closePath();
  context.fillStyle = colours.zone + '20';
  context.fill('evenodd');
  line(context, pixels, true);
  context.strokeStyle = colours.zone;
  context.lineWidth = 2;
  context.setLineDash([10, 5]);
  context.stroke();
  context.setLineDash([]);
}

// routes

export function drawRoutes(context, view, scene, colours) {
  const many = scene.routes.length > MANY;
  context.lineJoin = 'round';
  for (const route of scene.routes) {
    const pixels = route.points.map(view.pixel);
    if (route.index === scene.pickedIndex) {
      context.globalAlpha = .35;
      context.strokeStyle = colours.ink;
      context.lineWidth = 7;
      line(context, pixels);
      context.stroke();
    }
    context.globalAlpha = many ? .4 : 1;
    context.strokeStyle = context.fillStyle = uavColour(route.index, colours);
    context.lineWidth = many ? 1 : 2.5;
    context.setLineDash(many ? [] : DASHES[Math.floor(route.index / COLOURS) % DASHES.length]);
    line(context, pixels);
    context.stroke();
    context.setLineDash([]);
    if (!many) for (let k = 1; k < pixels.length; k++) arrow(context, pixels[k - 1], pixels[k]);
  }
  context.globalAlpha = 1;
}

// Where UAVs without tasks wait for one: a thin line to a double circle, which is no task.
export function drawWaits(context, view, waits, colours) {
  for (const {index, points} of waits) {
    const pixels = points.map(view.pixel), [x, y] = pixels.at(-1);
    context.strokeStyle = uavColour(index, colours);
    context.lineWidth = 1.5;
    context.setLineDash([1, 5]);
    line(context, pixels);
    context.stroke();
    context.setLineDash([]);
    for (const radius of [5, 10]) {
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.stroke();
    }
  }
}

// Halfway from a to b; none where they are close.
function arrow(context, a, b) {
  if (Math.hypot(b[0] - a[0], b[1] - a[1]) < 24) return;
  context.save();
  context.translate((a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
  context.rotate(Math.atan2(b[1] - a[1], b[0] - a[0]));
  line(context, [[6, 0], [-4, -5], [-4, 5]], true);
  context.fill();
  context.restore();
}

// work that is no point: outlines, and the strips that are flown

export function drawWorks(context, view, works, colours) {
  const ring = radius => TURN.map(a => [radius * Math.cos(a), radius * Math.sin(a)]);
  context.lineJoin = 'round';
  for (const {kind, path, holes, radius, strips, position} of works) {
    context.strokeStyle = colours.faint;
    context.globalAlpha = .45;
    context.lineWidth = 6;
    for (const strip of strips) {
      line(context, strip.map(view.pixel));
      context.stroke();
    }
    context.globalAlpha = 1;
    context.strokeStyle = colours.ink;
    context.lineWidth = 1.2;
    context.setLineDash([4, 3]);
    const outlines = kind === 'ORBIT'
      ? [ring(radius).map(([x, y]) => [position[0] + x, position[1] + y])] : [path, ...holes];
    for (const outline of outlines) {
      line(context, outline.map(view.pixel), kind === 'AREA');
      context.stroke();
    }
    context.setLineDash([]);
  }
}

// tasks

const RADII = {fly: 5.5, wait: 6, left: 7, done: 3};  // [px] by kind
export const taskRadius = (kind, many) => (RADII[kind] || 0) * (many ? .6 : 1);

export function drawTasks(context, view, tasks, colours) {
  const many = tasks.length > 1000;
  for (const task of tasks) {
    const r = taskRadius(task.kind, many), [x, y] = view.pixel(task.position);
    if (!r || x < -r || y < -r || x > view.width + r || y > view.height + r) continue;
    context.beginPath();
    context.lineWidth = 2;
    if (task.kind === 'left') {
      context.strokeStyle = colours.bad;
      context.lineWidth = 3.5;
      for (const s of [1, -1]) {
        context.moveTo(x - r, y - s * r);
        context.lineTo(x + r, y + s * r);
      }
      context.stroke();
    } else if (task.kind === 'wait') {
      context.strokeStyle = colours.ink;
      line(context, [[x, y - r - 1], [x + r + 1, y], [x, y + r + 1], [x - r - 1, y]], true);
      context.stroke();
    } else {
      context.arc(x, y, r, 0, 2 * Math.PI);
      context.fillStyle = task.kind === 'done' ? colours.faint : uavColour(task.index, colours);
      context.fill();
    }
  }
}

export const RINGS = {given: 10, picked: 14};  // [px], radii

export function drawRings(context, view, points, radius, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 3;
  for (const point of points) {
    const [x, y] = view.pixel(point);
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
  }
}
