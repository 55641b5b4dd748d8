# SPDX-License-Identifier: Apache-2.0
"""The log of the ground truth, without a vehicle."""
import pytest

from uav_task_alloc.sim.config import TruthEvent
from uav_task_alloc.sim.truth_log import TruthLog

PLACE, ITEM = (1.0, 2.0, 3.0), (10.0, 20.0, 30.0)


def test_an_event_has_the_present_time_and_place_unless_another_place_is_given():
    log = TruthLog(lambda: (4.0, PLACE))
    log.note('takeoff')
    log.note('item_reached', point=ITEM, seq=2)
    assert log.take() == [TruthEvent(4.0, 'takeoff', PLACE),
                          TruthEvent(4.0, 'item_reached', ITEM, 2)]
    assert log.take() == []


def fail_by(log, cause):
    with log.caused_by(cause):
        raise ValueError(log.cause)


def test_a_cause_lasts_until_the_end_of_its_context_also_after_an_error():
    log = TruthLog(lambda: (0.0, PLACE))
    with log.caused_by('pilot'):
        with pytest.raises(ValueError, match='failsafe'):
            fail_by(log, 'failsafe')
        assert log.cause == 'pilot'
    assert log.cause == 'self'
