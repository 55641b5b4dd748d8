# SPDX-License-Identifier: Apache-2.0
"""Lists with ways, and what a simulated vehicle did along them by its ground truth."""
import math
from itertools import pairwise

from flight_bench import FlightBench
from mission_bench import ORIGIN

from uav_task_alloc.actions import Action
from uav_task_alloc.geometry.frames import to_enu
from uav_task_alloc.geometry.polyline import polyline_length, segment_distance
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task
from uav_task_alloc.sim.config import FlightMode

TRIGGER = Action('trigger', {'distance': 20.0})
HEIGHT = 40.0  # [m]


def piece(name, *points, actions=(), **fields):
    """A task with a way through points in plan view."""
    path = tuple((float(x), float(y), HEIGHT) for x, y in points)
    return Task(name, path[0], path=path, reversible=True, actions=tuple(actions), **fields)


def strip(k, actions=(TRIGGER,), length=200.0, gap=40.0):
    """Strip k of a field north of the base, flown to the east."""
    y = 60.0 + gap * k
    return piece(f'F#{k}', (0, y), (length, y), actions=actions)


def list_of(*tasks, revision=1, turned=(), returns=False):
    """A list of tasks; those named in `turned` are flown from their last point."""
    return TaskList(revision, tuple(MissionStop(t, reversed=t.id in turned) for t in tasks),
                    returns)


class Track:
    """Records where a vehicle is, and tells how often each way was followed."""

    def __init__(self, bench, n=1):
        self.bench, self.points, self._n = bench, [], n
        vehicle, step = bench.vehicles[n], bench.vehicles[n].step

        def stepped(now):
            out = step(now)
            self.points.append(vehicle.flight.body.position)
            return out
        vehicle.step = stepped

    def times_flown(self, task, near=8.0, every=10.0):
        """How often each place along a way was passed, every so many metres."""
        return [self._passes(place, near) for place in places(task, every)]

    def _passes(self, place, near):
        """Separate times within `near` [m] of a place; still within three times that is one."""
        count, inside = 0, False
        for point in self.points:
            away = math.dist(point, place)
            if away <= near and not inside:
                count, inside = count + 1, True
            elif away > 3.0 * near:
                inside = False
        return count


def places(task, every):
    """Places along a way, not closer than `every` [m] to its ends."""
    length = polyline_length(task.path)
    metres, found = every, []
    while metres <= length - every:
        found.append(_at(task.path, metres))
        metres += every
    return found


def _at(path, metres):
    for a, b in pairwise(path):
        leg = math.dist(a, b)
        if metres <= leg:
            return tuple(p + (q - p) * metres / leg for p, q in zip(a, b, strict=True))
        metres -= leg
    return path[-1]


def payload(bench, n=1):
    """What the payload did, (name, values), without pictures."""
    names = {'trigger', 'video on', 'video off', 'servo', 'gripper', 'gimbal', 'roi on',
             'roi off', 'speed', 'yaw'}
    return [(e.name, e.command) for e in bench.truth[n] if e.name in names]


def photos(bench, n=1):
    """Where pictures were taken [m]."""
    return [e.point for e in bench.truth[n] if e.name == 'photo']


def pictures_of(bench, task, across=10.0):
    """Metres along a straight way at which pictures were taken."""
    a, b = task.path
    return sorted(math.dist(a, p) for p in photos(bench) if segment_distance(p, a, b) <= across)


def stored_points(bench, n=1):
    """ENU positions of the items on board [m], home left out."""
    return [to_enu(ORIGIN, i.x * 1e-7, i.y * 1e-7, i.z) for i in bench.vehicles[n].mission.items
            if i.x]


def surveying(kind, tasks, **kwargs):
    """A vehicle with a list, its track recorded."""
    bench = FlightBench(kind, **kwargs).discover()
    track = Track(bench)
    bench.assign(tasks)
    return bench, track


def halfway(bench, task, metres=100.0):
    """Fly until the vehicle is that far along a strip that is flown to the east."""
    body = bench.vehicles[1].flight.body
    assert bench.run(lambda: math.dist(body.position[1:], task.path[0][1:]) < 2.0
                     and body.position[0] >= metres, 200.0)


def flown_in_mission(bench, n=1):
    """The positions of a vehicle in mission mode from now on, in a list that grows."""
    vehicle, found = bench.vehicles[n], []
    step = vehicle.step

    def stepped(now):
        out = step(now)
        if vehicle.flight.mode is FlightMode.MISSION:
            found.append(vehicle.flight.body.position)
        return out
    vehicle.step = stepped
    return found
