// SPDX-License-Identifier: Apache-2.0
// The demand as a layer of the map: how many of the tasks known to the page are around a place.

const ACROSS = 40;       // cells of the longer side of the area
const WIDTH = 2;         // [cells] standard deviation of the kernel of a task
const LEAST_SIDE = 400;  // [m] of the area around the tasks
const EDGE = 3 * WIDTH;  // [cells] around the tasks
const LEAST = .04;       // of the largest density, below which nothing is drawn
const OPAQUE = .65;      // of the largest density

const KERNEL = Array.from({length: 2 * EDGE + 1}, (_, k) =>
  Math.exp(-.5 * ((k - EDGE) / WIDTH) ** 2));

// places [m, m] -> {cells: values in 0..1 row by row from the south, columns, rows, side [m],
// west, south [m], tasks}; null without places.
export function density(places) {
  const known = places.filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y));
  if (!known.length) return null;
  const box = [0, 1].map(axis => known.reduce(([low, high], place) =>
    [Math.min(low, place[axis]), Math.max(high, place[axis])], [Infinity, -Infinity]));
  const side = Math.max(LEAST_SIDE, ...box.map(([low, high]) => high - low)) / ACROSS;
  const [columns, rows] = box.map(([low, high]) => Math.floor((high - low) / side) + 1 + 2 * EDGE);
  const [west, south] = box.map(([low]) => low - (EDGE + .5) * side);
  const counts = new Float64Array(columns * rows);
  for (const [x, y] of known) {
    counts[Math.floor((y - south) / side) * columns + Math.floor((x - west) / side)]++;
  }
  const cells = blur(blur(counts, columns, rows, 1), columns, rows, columns);
  const most = cells.reduce((a, b) => Math.max(a, b), 0);
  return {cells: cells.map(value => value / most), columns, rows, side, west, south,
    tasks: known.length};
}

// The kernel along one axis: step 1 along rows, step `columns` across them.
function blur(from, columns, rows, step) {
  const to = new Float64Array(from.length), along = step === 1 ? columns : rows;
  from.forEach((value, at) => {
    if (!value) return;
    const place = step === 1 ? at % columns : Math.floor(at / columns);
    const last = Math.min(2 * EDGE, along - 1 - place + EDGE);
    for (let k = Math.max(0, EDGE - place); k <= last; k++) {
      to[at + (k - EDGE) * step] += value * KERNEL[k];
    }
  });
  return to;
}

// The layer, as one image that the map scales.
export class DemandLayer {
  constructor() {
    Object.assign(this, {on: false, key: '', image: null, box: null});
  }

  draw(context, view, tasks, colour) {
    if (!this.on) return;
    const places = tasks.filter(task => task.kind !== 'cancelled').map(task => task.position);
    const key = JSON.stringify([colour, places]);
    if (key !== this.key) this.make(density(places), colour, key);
    if (!this.image) return;
    const {west, south, columns, rows, side} = this.box;
    const [left, top] = view.pixel([west, south + rows * side]);
    context.imageSmoothingEnabled = true;
    context.drawImage(this.image, left, top, columns * side * view.scale,
      rows * side * view.scale);
  }

  make(found, colour, key) {
    Object.assign(this, {key, box: found, image: null});
    if (!found) return;
    this.image = Object.assign(document.createElement('canvas'),
      {width: found.columns, height: found.rows});
    const context = this.image.getContext('2d');
    context.fillStyle = colour;
    found.cells.forEach((value, k) => {
      if (value < LEAST) return;
      context.globalAlpha = OPAQUE * value;
      context.fillRect(k % found.columns, found.rows - 1 - Math.floor(k / found.columns), 1, 1);
    });
  }
}
