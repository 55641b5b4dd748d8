# SPDX-License-Identifier: Apache-2.0
"""What a list still asks for though it has ended is told again, later and later."""
from uav_task_alloc.mavlink.gcs.event_retry import EventRetry
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress


def test_a_later_list_asks_as_soon_as_the_first():
    reminder = EventRetry()
    told = [TaskProgress('A', 'COMPLETED', 2)]
    reminder.listed(told, 0.0)
    assert [t for t in range(40) if reminder.step(float(t))] == [2, 6, 14, 30]
    reminder.listed(told, 40.0)
    assert [t for t in range(40, 50) if reminder.step(float(t))] == [42, 46]
    reminder.listed([], 50.0)
    assert not any(reminder.step(float(t)) for t in range(50, 99))


def test_finding_33_lists_that_ask_on_after_a_task_was_told_are_counted():
    reminder = EventRetry()
    ended = [TaskProgress('A', 'COMPLETED', 2)]
    reminder.listed(ended, 0.0)
    answered = []
    for now in range(1, 30):
        if reminder.step(float(now)):
            answered.append(reminder.answered())
            reminder.listed(ended, float(now))
            assert reminder.answered() in ([], ['A'])  # a list that was under way counts for none
            reminder.listed(ended, float(now))
    assert answered[:4] == [[], [], ['A'], ['A']]
    reminder.listed([], 30.0)
    assert reminder.answered() == []
