# SPDX-License-Identifier: Apache-2.0
"""Values of the model are checked; errors name place, value and expectation."""
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from uav_task_alloc.actions import ACTIONS, Action
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Leg, Plan, Shape, Task, ThreatZone, Uav
from uav_task_alloc.timetable import Timetable

NAN = math.nan
SQUARE = [(0, 0), (10, 0), (10, 10), (0, 10)]


@pytest.mark.parametrize(('make', 'text'), [
    (lambda: Task('t1', (NAN, 0, 0)),
     'task t1: position = (nan, 0.0, 0.0): expected three finite coordinates [m]'),
    (lambda: Task('t1', (0, -1e200, 0)),
     'task t1: position = (0.0, -1e+200, 0.0): expected three coordinates in [-1e+08, 1e+08] m'),
    (lambda: Task('t1', (0, 0)), 'task t1: position = (0, 0): expected three coordinates [m]'),
    (lambda: Task('t1', (0, 0, 0), value=0.0),
     'task t1: value = 0.0: expected a number in (0, inf]'),
    (lambda: Task('t1', (0, 0, 0), value=math.inf),
     'task t1: value = inf: expected a finite number'),
    (lambda: Task('t1', (0, 0, 0), value=1e201),
     'task t1: value = 1e+201: expected at most 1e+200'),
    (lambda: Task('t1', (0, 0, 0), service_time=-1),
     'task t1: service_time = -1.0: expected a number in [0, 1e+09]'),
    (lambda: Task('t1', (0, 0, 0), required_capabilities='camera'),
     "task t1: required_capabilities = 'camera': expected a set of non-empty strings"),
    (lambda: Task('t1', (0, 0, 0), acceptance_radius=0.0),
     'task t1: acceptance_radius = 0.0: expected a number in (0, 1e+06]'),
    (lambda: Task('', (0, 0, 0)), "task id = '': expected a non-empty string"),
    (lambda: Uav('u1', (0, 0, 0), range=-5),
     'uav u1: range = -5.0: expected a number in [0, inf]'),
    (lambda: Uav('u1', (0, 0, 0), range=NAN),
     'uav u1: range = nan: expected a number in [0, inf]'),
    (lambda: Uav('u1', (0, 0, 0), cruise_speed=0),
     'uav u1: cruise_speed = 0.0: expected a number in (0, 10000]'),
    (lambda: Uav('u1', (0, 0, 0), home=(0, 0, NAN)),
     'uav u1: home = (0.0, 0.0, nan): expected three finite coordinates [m]'),
    (lambda: Task('t1', (0, 0, 0), earliest=NAN),
     'task t1: earliest = nan: expected a number in [-inf, 4e+09]'),
    (lambda: Task('t1', (0, 0, 0), earliest=math.inf),
     'task t1: earliest = inf: expected a number in [-inf, 4e+09]'),
    (lambda: Task('t1', (0, 0, 0), latest=-math.inf),
     'task t1: latest = -inf: expected a number in [-4e+09, inf]'),
    (lambda: Task('t1', (0, 0, 0), earliest=60.0, latest=59.5),
     'task t1: latest = 59.5: expected at least earliest = 60'),
    (lambda: Task('t1', (0, 0, 0), release=math.inf),
     'task t1: release = inf: expected a number in [-4e+09, 4e+09]'),
    (lambda: Task('t1', (0, 0, 0), announced='now'),
     "task t1: announced = 'now': expected a number in [-4e+09, 4e+09]"),
    (lambda: Task('t1', (0, 0, 0), path=[(0, 0, 0)]),
     'task t1: path = ((0.0, 0.0, 0.0),): expected at least two points, not all at one place'),
    (lambda: Task('t1', (0, 0, 0), path=[(1, 0, 0), (2, 0, 0)]),
     'task t1: path = (1.0, 0.0, 0.0): expected its position (0.0, 0.0, 0.0) as first'),
    (lambda: Task('t1', (0, 0, 0), path=[(0, 0, 0), (NAN, 0, 0)]),
     'task t1: path = (nan, 0.0, 0.0): expected three finite coordinates [m]'),
    (lambda: Task('t1', (0, 0, 0), path=[(0, 0, 0), (1, 0, 0)], payload=2.0),
     'task t1: payload = 2.0: expected 0 with a path'),
    (lambda: Task('t1', (0, 0, 0), reversible=1),
     'task t1: reversible = 1: expected True or False'),
    (lambda: Task('t1', (0, 0, 0), heading=7.0),
     'task t1: heading = 7.0: expected a number in [-6.28319, 6.28319]'),
    (lambda: Task('t1', (0, 0, 0), actions=['photo']),
     "task t1: actions = 'photo': expected an Action"),
    (lambda: Action('dance'),
     "action = 'dance': expected one of photo, video, trigger, gimbal, roi, servo, "
     'gripper, wait, speed'),
    (lambda: Action('servo', {'channel': 1}),
     'action servo: pwm = None: expected a number in [500, 2500]'),
    (lambda: Action('photo', {'count': 1.5}),
     'action photo: count = 1.5: expected an integer in [1, 10000]'),
    (lambda: Action('trigger', {'distance': 0.0}),
     'action trigger: distance = 0.0: expected a number in (0, 10000]'),
    (lambda: Action('wait', {'minutes': 1.0}),
     "action wait: key = 'minutes': expected one of seconds"),
    (lambda: Action('video', [('on', 1.0)]), "action video: key = 'on': expected no keys"),
    (lambda: Action('wait', [('seconds', 1.0), ('seconds', 2.0)]),
     "action wait: key = 'seconds': expected a key used once"),
    (lambda: Action('wait', [1.0]), 'action wait = 1.0: expected a key and its value'),
    (lambda: Task('t1', (0, 0, 0), payload=-0.1),
     'task t1: payload = -0.1: expected a number in [0, 1e+06]'),
    (lambda: Uav('u1', (0, 0, 0), endurance=-1.0),
     'uav u1: endurance = -1.0: expected a number in [0, inf]'),
    (lambda: Uav('u1', (0, 0, 0), payload_capacity=math.inf),
     'uav u1: payload_capacity = inf: expected a number in [0, 1e+06]'),
    (lambda: Uav('u1', (0, 0, 0), climb_speed=0.0),
     'uav u1: climb_speed = 0.0: expected a number in (0, inf]'),
    (lambda: Uav('u1', (0, 0, 0), descent_speed=NAN),
     'uav u1: descent_speed = nan: expected a number in (0, inf]'),
    (lambda: Uav('u1', (0, 0, 0), available_from=-1.0),
     'uav u1: available_from = -1.0: expected a number in [0, 4e+09]'),
    (lambda: Uav('u1', (0, 0, 0), available_from=9.0, available_until=8.0),
     'uav u1: available_until = 8.0: expected at least available_from = 9'),
    (lambda: Uav('u1', (0, 0, 0), full_range=-1.0),
     'uav u1: full_range = -1.0: expected a number in [0, inf]'),
    (lambda: Uav('u1', (0, 0, 0), turnaround=-1.0),
     'uav u1: turnaround = -1.0: expected a number in [0, inf]'),
    (lambda: Uav('u1', (0, 0, 0), aboard='t1'),
     "uav u1: aboard = 't1': expected a set of non-empty strings"),
    (lambda: ThreatZone.hemisphere('z1', (0, 0, 0), 0.0),
     'zone z1: radius = 0.0: expected a number in (0, 1e+07]'),
    (lambda: ThreatZone.hemisphere('z1', (0, 0, 0), 10.0, margin=-1.0),
     'zone z1: margin = -1.0: expected a number in [0, 1e+06]'),
    (lambda: ThreatZone.cylinder('z1', (0, 0), 10.0, 5.0, 5.0),
     'zone z1: z_min, z_max = (5.0, 5.0): expected z_min < z_max'),
    (lambda: ThreatZone.cylinder('z1', (0, 0), 10.0, NAN, 5.0),
     'zone z1: z_min, z_max = (nan, 5.0): expected z_min < z_max'),
    (lambda: ThreatZone.polygon('z1', [(0, 0), (1, 1)]),
     'zone z1: vertices = ((0.0, 0.0), (1.0, 1.0)): expected at least 3 corners'),
    (lambda: ThreatZone.polygon('z1', 5), 'zone z1: vertices = 5: expected points (x, y) [m]'),
    (lambda: ThreatZone.cylinder('z1', (0,), 10.0),
     'zone z1: center = (0,): expected two coordinates [m]'),
    (lambda: ThreatZone.cylinder('z1', (0, 0), 10.0, 'a', 'b'),
     "zone z1: z_min, z_max = ('a', 'b'): expected z_min < z_max"),
    (lambda: Task('t1', (0, 0, 0), path=5), 'task t1: path = 5: expected points [m]'),
    (lambda: Task('t1', (0, 0, 0), value=10**5000),
     'task t1: value = a value of type int: expected a number in (0, inf]'),
    (lambda: Task('t1', (0, 0, 0), value=np.ones((2, 1))),
     'task t1: value = array([[1.],        [1.]]): expected a number in (0, inf]'),
    (lambda: Task('t1', (0, 10**400, 0)),
     f'task t1: position = (0, {10**195}... (409 characters): expected three coordinates [m]'),
    (lambda: Uav('u1', (0, 0, 0), endurance=None),
     'uav u1: endurance = None: expected a number in [0, inf]'),
    (lambda: Uav('u1', (0, 0, 0), available_from=None),
     'uav u1: available_from = None: expected a number in [0, 4e+09]'),
    (lambda: ThreatZone.cylinder('z1', (0, 0), 10.0, 10**400),
     f'zone z1: z_min, z_max = ({10**198}... (408 characters): expected z_min < z_max'),
    (lambda: ThreatZone.cylinder('z1', (0, 0), 10.0, True, 9.0),
     'zone z1: z_min, z_max = (True, 9.0): expected z_min < z_max'),
    (lambda: ThreatZone.polygon('z1', 'abc'),
     "zone z1: vertices = ('a',): expected points (x, y) [m]"),
    (lambda: ThreatZone.polygon('z1', [(0,), (1,), (2,)]),
     'zone z1: vertices = (0,): expected points (x, y) [m]'),
])
def test_a_bad_value_is_refused_with_place_and_expectation(make, text):
    with pytest.raises(InvalidValue) as refused:
        make()
    assert str(refused.value) == text


