# SPDX-License-Identifier: Apache-2.0
"""Holds that expire by the published clock, also where that clock goes back."""
import math

import pytest
from builtin_interfaces.msg import Time
from std_msgs.msg import Header
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.ros.hold_inputs import HoldInputs, LateHolds

BEGIN = 10_000  # [s]


class Inputs:
    """Hold messages of u1, and the requests that its bridge gets."""

    def __init__(self, clock=None):
        self.now, self.requests, self.lines = float(BEGIN), [], []
        self.inputs = HoldInputs(self, self, lambda: self.now, self.on_hold, clock)
        self.inputs.subscribe('u1')

    def get_namespace(self):
        return '/'

    def create_subscription(self, kind, topic, callback, qos):
        self.take = callback

    def write(self, level, text):
        self.lines.append(f'{level}: {text}')

    def on_hold(self, uav_id, request):
        self.requests.append((request.source, request.hold))

    def fly(self, seconds):
        for _ in range(seconds):
            self.now += 1.0
            self.inputs.step()


def hold(source, expires):
    return m.UavHold(uav_id='u1', hold=True, source=source, expires=Time(sec=expires))


@pytest.mark.parametrize('by', [0.0, -30.0, -3600.0])
def test_without_an_allocator_a_separation_hold_ends_in_a_minute_whatever_the_clock(by):
    bridge = Inputs()
    bridge.take(hold(m.UavHold.SEPARATION, BEGIN + 3600))
    bridge.now += by
    bridge.fly(55)
    assert bridge.requests == [('separation', True)]
    bridge.fly(10)
    assert bridge.requests == [('separation', True), ('separation', False)]
    bridge.fly(200)
    assert len(bridge.requests) == 2


@pytest.mark.parametrize('by', [-3600.0, -20.0, 20.0, 3600.0])
def test_where_the_clock_of_the_computer_leaps_a_separation_hold_lasts_as_long(by):
    steady = [50.0]
    bridge = Inputs(lambda: steady[0])
    bridge.take(hold(m.UavHold.SEPARATION, BEGIN + 60))
    bridge.now += by
    for seconds, requests in ((45.0, [('separation', True)]),
                              (16.0, [('separation', True), ('separation', False)])):
        steady[0] += seconds
        bridge.fly(1)
        assert bridge.requests == requests


def test_a_hold_of_an_operator_ends_when_it_says():
    bridge = Inputs()
    bridge.take(hold(m.UavHold.OPERATOR, BEGIN + 300))
    bridge.fly(299)
    assert len(bridge.requests) == 1
    bridge.fly(1)
    assert bridge.requests == [('operator', True), ('operator', False)]
    bridge.take(hold(m.UavHold.OPERATOR, 0))
    bridge.now = math.nextafter(1e9, 0.0)
    bridge.inputs.step()
    assert bridge.requests[-1] == ('operator', True)


def test_that_a_separation_hold_has_expired_before_it_came_is_a_warning():
    bridge = Inputs()
    bridge.take(hold(m.UavHold.SEPARATION, BEGIN - 75))
    assert bridge.requests == [('separation', False)]
    assert bridge.lines == [
        'warning: u1/hold: a hold to keep UAVs separate expired 75 s before it came, and is '
        'ignored: expected machines whose clocks agree']
    bridge.take(hold(m.UavHold.SEPARATION, BEGIN - 75))
    assert len(bridge.lines) == 1


def separation_hold(stamp):
    return m.UavHold(header=Header(stamp=Time(sec=stamp)), uav_id='u1', hold=True,
                     source=m.UavHold.SEPARATION, expires=Time(sec=stamp + 60))


def test_late_separation_holds_are_logged_once_a_minute_and_warned_of_for_a_minute():
    lines = []
    late = LateHolds(lines.append)
    for second in range(0, 121, 20):
        late.add('u1', separation_hold(BEGIN - 100), BEGIN, float(second))
    assert len(lines) == 3
    assert 'expired 40 s before' in late.warning(179.0)
    assert not late.warning(180.0)


def test_a_hold_that_may_end_before_it_is_renewed_is_late_and_others_are_not():
    lines = []
    late = LateHolds(lines.append)
    operator, end = hold(m.UavHold.OPERATOR, BEGIN - 75), separation_hold(BEGIN - 100)
    end.hold = False
    for msg in (operator, end, separation_hold(BEGIN - 5), separation_hold(BEGIN + 100),
                hold(m.UavHold.SEPARATION, BEGIN + 10)):
        late.add('u1', msg, BEGIN, 0.0)
    assert not lines
    assert not late.warning(0.0)
    late.add('u1', separation_hold(BEGIN - 45), BEGIN, 0.0)
    assert 'is stamped 45 s before the clock of this node' in late.warning(0.0)
