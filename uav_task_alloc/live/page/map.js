// SPDX-License-Identifier: Apache-2.0
// The map: a view of the ENU plane that is moved and zoomed; what is drawn, and what is clicked.
import {DemandLayer} from './demand.js';
import {degreesText, frameOf, metresText, roundStep} from './geo.js';
import {listen} from './gestures.js';
import {RINGS, drawArea, drawGrid, drawRings, drawRoutes, drawTasks, drawWaits, drawWorks,
  drawZones, isInside, themeColours} from './layers.js';
import {some} from './model.js';
import {nearOf} from './near.js';
import {Overlay} from './overlay.js';
import {Tiles} from './tiles.js';

const SCALES = [1e-4, 50];  // [px/m]
const PADDING = 56;     // [px] around all that is shown
const REACH = 14;       // [px] around a click
const FAR = 4;          // names of what is far away

const within = (box, {x, y}) => box && x >= box[0] && x <= box[2] && y >= box[1] && y <= box[3];

export class FleetMap {
  // box: the section; pickTask(id), pickUav(id): called when one is clicked.
  constructor(box, pickTask, pickUav) {
    const part = where => box.querySelector(where), node = part('#map');
    Object.assign(this, {node, pickTask, pickUav, scene: null, fitted: null, moved: false,
      drawn: 0, origin: ''});
    Object.assign(this, {canvas: part('canvas'), tip: part('.tip'), readout: part('.readout'),
      bar: part('.bar'), empty: part('.empty'), far: part('.far'),
      attribution: part('.attribution')});
    this.context = this.canvas.getContext('2d');
    this.overlay = new Overlay(node, this.context);
    this.view = {x: 0, y: 0, scale: .5, width: 0, height: 0, frame: null,
      pixel: ([x, y]) => [this.view.width / 2 + (x - this.view.x) * this.view.scale,
        this.view.height / 2 - (y - this.view.y) * this.view.scale],
      point: (px, py) => [this.view.x + (px - this.view.width / 2) / this.view.scale,
        this.view.y - (py - this.view.height / 2) / this.view.scale]};
    this.demand = new DemandLayer();
    this.tiles = new Tiles(null, () => this.schedule());
    listen(node, {pan: (dx, dy) => this.pan(dx, dy), fit: () => this.fit(),
      zoom: (factor, x, y) => this.zoom(factor, x, y), click: (x, y) => this.click(x, y),
      hover: (x, y) => this.hover(x, y), leave: () => this.leave()});
    const middle = () => [this.view.width / 2, this.view.height / 2];
    part('.in').onclick = () => this.zoom(1.6, ...middle());
    part('.out').onclick = () => this.zoom(1 / 1.6, ...middle());
    part('.fit').onclick = () => this.fit();
    const heat = part('.heat'), legend = box.querySelector('#legend .heat-row');
    heat.onclick = () => {
      this.demand.on = legend.hidden;
      legend.hidden = !this.demand.on;
      heat.setAttribute('aria-pressed', this.demand.on);
      this.schedule();
    };
    new ResizeObserver(() => this.draw()).observe(node);
  }

  // source: of tiles.json
  setTiles(source) {
    this.tiles.source = source;
    this.attribution.textContent = source?.attribution || '';
    this.schedule();
  }

  show(scene) {
    this.scene = scene;
    this.near = nearOf(scene);
    const key = JSON.stringify(scene.origin);
    if (key !== this.origin) {
      this.origin = key;
      this.view.frame = scene.origin ? frameOf(scene.origin) : null;
    }
    this.draw();
  }

  // moving

  pan(dx, dy) {
    this.moved = true;
    this.view.x -= dx / this.view.scale;
    this.view.y += dy / this.view.scale;
    this.schedule();
  }

  zoom(factor, px, py) {
    const {view} = this, [x, y] = view.point(px, py);
    this.moved = true;
    view.scale = Math.min(SCALES[1], Math.max(SCALES[0], view.scale * factor));
    view.x = x - (px - view.width / 2) / view.scale;
    view.y = y + (py - view.height / 2) / view.scale;
    this.schedule();
  }

  // All that is near, until the map is moved.
  fit() {
    this.moved = false;
    this.fitted = null;
    this.schedule();
  }

  // The point in the middle, at the same scale.
  center([x, y]) {
    this.moved = true;
    Object.assign(this.view, {x, y});
    this.schedule();
  }

  bounds() {
    const {points} = this.near;
    if (!points.length) return null;
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    for (const [x, y] of points) {
      box[0] = Math.min(box[0], x); box[1] = Math.min(box[1], y);
      box[2] = Math.max(box[2], x); box[3] = Math.max(box[3], y);
    }
    return box;
  }

