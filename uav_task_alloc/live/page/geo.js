// SPDX-License-Identifier: Apache-2.0
// WGS84, the ENU plane of the fleet and Web Mercator tiles; no DOM.
const A = 6378137, E2 = 6.69437999014e-3;  // [m], of the ellipsoid
const RAD = Math.PI / 180;
export const TILE = 256;  // [px] of one side

function ecef(latitude, longitude, altitude) {
  const [s, c] = [Math.sin(latitude * RAD), Math.cos(latitude * RAD)];
  const n = A / Math.sqrt(1 - E2 * s * s);
  return [(n + altitude) * c * Math.cos(longitude * RAD),
    (n + altitude) * c * Math.sin(longitude * RAD), (n * (1 - E2) + altitude) * s];
}

function geodetic([x, y, z]) {
  const p = Math.hypot(x, y);
  let latitude = Math.atan2(z, p * (1 - E2)), n = A;
  for (let k = 0; k < 6; k++) {  // converges to nanometres near the ground
    n = A / Math.sqrt(1 - E2 * Math.sin(latitude) ** 2);
    latitude = Math.atan2(z + E2 * n * Math.sin(latitude), p);
  }
  const altitude = Math.abs(latitude) < 1.5 ? p / Math.cos(latitude) - n
    : z / Math.sin(latitude) - n * (1 - E2);
  return [latitude / RAD, Math.atan2(y, x) / RAD, altitude];
}

// The ENU frame with `origin` [deg, deg, m]: {enu(latitude, longitude), degrees(point)}.
export function frameOf(origin) {
  const [latitude, longitude, altitude] = origin, base = ecef(...origin);
  const [sf, cf] = [Math.sin(latitude * RAD), Math.cos(latitude * RAD)];
  const [sl, cl] = [Math.sin(longitude * RAD), Math.cos(longitude * RAD)];
  return {
    latitude, longitude,
    enu(lat, lon, height = altitude) {
      const [x, y, z] = ecef(lat, lon, height).map((v, k) => v - base[k]);
      return [-sl * x + cl * y, -sf * cl * x - sf * sl * y + cf * z,
        cf * cl * x + cf * sl * y + sf * z];
    },
    degrees([e, n, u = 0]) {
      return geodetic([base[0] - sl * e - sf * cl * n + cf * cl * u,
        base[1] + cl * e - sf * sl * n + cf * sl * u, base[2] + cf * n + sf * u]);
    }};
}

// tiles: columns to the east, rows to the south

export function tileAt(latitude, longitude, zoom) {
  const n = 2 ** zoom, y = Math.asinh(Math.tan(latitude * RAD)) / Math.PI;
  return [n * (longitude + 180) / 360, n * (1 - y) / 2];
}

export function cornerOf(column, row, zoom) {
  const n = 2 ** zoom;
  return [Math.atan(Math.sinh(Math.PI * (1 - 2 * row / n))) / RAD, 360 * column / n - 180];
}

// The zoom [fraction] at which a pixel of a tile is a pixel of a map with `scale` [px/m].
export function zoomOf(scale, latitude) {
  return Math.log2(2 * Math.PI * A * Math.cos(latitude * RAD) * scale / TILE);
}

// words

export const degreesText = (frame, point, digits = 5) =>
  frame.degrees(point).slice(0, 2).map(v => v.toFixed(digits)).join(', ');

export function metresText([east, north]) {
  const part = (v, plus, minus) => `${Math.abs(Math.round(v))} m ${v < 0 ? minus : plus}`;
  return `${part(east, 'east', 'west')}, ${part(north, 'north', 'south')}`;
}

// 1, 2 or 5 times a power of ten, at most `most`.
export function roundStep(most) {
  const unit = 10 ** Math.floor(Math.log10(most));
  return unit * [5, 2, 1].find(k => k * unit <= most * (1 + 1e-9));
}

// The points of a polyline after the spot that is nearest to a position.
export function pointsAhead([x, y], points) {
  let best = Infinity, from = 0;
  for (let k = 1; k < points.length; k++) {
    const [[ax, ay], [bx, by]] = [points[k - 1], points[k]], dx = bx - ax, dy = by - ay;
    const length = dx * dx + dy * dy, t = length ? ((x - ax) * dx + (y - ay) * dy) / length : 0;
    const s = Math.min(1, Math.max(0, t)), far = Math.hypot(x - ax - s * dx, y - ay - s * dy);
    if (far < best - 1e-6) [best, from] = [far, t > 0 ? k : k - 1];
  }
  return points.slice(from);
}
