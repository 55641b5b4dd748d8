# SPDX-License-Identifier: Apache-2.0
"""Of UAVs whose pads are nearer than the rule, one takes off when the other has set out."""
import pytest
from allocation import AllocatorDriver

from uav_task_alloc.model import Task
from uav_task_alloc.params import AllocatorParams

GROUND = {'mode': 'STANDBY', 'standby': True, 'velocity': (0.0, 0.0, 0.0)}
CLIMBS = {'mode': 'TAKEOFF', 'velocity': (0.0, 0.0, 2.5)}
PADS = {'u1': (0.0, 0.0, 0.0), 'u2': (5.0, 0.0, 0.0)}


class Base(AllocatorDriver):
    """Two UAVs on pads that are 5 m apart, whose lists are of a time without separation."""

    def __init__(self):
        super().__init__()
        for name in PADS:
            self.report(name, PADS[name], **GROUND)
        self.add(Task('t1', (200.0, 0.0, 50.0), allowed_uavs=frozenset({'u1'})),
                 Task('t2', (0.0, 150.0, 50.0), allowed_uavs=frozenset({'u2'})))
        self.settle(report=False)
        self.world.params = AllocatorParams(background_budget=0.0, route_end='hold',
                                            separation__horizontal=10.0)

    def report(self, name, place, **state):
        self.uav(name, *place, home=PADS[name], takeoff_height=50.0, authority='HELD', **state)

    def step(self):
        self.now += 0.5
        return [(hold.uav, hold.hold) for hold in self.core.separate(self.now, self.now).holds]


@pytest.mark.parametrize('height', [30.0, 47.8])  # so fast, it would be at 60 m in 5 s
def test_one_on_the_ground_waits_until_the_other_has_left_the_top_of_its_take_off(height):
    base = Base()
    base.report('u2', (5.0, 0.0, height), **CLIMBS)
    assert base.step() == [('u1', True)]
    base.report('u2', (5.0, 30.0, 50.0), mode='ON_MISSION', velocity=(0.0, 15.0, 0.0))
    assert base.step() == [('u1', False)]


def test_one_that_climbs_on_above_its_take_off_is_predicted_to_do_so():
    base = Base()
    base.report('u2', (5.0, 0.0, 55.0), **CLIMBS)
    assert base.step() == []
