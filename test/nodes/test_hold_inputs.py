# SPDX-License-Identifier: Apache-2.0
"""Holds that expire by the published clock, also where that clock goes back."""
import math

import pytest
from builtin_interfaces.msg import Time
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.ros.hold_inputs import HoldInputs

BEGIN = 10_000  # [s]


class Inputs:
    """Hold messages of u1, and the requests that its bridge gets."""

    def __init__(self):
        self.now, self.requests = float(BEGIN), []
        self.inputs = HoldInputs(self, None, lambda: self.now, self.on_hold)
        self.inputs.subscribe('u1')

    def get_namespace(self):
        return '/'

    def create_subscription(self, kind, topic, callback, qos):
        self.take = callback

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
