// SPDX-License-Identifier: Apache-2.0
// What the map fits: all that is near most UAVs and tasks; and what is far away. No DOM.
import {isInside, zoneOutline} from './layers.js';

const FACTOR = 10;      // further away than this many times the reach of the others is far
const LEAST = 1000;     // [m] of reach
const FLYING = 100e3;   // [m] that a UAV with tasks to fly, or most of the fleet, may be away
const WINDS = ['east', 'north-east', 'north', 'north-west', 'west', 'south-west', 'south',
  'south-east'];

const known = point => point && point[0] !== null && point[1] !== null;
const distance = ([ax, ay], [bx, by]) => Math.hypot(ax - bx, ay - by);

// The UAV or task that is nearest to the median of all and of the origin.
function middleOf(points) {
  const median = k => [0, ...points.map(point => point[k])].sort((a, b) => a - b)[
    (points.length + 1) >> 1];
  const middle = [median(0), median(1)];
  return points.reduce((a, b) => (distance(b, middle) < distance(a, middle) ? b : a));
}

// [m] around `middle` that the others take: one that is far away is not counted.
function reachOf(points, middle) {
  let reach = LEAST;
  for (const away of points.map(point => distance(point, middle)).sort((a, b) => a - b)) {
    if (away > FACTOR * reach) break;
    reach = Math.max(reach, away);
  }
  return reach;
}

// {middle, limit} [m] of all, and of the UAVs and the tasks: a base may be away from the tasks.
function centresOf(uavs, tasks) {
  const groups = [[...uavs, ...tasks], uavs, tasks].filter(group => group.length);
  const [all, ...parts] = groups.map(group => {
    const middle = middleOf(group);
    return {middle, limit: FACTOR * reachOf(group, middle)};
  });
  return parts.length === 2 && distance(parts[0].middle, parts[1].middle) <= FLYING
    ? [all, ...parts] : [all];
}

function whereFrom(middle, point) {
  const away = distance(middle, point) / 1000, wind = Math.atan2(point[1] - middle[1],
    point[0] - middle[0]) * 4 / Math.PI;
  return `${Number(away.toPrecision(2))} km ${WINDS[(Math.round(wind) + 8) % 8]}`;
}

// {points, far} of a scene: the points to fit, and {name, point} of each thing of which none is
// near. O(n log n).
export function nearOf({tasks, uavs, zones, area, routes, works}) {
  const placed = things => things.filter(thing => known(thing.points[0]));
  const fleet = placed(uavs.map(
    uav => ({name: uav.id, points: [uav.position], index: uav.index})));
  const shown = placed(tasks.filter(task => task.kind !== 'cancelled').map(
    task => ({name: `task ${task.id}`, points: [task.position]})));
  const shapes = [...zones.map(zone => ({name: `zone ${zone.id}`, zone,
    points: zoneOutline(zone)})), {points: area}];
  const lines = [...routes.map(route => ({points: route.points})),
    ...works.map(work => ({points: work.path}))];
  if (!fleet.length && !shown.length) {
    return {points: shapes.flatMap(shape => shape.points), far: []};
  }
  const anchors = things => things.map(thing => thing.points[0]);
  const centres = centresOf(anchors(fleet), anchors(shown)), {middle} = centres[0];
  const flying = new Set(routes.map(route => route.index));
  const points = [], far = [];
  for (const {name, zone, index, points: all} of [...fleet, ...shown, ...shapes, ...lines]) {
    const least = flying.has(index) ? FLYING : 0;
    const near = all.filter(point => known(point) && centres.some(
      centre => distance(point, centre.middle) <= Math.max(centre.limit, least)));
    points.push(...near);
    if (!name || near.length || zone && isInside(zone, middle)) continue;
    const at = all.reduce((a, b) => (distance(b, middle) < distance(a, middle) ? b : a));
    far.push({name: `${name}, ${whereFrom(middle, at)}`, point: at});
  }
  return {points, far};
}
