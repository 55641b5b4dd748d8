# SPDX-License-Identifier: Apache-2.0
"""Where a vehicle was when a REACHED was sent, and what that may repeat."""
import pytest
from test_findings_kills import items_at

from uav_task_alloc.mavlink.mission.epoch import Epoch
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.mission_mode import MissionMode
from uav_task_alloc.mavlink.mission.position_history import PositionHistory
from uav_task_alloc.mavlink.mission.reached_series import ReachedSeries
from uav_task_alloc.mavlink.mission.report_evidence import ReportEvidence
from uav_task_alloc.mavlink.transport.frame_log import FrameLog

SPEED = 10.0  # [m/s] to the east, from x = 0 at 0 s


class East:
    """A PX4 that flies east for 20 s, a position each 0.2 s; its clock is ours."""

    def __init__(self):
        self.positions, frames, self.epoch = PositionHistory(), FrameLog(), Epoch()
        self.mode = MissionMode(self.positions, frames)
        self.mode.note_in_mission()
        self.evidence = ReportEvidence(self.epoch, self.positions, self.mode,
                                       ReachedSeries(self.positions, True, frames))

    def fly(self, begin, end):
        for n in range(round(5 * begin), round(5 * end)):
            t = 0.2 * n
            self.positions.add(PositionSample(t, (SPEED * t, 0.0, 50.0), (SPEED, 0.0, 0.0)),
                               True, t, 10 * n)


@pytest.mark.parametrize(('when', 'since', 'was_there'), [
    (12.0, 0.0, True),
    (8.0, 0.0, False),  # a report of before it came there
    (18.0, 13.0, False)])  # what it passed before does not count
def test_a_report_is_of_an_item_that_was_passed_before_it(when, since, was_there):
    east = East()
    east.fly(0.0, 20.0)
    item, = items_at(100.0)
    assert east.evidence.was_at(item, when, since) is was_there
    assert east.evidence.was_exactly_at(item, when, since) is was_there


def test_what_was_passed_before_the_current_item_was_flown_is_no_evidence():
    east = East()
    east.fly(0.0, 20.0)
    east.epoch.since = 13.0
    assert not east.evidence.was_at(items_at(100.0)[0], 18.0)


def test_only_within_the_radius_and_in_mission_mode_it_was_exactly_at_an_item():
    east = East()
    east.fly(0.0, 8.0)
    east.mode.note_other_mode(8.0)
    east.fly(8.0, 20.0)
    item, = items_at(100.0)
    assert east.evidence.was_at(item, 18.0)
    assert not east.evidence.was_exactly_at(item, 18.0)


def test_a_reached_that_comes_again_may_repeat_one_of_before_the_mission_was_taken():
    east = East()
    east.fly(0.0, 20.0)
    assert east.evidence.first_at(0, 2.0, 101) == 2.0
    east.epoch.taken = 2.5
    assert east.evidence.first_at(0, 3.0, 151) == 2.0
    assert east.evidence.may_repeat_earlier(0, 3.0, 151)
    assert not east.evidence.may_repeat_earlier(1, 4.0, 201)


def test_each_epoch_has_its_number_and_its_times():
    epoch = Epoch()
    epoch.replace(items_at(0.0, 100.0), 0, begin=5.0, taken=5.0, taken_frame=7)
    epoch.since = 9.0
    epoch.correct(items_at(50.0), 0)
    assert (epoch.number, epoch.since, epoch.taken, epoch.taken_frame) == (2, 5.0, 5.0, 7)
    epoch.extend(items_at(50.0, 100.0))
    assert (epoch.number, epoch.current, len(epoch.items)) == (3, 0, 2)
