# SPDX-License-Identifier: Apache-2.0
"""The steps of a node in time: pauses after work, and reading after it was blocked."""
import pytest

from uav_task_alloc.nodes.ros.step_pacing import StepPacing


def steps(times):
    """Which of these times [s] a step may be done at."""
    pacing = StepPacing(times[0])
    return [now for now in times if pacing.is_due(now)]


def test_each_tick_is_a_step_where_none_takes_long():
    times = [10.0 + 0.025 * k for k in range(9)]
    assert steps(times) == times


@pytest.mark.parametrize(('took', 'pause'), [(0.01, 0.03), (0.05, 0.15), (3.0, 0.2)])
def test_work_is_followed_by_a_pause_of_three_times_its_duration_up_to_a_limit(took, pause):
    pacing = StepPacing(10.0)
    pacing.pause_after(10.0 - took, 10.0)
    assert not pacing.is_due(10.0 + pause - 0.001)
    assert pacing.is_due(10.0 + pause + 0.001)


def test_a_node_that_was_blocked_reads_for_half_a_second_before_its_next_step():
    assert steps([10.0, 11.1, 11.3, 11.5, 11.7]) == [10.0, 11.7]


def test_where_other_work_takes_long_between_all_steps_every_second_one_is_done():
    assert steps([10.0, 12.0, 14.0, 16.0, 18.0]) == [10.0, 14.0, 18.0]


def test_a_blocked_node_reads_however_short_its_pause_was():
    pacing = StepPacing(10.0)
    pacing.pause_after(9.0, 10.0)
    assert not pacing.is_due(12.0)
    assert pacing.is_due(12.6)