@pytest.mark.parametrize('corners', [
    [(0, 0), (10, 10), (10, 0), (0, 10)],          # crossing
    [(0, 0), (10, 0), (5, 0)],                     # folded back
    [(0, 0), (0, 0), (10, 0), (10, 10)],           # a corner twice
    [(0, 0), (10, 0), (10, 10), (5, 0), (0, 10)],  # a corner on an edge
    [(0, 0), (5, 5), (10, 10)],                    # no area
    [(0, 0), (10, NAN), (10, 10)],
])
def test_a_polygon_that_is_not_simple_is_refused(corners):
    with pytest.raises(InvalidValue, match='zone z1: vertices'):
        ThreatZone.polygon('z1', corners)


@pytest.mark.parametrize('corners', [SQUARE, SQUARE[::-1], [*SQUARE, SQUARE[0]],
                                     [(0, 0), (10, 0), (10, 10), (5, 2), (0, 10)]])
def test_a_simple_polygon_is_accepted_in_either_orientation(corners):
    zone = ThreatZone.polygon('z1', corners, 0.0, 50.0)
    assert len(zone.vertices) in (4, 5)
    assert (0.0, 0.0) in zone.vertices


def test_numbers_become_floats_and_sets_are_frozen():
    task = Task('t1', [1, 2, 3], required_capabilities={'camera'}, allowed_uavs=['u1'])
    assert task.position == (1.0, 2.0, 3.0)
    assert task.required_capabilities == frozenset({'camera'})
    assert task.allowed_uavs == frozenset({'u1'})
    assert hash(task) == hash(Task('t1', (1.0, 2.0, 3.0), required_capabilities={'camera'},
                                   allowed_uavs=['u1']))
    zone = ThreatZone.cylinder('z1', (0, 0), 10, Fraction(1, 2), np.float32(9.0))
    assert [type(z) for z in (zone.z_min, zone.z_max)] == [float, float]