  // Fit again only where something left the bounds, or they became much too large: a map that
  // follows every metre is hard to read.
  autofit() {
    const box = this.bounds(), {view} = this;
    if (!box || this.moved) return;
    const size = b => Math.max(b[2] - b[0], b[3] - b[1], 1);
    const inside = within(this.fitted, {x: box[0], y: box[1]})
      && within(this.fitted, {x: box[2], y: box[3]});
    if (!inside || size(this.fitted) > 2 * size(box)) {
      const more = .03 * size(box);
      this.fitted = [box[0] - more, box[1] - more, box[2] + more, box[3] + more];
    }
    const [a, b, c, d] = this.fitted, room = v => Math.max(v - 2 * PADDING, v / 2);
    view.x = (a + c) / 2;
    view.y = (b + d) / 2;
    view.scale = Math.min(room(view.width) / (c - a), room(view.height) / (d - b), 4);
  }

  // drawing

  schedule() {
    this.due ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    cancelAnimationFrame(this.due);
    this.due = undefined;
    const {node, canvas, context, view, scene} = this, ratio = devicePixelRatio || 1;
    Object.assign(view, {width: node.clientWidth, height: node.clientHeight});
    if (!scene || !view.width) return;
    this.autofit();
    const [w, h] = [Math.round(view.width * ratio), Math.round(view.height * ratio)];
    if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, {width: w, height: h});
    const colours = themeColours();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, view.width, view.height);
    this.tiles.draw(context, view, colours.veil);
    this.demand.draw(context, view, scene.tasks, colours.heat);
    const texts = drawGrid(context, view, colours);
    drawArea(context, view, scene.area, colours);
    drawZones(context, view, scene.zones, colours);
    drawWorks(context, view, scene.works, colours);
    drawRoutes(context, view, scene, colours);
    drawWaits(context, view, scene.waits, colours);
    drawRings(context, view, scene.changed, RINGS.given, colours.mark);
    drawTasks(context, view, scene.tasks, colours);
    drawRings(context, view, scene.picked, RINGS.picked, colours.ink);
    this.overlay.draw(view, scene, texts, colours);
    this.drawScale();
    this.showFar();
    this.empty.hidden = scene.uavs.length + scene.tasks.length > 0;
    Object.assign(node.dataset, {drawn: ++this.drawn, picked: scene.pickedId,
      view: [view.x, view.y, view.scale].join(' ')});  // [m], [m], [px/m]
  }

  drawScale() {
    const length = roundStep(120 / this.view.scale);
    this.bar.style.width = `${(length * this.view.scale).toFixed(0)}px`;
    this.bar.textContent = length >= 1000 ? `${length / 1000} km` : `${length} m`;
  }

  // What is far from all else and not in sight.
  showFar() {
    const {view, far: node} = this, names = this.near.far.filter(({point}) => {
      const [x, y] = view.pixel(point);
      return x < 0 || y < 0 || x > view.width || y > view.height;
    }).map(({name}) => name);
    const text = `▲ Far away, outside of the map: ${some(names, FAR, '; ')}.`;
    node.hidden = !names.length;
    if (node.textContent !== text) node.textContent = text;
  }

  // pointing

  nearest(x, y) {
    const {view, scene} = this, found = {distance: REACH};
    const consider = (kind, thing, point) => {
      if (point[0] === null || point[1] === null) return;
      const [px, py] = view.pixel(point), distance = Math.hypot(px - x, py - y);
      if (distance < found.distance) Object.assign(found, {kind, thing, distance});
    };
    for (const task of scene?.tasks || []) {
      if (task.kind !== 'cancelled') consider('task', task, task.position);
    }
    for (const uav of scene?.uavs || []) consider('uav', uav, uav.position);
    return found;
  }

  click(x, y) {
    const {kind, thing} = this.nearest(x, y);
    this.hover(x, y);
    if (kind === 'task') this.pickTask(thing.id);
    if (kind === 'uav') this.pickUav(thing.id);
  }

  hover(x, y) {
    if (!this.scene) return;
    const {kind, thing} = this.nearest(x, y), {view, tip, scene} = this, point = view.point(x, y);
    const zone = thing ? null : scene.zones.find(other => isInside(other, point));
    const outside = scene.area.length
      && !isInside({shape: 'POLYGON', vertices: scene.area}, point);
    const text = thing ? scene.words(kind, thing) : zone ? scene.words('zone', zone)
      : outside ? 'outside of fence_area: no plan leads here' : '';
    this.readout.textContent = view.frame
      ? `${degreesText(view.frame, point)}  (${metresText(point)})` : metresText(point);
    this.node.classList.toggle('over-thing', Boolean(thing));
    tip.hidden = !text;
    if (!text) return;
    tip.textContent = text;
    const box = {w: tip.offsetWidth, h: tip.offsetHeight};
    tip.style.left = `${Math.max(4, Math.min(x + 14, view.width - box.w - 4))}px`;
    tip.style.top = `${y + 20 + box.h > view.height ? y - box.h - 12 : y + 20}px`;
  }

  leave() {
    this.tip.hidden = true;
    this.readout.textContent = '';
  }
}
