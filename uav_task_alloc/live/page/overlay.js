// SPDX-License-Identifier: Apache-2.0
// Elements above the canvas of the map: a marker for each UAV, and the labels.
import {placeLabels} from './labels.js';
import {RINGS, taskRadius, uavColour, zoneOutline} from './layers.js';

const SVG = 'http://www.w3.org/2000/svg';
const LABELS = 90;     // tasks in sight; with more none is labelled
const BIG_FLEET = 60;  // UAVs; their markers are smaller, and without labels
const NARROW = 500;    // [px]; labels of UAVs are their names only
const FONT = '13px system-ui, "DejaVu Sans", sans-serif';  // as in live.css
const ARROW = 'M0,-14 L10,11 L0,5.5 L-10,11 Z';  // of a UAV that moves; else a dot
const DOT = 'M-8,0 a8,8 0 1,0 16,0 a8,8 0 1,0 -16,0 Z';
const CROSS = 'M-9,-9 L9,9 M9,-9 L-9,9';  // of a UAV that is lost

export class Overlay {
  constructor(node, context) {
    Object.assign(this, {node, context, svg: node.querySelector('svg'),
      labels: node.querySelector('.labels'), markers: new Map(), shown: new Map(),
      sides: new Map()});
  }

  // texts: boxes that are taken
  draw(view, scene, texts, colours) {
    Object.assign(this, {view, scene});
    this.drawUavs(colours);
    this.drawLabels(texts, colours);
  }

  drawUavs(colours) {
    const {view, scene} = this, size = scene.uavs.length > BIG_FLEET ? .6 : 1, ids = new Set();
    for (const uav of scene.uavs) {
      if (uav.position[0] === null || uav.position[1] === null) continue;
      ids.add(uav.id);
      const marker = this.marker(uav.id), [body, cross] = marker.children;
      const [x, y] = view.pixel(uav.position), turned = uav.course ?? null;
      marker.setAttribute('transform',
        `translate(${x.toFixed(1)} ${y.toFixed(1)}) scale(${size})`);
      marker.setAttribute('class', uav.lost ? 'uav lost' : 'uav');
      body.setAttribute('d', turned === null ? DOT : ARROW);
      body.setAttribute('transform', `rotate(${turned ?? 0})`);
      body.setAttribute('fill', uav.silent ? colours.card : uavColour(uav.index, colours));
      body.setAttribute('stroke', uav.silent ? uavColour(uav.index, colours) : colours.ink);
      cross.setAttribute('d', uav.lost ? CROSS : '');
    }
    for (const [id, marker] of this.markers) {
      if (!ids.has(id)) { marker.remove(); this.markers.delete(id); }
    }
  }

  marker(id) {
    if (!this.markers.has(id)) {
      const marker = document.createElementNS(SVG, 'g');
      marker.append(document.createElementNS(SVG, 'path'), document.createElementNS(SVG, 'path'));
      marker.dataset.uav = id;
      this.svg.append(marker);
      this.markers.set(id, marker);
    }
    return this.markers.get(id);
  }

  drawLabels(texts, colours) {
    const {view, scene} = this;
    Object.assign(this, {items: [], obstacles: [...texts, ...this.covered()]});
    for (const uav of scene.uavs) this.addUav(uav, colours);
    for (const zone of scene.zones) {
      const top = zoneOutline(zone).reduce((a, b) => b[1] > a[1] ? b : a);
      this.addLabel({kind: 'zone', id: zone.id, weak: zone.id, radius: 3, far: true, above: true,
        colour: colours.bad}, view.pixel(top));
    }
    this.addTasks(colours);
    const boxes = placeLabels(this.items, this.obstacles, view.width, view.height, this.sides);
    this.drawLeaders(boxes.filter(placed => placed.ring), colours);
    this.putLabels(boxes);
  }

  isVisible([x, y]) {
    return x >= 0 && y >= 0 && x <= this.view.width && y <= this.view.height;
  }