def test_names_may_come_from_an_iterator():
    task = Task('t1', (1, 2, 3), required_capabilities=(name for name in ('camera', 'gripper')),
                allowed_uavs=map(str, ['u1']))
    assert task.required_capabilities == {'camera', 'gripper'}
    assert task.allowed_uavs == {'u1'}
    assert Uav('u1', (0, 0, 0), capabilities=iter(['camera'])).capabilities == {'camera'}
    with pytest.raises(InvalidValue, match='required_capabilities'):
        Task('t1', (1, 2, 3), required_capabilities=(name for name in ('camera', 5)))


def test_a_plan_gives_the_route_of_a_uav():
    legs = (Leg(((1.0, 0.0, 0.0),), 3.0), Leg((), 4.0))
    plan = Plan({'u1': ('t1',), 'u2': ()}, legs={'u1': legs}, returns=True)
    assert plan.route('u1').tasks == ('t1',)
    assert plan.route('u1').distance == 7.0
    assert plan.route('u2').distance == 0.0
    assert replace(plan, path_lengths={'t1': 5.0, 't2': 9.0}).route('u1').distance == 12.0
    with pytest.raises(KeyError):
        plan.route('u3')


def test_a_shape_is_one_of_shape():
    with pytest.raises(InvalidValue, match=r"zone z: shape = 'hemisphere': expected one of"):
        ThreatZone('z', 'hemisphere', radius=5.0)


