# SPDX-License-Identifier: Apache-2.0
"""An upload to an ArduCopter on its way home that a pilot and a kill of the bridge interrupt."""
import pytest
from authority_bench import COPTER, H, L, flying
from findings_bench import drop_messages
from flight_bench import places
from mission_bench import task_list


@pytest.mark.parametrize('lost', [True, False])
def test_tasks_of_a_part_of_an_upload_are_not_completed_by_the_item_of_before(lost):
    bench = flying('ardupilot', 'ABC')
    bench.assign(task_list('ABC', 2, returns=True))
    assert bench.run(lambda: bench.completed() == ['A', 'B', 'C'], 100.0)
    bench.assign(task_list('', 3, returns=True))
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'RETURN', 10.0)
    bench.run(limit=2.0)
    assert bench.vehicles[1].flight.seq == 4
    drop_messages(bench, 'up', 'MISSION_ITEM_INT', lambda m: m.seq > 2)
    bench.assign(task_list('XYZ', 4, returns=True))
    assert bench.run(lambda: len(bench.line.sent('MISSION_ITEM_INT')) > 13, 10.0)
    if lost:
        bench.vehicles[1].rc_mode(COPTER.stick)
        assert bench.reaches(L)
    bench.vehicles[1].rc_mode(COPTER.mission)
    bench.run(limit=1.5)
    assert bench.authority() is H
    bench.line.tampers.clear()
    bench.kill_and_restart(10.0)
    bench.assign(task_list('XYZ', 4, returns=True))
    assert bench.run(bench.completed, 200.0)
    assert bench.completed() == ['X']
    assert places(bench)[-1] == 'X'