  // `strong` and `weak`: texts; `radius` [px] of the marker at the pixel (x, y).
  addLabel({strong = '', weak = '', ...label}, [x, y]) {
    if (!this.isVisible([x, y])) return;
    const w = Math.ceil(this.textWidth(strong, true) + this.textWidth(weak)) + 2;
    this.items.push({...label, key: `${label.kind} ${label.id}`, strong, weak, x, y, w, h: 17});
  }

  addObstacle([x, y], r, soft = false) {
    this.obstacles.push({x: x - r, y: y - r, w: 2 * r, h: 2 * r, soft});
  }

  addUav(uav, colours) {
    const {view, scene} = this, few = scene.uavs.length <= BIG_FLEET;
    if (uav.position[0] === null || uav.position[1] === null) return;
    const point = view.pixel(uav.position), short = view.width < NARROW && !uav.lost;
    if (this.isVisible(point)) this.addObstacle(point, few ? 11 : 7);
    if (few) {
      this.addLabel({kind: 'uav', id: uav.id, strong: uav.id, radius: 12, far: true,
        weak: short || !uav.note ? '' : ` ${uav.note}`,
        colour: uav.lost ? colours.bad : colours.ink}, point);
    }
  }

  // The task that is looked for comes first, then those that are flown next.
  addTasks(colours) {
    const {view, scene} = this, many = scene.tasks.length > 1000;
    const tasks = scene.tasks.map(task => ({task, point: view.pixel(task.position)}))
      .filter(({point}) => this.isVisible(point));
    if (tasks.length <= 4 * LABELS) {
      tasks.forEach(({task, point}) =>
        this.addObstacle(point, taskRadius(task.kind, many), true));
    }
    const named = tasks.filter(({task}) => ['fly', 'left', 'wait'].includes(task.kind));
    if (named.length > LABELS) return;
    const rank = ({task}) => (task.id === scene.pickedId ? -1 : task.place || 99);
    for (const {task, point} of named.sort((a, b) => rank(a) - rank(b))) {
      const picked = task.id === scene.pickedId, given = scene.changed.includes(task.position);
      this.addLabel({kind: 'task', id: task.id, far: picked, colour: colours.ink,
        weak: (task.place ? `${task.place}·` : '') + task.id,
        radius: picked ? RINGS.picked : given ? RINGS.given : taskRadius(task.kind, many)}, point);
    }
  }

  // A line from the marker to a label that is further away.
  drawLeaders(boxes, colours) {
    const {context} = this, near = (v, low, size) => Math.min(Math.max(v, low), low + size);
    context.strokeStyle = colours.faint;
    context.lineWidth = 1;
    for (const {x, y, w, h, item} of boxes) {
      context.beginPath();
      context.moveTo(item.x, item.y);
      context.lineTo(near(item.x, x, w), near(item.y, y, h));
      context.stroke();
    }
  }

  textWidth(text, bold) {
    this.context.font = `${bold ? 'bold ' : ''}${FONT}`;
    return text ? this.context.measureText(text).width : 0;
  }

  // Boxes of the controls, and of the texts at the edges.
  covered() {
    const frame = this.node.getBoundingClientRect();
    return [...this.node.querySelectorAll('.over')].map(part => part.getBoundingClientRect())
      .filter(box => box.width).map(box =>
        ({x: box.x - frame.x, y: box.y - frame.y, w: box.width, h: box.height}));
  }

  putLabels(boxes) {
    const keys = new Set(boxes.map(box => box.item.key));
    for (const [key, label] of this.shown) {
      if (!keys.has(key)) { label.remove(); this.shown.delete(key); }
    }
    for (const {x, y, item} of boxes) {
      if (!this.shown.has(item.key)) {
        const label = document.createElement('span');
        label.append(document.createElement('b'), '');
        this.labels.append(label);
        this.shown.set(item.key, label);
      }
      const label = this.shown.get(item.key);
      label.className = `label ${item.kind}`;
      label.firstChild.textContent = item.strong;
      label.lastChild.data = item.weak;
      label.style.color = item.colour;
      label.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px)`;
    }
  }
}