@pytest.mark.parametrize('shape', [Shape.HEMISPHERE, Shape.CYLINDER])
def test_only_a_polygon_has_vertices(shape):
    corners = ((math.nan, math.inf), (1.0, 2.0))
    zone = ThreatZone('z', shape, (0.0, 0.0, 0.0), 10.0, vertices=corners)
    assert zone.vertices == ()


def test_a_uav_is_at_its_base_where_it_has_no_other_home():
    assert Uav('u', (5.0, 0.0, 0.0)).at_base
    assert Uav('u', (5.0, 0.0, 0.0)).base == (5.0, 0.0, 0.0)
    assert Uav('u', (5.0, 0.0, 0.5), home=(5.0, 0.0, 0.0)).at_base
    assert not Uav('u', (5.0, 0.0, 50.0), home=(5.0, 0.0, 0.0)).at_base


def test_the_times_of_a_plan_are_those_of_its_timetable():
    plan = Plan({'u': ('t',)}, timetable=lambda: Timetable(
        {'t': 5.0}, {'t': 7.5}, {'u': (('t',),)}, {'u': (1.0,)}, {'u': 9.0, 'v': 4.0}, 7.0))
    assert (plan.arrivals, plan.waits) == ({'t': 5.0}, {'t': 2.5})
    assert (plan.finish, plan.response, plan.trips) == (9.0, 7.0, {'u': (('t',),)})


def test_a_plan_without_times_has_none():
    plan = Plan({})
    assert (plan.arrivals, plan.waits, plan.finish, plan.response) == ({}, {}, 0.0, 0.0)


def test_a_task_with_a_path_ends_at_its_last_point():
    task = Task('line', (0, 0, 10), path=[(0, 0, 10), (3, 4, 10), (3, 4, 22)], reversible=True)
    assert task.end == (3.0, 4.0, 22.0)
    assert task.path_length == 17.0
    assert Task('point', (1, 2, 3)).end == (1.0, 2.0, 3.0)
    assert Task('point', (1, 2, 3)).path_length == 0.0


def test_an_action_has_all_keys_in_the_order_of_the_table():
    assert Action('photo').values == (('count', 1.0), ('interval', 1.0))
    roi = Action('roi', {'z': 3, 'x': 1, 'y': 2})
    assert roi.values == (('x', 1.0), ('y', 2.0), ('z', 3.0))
    assert roi == Action('roi', roi.values)
    assert roi['z'] == 3.0
    assert {Action('video'), Action('video')} == {Action('video')}
    assert all(Action(name, {key: of.high for key, of in keys.items()}).values
               for name, keys in ACTIONS.items() if keys)


def test_waits_and_photos_take_their_time_at_the_task():
    actions = (Action('wait', {'seconds': 4.0}), Action('photo', {'count': 3, 'interval': 2.0}),
               Action('video'))
    assert Task('t1', (0, 0, 0), service_time=1.0, actions=actions[:2]).stay == 9.0
    # a mission holds before the video is ended, and after it
    assert Task('t1', (0, 0, 0), service_time=1.0, actions=actions).stay == 10.0
    assert Task('t1', (0, 0, 0), service_time=5.0, actions=actions[2:]).stay == 10.0
    assert Task('t1', (0, 0, 0), path=((0, 0, 0), (9, 0, 0)), service_time=1.0,
                actions=actions).stay == 9.0
    assert Task('t1', (0, 0, 0), actions=actions[2:]).stay == 2.0
    assert Task('t1', (0, 0, 0), service_time=1.0).stay == 1.0
