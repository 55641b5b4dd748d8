# SPDX-License-Identifier: Apache-2.0
"""A vehicle that takes off with its fence only is not available where it will get none."""
import pytest
from authority_bench import BOTH
from fence_bench import FenceBench, FenceState
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.sim.stored_item import StoredItem


@BOTH
@pytest.mark.parametrize('fences', ['require', 'warn'])
def test_a_vehicle_without_a_fence_store_is_not_available_where_it_needs_one(kind, fences):
    bench = FenceBench(kind, fences=fences, config={'fence_capacity': 0})
    bench.settle(FenceState.UNSUPPORTED)
    bench.assign(task_list('A'))
    assert bench.run(lambda: bench.completed() == ['A'], 100.0) is (fences == 'warn')
    assert bench.state().reason == (
        '' if fences == 'warn' else 'it waits for its fence: UNSUPPORTED')


@BOTH
def test_a_fence_of_another_station_makes_it_unavailable_until_it_is_removed(kind):
    bench = FenceBench(kind, fences='require').settle()
    assert bench.state().available
    bench.store_by_another(StoredItem(0, d.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, 9.0, 0.0, 0.0,
                                      0.0, 473900000, 85400000, 0.0))
    bench.settle(FenceState.FOREIGN)
    assert '1 point of another station' in bench.state().reason
    bench.store_by_another()
    bench.settle()
    assert bench.state().available
