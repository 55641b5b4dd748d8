// SPDX-License-Identifier: Apache-2.0
// Map tiles under the ENU plane: which are needed, loading, drawing. Missing tiles do no harm.
import {TILE, cornerOf, tileAt, zoomOf} from './geo.js';

const MOST = 120;       // tiles of one drawing
const KEPT = 500;       // images
const LEVELS = 6;       // above, for the part of a tile that has not come
const RETRY = 30_000;   // [ms] until a missing tile is asked for again

export class Tiles {
  // source: of tiles.json, null: none; changed() is called when a tile has come.
  constructor(source, changed) {
    Object.assign(this, {source, changed, images: new Map()});
  }

  image(zoom, x, y) {
    const key = `${zoom}/${x}/${y}`, known = this.images.get(key);
    this.images.delete(key);  // and put at the end: the oldest is dropped
    if (known && !(known.failed < performance.now() - RETRY)) {
      this.images.set(key, known);
      return known;
    }
    const image = new Image(), entry = {image, ready: false, failed: Infinity};
    if (this.images.size >= KEPT) this.images.delete(this.images.keys().next().value);
    this.images.set(key, entry);
    image.referrerPolicy = 'origin';  // tile servers refuse requests without
    image.onload = () => { entry.ready = true; this.changed(); };
    image.onerror = () => { entry.failed = performance.now(); this.changed(); };
    image.src = this.source.url.replace('{z}', zoom).replace('{x}', x).replace('{y}', y);
    return entry;
  }

  // The image of a tile, or of a tile above: {image, left, top, size} [shares]; null: none yet.
  part(zoom, x, y) {
    for (let up = 0; up <= LEVELS && zoom - up >= this.source.min_zoom; up++) {
      const n = 2 ** up, entry = this.image(zoom - up, Math.floor(x / n), Math.floor(y / n));
      if (entry.ready) {
        return {image: entry.image, left: (x % n) / n, top: (y % n) / n, size: 1 / n};
      }
      if (entry.failed === Infinity) return null;  // on its way
    }
    return null;
  }

  // {zoom, columns, rows} that cover a view; null where they would be too many.
  range(view) {
    const {frame} = view, wanted = Math.round(zoomOf(view.scale, frame.latitude));
    const zoom = Math.min(this.source.max_zoom, Math.max(this.source.min_zoom, wanted));
    const corners = [[0, 0], [view.width, 0], [0, view.height], [view.width, view.height]]
      .map(([x, y]) => frame.degrees(view.point(x, y)))
      .map(([latitude, longitude]) => tileAt(latitude, longitude, zoom));
    const span = k => {
      const values = corners.map(corner => corner[k]);
      return [Math.max(0, Math.floor(Math.min(...values))),
        Math.min(2 ** zoom - 1, Math.floor(Math.max(...values)))];
    };
    const [columns, rows] = [span(0), span(1)];
    const count = (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1);
    return count > MOST ? null : {zoom, columns, rows};
  }

  // `veil`: colour drawn over the tiles, which must not outshine what flies.
  draw(context, view, veil) {
    if (!this.source || !view.frame) return;
    const range = this.range(view);
    if (!range) return;
    const {zoom, columns, rows} = range;
    for (let x = columns[0]; x <= columns[1]; x++) {
      for (let y = rows[0]; y <= rows[1]; y++) this.drawTile(context, view, zoom, x, y);
    }
    context.fillStyle = veil;
    context.fillRect(0, 0, view.width, view.height);
  }

  drawTile(context, view, zoom, x, y) {
    const part = this.part(zoom, x, y);
    if (!part) return;
    const corner = (column, row) => view.pixel(view.frame.enu(...cornerOf(column, row, zoom)));
    const [a, b, c] = [corner(x, y), corner(x + 1, y), corner(x, y + 1)];
    const {image, left, top, size} = part, side = image.naturalWidth || TILE;
    context.save();
    context.transform(b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1], a[0], a[1]);
    const seam = .5 / Math.hypot(b[0] - a[0], b[1] - a[1]);  // half a pixel over the next tile
    context.drawImage(image, left * side, top * side, size * side, size * side,
      0, 0, 1 + seam, 1 + seam);
    context.restore();
  }
}
