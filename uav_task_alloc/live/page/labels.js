// SPDX-License-Identifier: Apache-2.0
// Placement of labels beside their markers: none overlaps another label or a marker; no DOM.
const GAP = 3;  // [px] between marker and label, and between labels
const RINGS = [0, 14, 30, 48];  // [px] further away
const SIDES = [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, 1], [1, -1], [-1, -1]];
const ABOVE = 3;
const CANDIDATES = RINGS.flatMap(ring => SIDES.map(([x, y]) => ({x, y, ring})));

export const overlap = (a, b) =>
  a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;

function candidateBox({x, y, radius, w, h}, side) {
  const reach = (radius + GAP + side.ring) * (side.x && side.y ? .75 : 1);
  return {x: x + side.x * reach + (side.x - 1) / 2 * w,
    y: y + side.y * reach + (side.y - 1) / 2 * h, w, h};
}

// Boxes by cells of a grid, so that a box is compared with its neighbours only.
class Boxes {
  constructor() { this.cells = new Map(); }

  *keys({x, y, w, h}) {
    for (let i = Math.floor(x / 64); i <= Math.floor((x + w) / 64); i++) {
      for (let j = Math.floor(y / 64); j <= Math.floor((y + h) / 64); j++) yield i * 4096 + j;
    }
  }

  add(box) {
    for (const key of this.keys(box)) {
      if (!this.cells.has(key)) this.cells.set(key, []);
      this.cells.get(key).push(box);
    }
  }

  hits(box, hardOnly) {
    const taken = other => !(hardOnly && other.soft) && overlap(box, other);
    for (const key of this.keys(box)) {
      if (this.cells.get(key)?.some(taken)) return true;
    }
    return false;
  }
}

// items: {key, x, y, radius, w, h, far, above} with the more important first; `far`: also placed
// at a distance, and rather on `soft` obstacles than not at all; `above`: there first. `last`: a
// Map that keeps each label at its side while that is free. Returns the boxes {x, y, w, h, item,
// ring} of those that have room.
export function placeLabels(items, obstacles, width, height, last) {
  const taken = new Boxes(), placed = [];
  for (const box of obstacles) taken.add(box);
  for (const item of items) {
    const count = item.far ? 2 * CANDIDATES.length : SIDES.length, before = last.get(item.key);
    const order = [...before < count ? [before] : [], ...item.above ? [ABOVE] : [],
      ...Array(count).keys()];
    for (const k of order) {
      const box = candidateBox(item, CANDIDATES[k % CANDIDATES.length]);
      const wide = {x: box.x - GAP / 2, y: box.y, w: box.w + GAP, h: box.h};
      if (wide.x < 0 || box.y < 0 || wide.x + wide.w > width || box.y + box.h > height
          || taken.hits(wide, k >= CANDIDATES.length)) continue;
      taken.add(wide);
      last.set(item.key, k);
      placed.push({...box, item, ring: CANDIDATES[k % CANDIDATES.length].ring});
      break;
    }
  }
  return placed;
}
