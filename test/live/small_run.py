# SPDX-License-Identifier: Apache-2.0
"""A small run as lines of a record: two UAVs, five tasks, one zone, two plans."""
from uav_task_alloc.live.scene import Scene
from uav_task_alloc.live.snapshot_store import SnapshotStore
from uav_task_alloc.record.run_state import RunState

BEGIN = 1_800_000_000.0  # [unix s]
TASKS = {'t1': (100.0, 300.0), 't2': (100.0, 500.0), 't3': (500.0, 300.0), 't4': (500.0, 500.0),
         't5': (300.0, 420.0)}


def announced(wall, ids, action='ADD'):
    return {'kind': 'announcement', 'wall': wall, 'action': action, 'tasks': [
        {'id': task, 'position': [*TASKS.get(task, (300.0, 300.0)), 40.0]} for task in ids]}


def statuses(wall, **states):
    """statuses(0.0, t1='ACTIVE u1', t5='UNASSIGNED  inside zone z1')."""
    rows = [(task, *(text.split(' ', 2) + ['', ''])[:3]) for task, text in states.items()]
    return {'kind': 'statuses', 'wall': wall, 'statuses': [
        {'task': task, 'state': state, 'uav': uav, 'reason': reason}
        for task, state, uav, reason in rows]}


def listed(wall, uav, revision, ids):
    """A task list; the k-th task is reached 10 k seconds after `wall`."""
    return {'kind': 'list', 'wall': wall, 'stamp': wall, 'uav': uav, 'revision': revision,
            'distance': 0.0, 'tasks': [{'id': task, 'leg_distance': 1.0, 'via': [],
                                        'eta': 10.0 * (k + 1), 'wait': 2.0,
                                        'finish': 10.0 * (k + 1) + 5.0}
                                       for k, task in enumerate(ids)]}


def planned(wall, revision, trigger, **lists):
    return {'kind': 'allocation', 'wall': wall, 'revision': revision, 'trigger': trigger,
            'solve_ms': 20.0 + revision, 'fit': 50.0 - revision,
            'lists': [listed(wall, uav, revision, ids) for uav, ids in lists.items()]}


def state(wall, uav, position, **more):
    return {'kind': 'state', 'wall': wall, 'uav': uav, 'mode': 'ON_MISSION',
            'mission_state': 'VERIFIED', 'active': '', 'list_revision': 1, 'battery': 0.75,
            'position': [*position, 40.0], 'velocity': [0.0, 0.0, 0.0], 'range_remaining': 900.0,
            'available': True, **more}


def zones(wall, *rows):
    return {'kind': 'zones', 'wall': wall, 'zones': [
        {'id': zone, 'shape': 'HEMISPHERE', 'center': [x, y, 0.0], 'radius': radius,
         'vertices': [], 'z_min': None, 'z_max': None, 'margin': 5.0}
        for zone, x, y, radius in rows]}


def held(wall, uav, state, why, seconds, back=''):
    """The diagnostics of a bridge on the authority over a UAV."""
    return {'kind': 'uploads', 'wall': wall, 'uploads': {}, 'health': {}, 'authority': {
        uav: {'state': state, 'why': why, 'for': seconds, 'back': back}}}


def uavs(wall):
    return [state(wall, 'u1', (100.0, 100.0)), state(wall, 'u2', (500.0, 100.0))]


FIRST = [  # the first second
    announced(BEGIN, ['t1', 't2', 't3']), *uavs(BEGIN),
    listed(BEGIN, 'u1', 1, ['t1', 't2']), listed(BEGIN, 'u2', 1, ['t3']),
    planned(BEGIN, 1, 'ADD t1, ADD t2, ADD t3', u1=['t1', 't2'], u2=['t3']),
    statuses(BEGIN, t1='ACTIVE u1', t2='ASSIGNED u1', t3='ACTIVE u2')]
LATER = [  # twenty seconds later: t1 is done, two tasks are new, one of them inside a zone
    *uavs(BEGIN + 20), zones(BEGIN + 20, ('z1', 300.0, 420.0, 60.0)),
    announced(BEGIN + 20, ['t4', 't5']),
    listed(BEGIN + 20, 'u1', 2, []), listed(BEGIN + 20, 'u2', 2, ['t3', 't4', 't2']),
    planned(BEGIN + 20, 2, 'ADD t4', u1=[], u2=['t3', 't4', 't2']),
    statuses(BEGIN + 20, t1='COMPLETED u1', t2='ASSIGNED u2', t3='ACTIVE u2', t4='ASSIGNED u2',
             t5='UNASSIGNED  inside zone z1')]


class Run:
    """A scene and its snapshot store, without any node."""

    def __init__(self, speedup=1.0):
        self.scene, self.snapshots = Scene(RunState()), SnapshotStore()
        self.clock = {'speedup': speedup, 'rate': speedup, 'live': True, 'ended': False}

    def add(self, *lines):
        """Apply lines of one moment and store the changes."""
        for line in lines:
            self.scene.apply(line)
        wall, run = lines[-1]['wall'], self.scene.run
        self.snapshots.put(wall, {'start': run.start(), **self.clock},
                           *self.scene.updates(wall, self.clock['ended']))
        return self
