# SPDX-License-Identifier: Apache-2.0
"""A UAV whose way leads to where a pilot hovers with another one is led past it."""
from dataclasses import replace

from test_separation_watch import Sky

from uav_task_alloc.model import Task


class SkyWithPilot(Sky):
    """A pilot hovers with u2 on the leg of u1, which stops 40 m before it."""

    def __init__(self, x=0.0, **params):
        super().__init__(second={'mode': 'HOLD', 'velocity': (0.0, 0.0, 0.0), 'authority': 'LOST',
                                 'available': False}, **params)
        self.x = x
        self.report((x - 100.0, 0.0, 50.0), (x, 0.0, 50.0))

    def wait(self, seconds):
        assert self.step() == [('u1', True)]
        self.more[0] |= {'mode': 'HOLD', 'velocity': (0.0, 0.0, 0.0)}
        for _ in range(seconds):
            self.stand()

    def stand(self):
        self.report((self.x - 40.0, 0.0, 50.0), (self.x, 0.0, 50.0))
        self.step(1.0)
        self.settle(0.5, report=False)


def test_a_uav_that_holds_for_a_pilot_who_hovers_is_led_around_after_a_while():
    sky = SkyWithPilot()
    sky.wait(1)
    assert 'u1 holds for u2, which is not flown by the allocator' in (
        sky.core.separation.texts()['u1'])
    for _ in range(20):
        sky.stand()
    assert 'u1 wait for u2' in ' '.join(sky.solves)
    stop, = sky.world.list_of('u1').stops
    assert min(abs(z - 50.0) for _, _, z in stop.leg.via) > 5.0
    assert ('u1', False) in [(hold.uav, hold.hold) for step in sky.steps for hold in step.holds]


def test_how_long_one_holds_is_said_and_logged():
    sky = SkyWithPilot(altitude_min=48.0, altitude_max=52.0)  # there is no way past it
    sky.wait(45)
    assert sky.core.separation.texts()['u1'].endswith(' s)')
    sky.take()
    text, = [note for note in sky.notes if note.endswith(' s by now')]
    assert text.startswith('u1 holds for u2, which is not flown by the allocator: for 6')
    assert sky.levels[text] == 'warning'


def sky_with_a_task_put_off():
    sky = SkyWithPilot(x=200.0)
    sky.add(Task('t3', (200.0, 200.0, 50.0), allowed_uavs=frozenset({'u1'})))
    sky.settle(1.0, report=False)
    assert sky.world.list_of('u1').task_ids == ('t1', 't3')
    sky.wait(15)
    assert sky.world.list_of('u1').task_ids == ('t1', 't3')
    for _ in range(10):
        sky.stand()
    assert sky.world.list_of('u1').task_ids == ('t3',)
    assert (sky.state('t1'), sky.reason('t1')) == (
        'UNASSIGNED', 'u2 hovers there, and is not flown by the allocator')
    return sky


def test_a_task_at_which_a_pilot_hovers_is_put_off_until_he_has_left():
    sky = sky_with_a_task_put_off()
    sky.x = 900.0
    sky.report((160.0, 0.0, 50.0), (900.0, 0.0, 50.0))
    sky.step(1.0)
    sky.settle(0.5, report=False)
    assert sorted(sky.world.list_of('u1').task_ids) == ['t1', 't3']


def test_a_task_that_was_put_off_is_planned_again_once_separation_is_off():
    sky = sky_with_a_task_put_off()
    for _ in range(3):
        sky.stand()
    sky.world.set_params(replace(sky.world.params, separation__horizontal=0.0), sky.now)
    for _ in range(3):
        sky.stand()
    assert sorted(sky.world.list_of('u1').task_ids) == ['t1', 't3']


def test_later_legs_pass_a_uav_that_hovers_and_never_had_a_list():
    sky = SkyWithPilot(x=300.0)
    sky.add(Task('t3', (500.0, 0.0, 50.0), allowed_uavs=frozenset({'u1'})))
    sky.settle(1.0, report=False)
    near, far = sky.world.list_of('u1').stops
    assert (near.task.id, near.leg.via, far.task.id) == ('t1', (), 't3')
    assert min(abs(z - 50.0) for _, _, z in far.leg.via) > 5.0
