# SPDX-License-Identifier: Apache-2.0
"""Final events of tasks that a list still contains are repeated, at growing intervals."""
from uav_task_alloc.mavlink.gcs.event_retry import EventRetry
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress


def test_a_later_list_is_answered_as_soon_as_the_first():
    retry = EventRetry()
    ended = [TaskProgress('A', 'COMPLETED', 2)]
    retry.set_ended(ended, 0.0)
    assert [t for t in range(40) if retry.step(float(t))] == [2, 6, 14, 30]
    retry.set_ended(ended, 40.0)
    assert [t for t in range(40, 50) if retry.step(float(t))] == [42, 46]
    retry.set_ended([], 50.0)
    assert not any(retry.step(float(t)) for t in range(50, 99))


def test_finding_33_lists_with_a_task_after_its_repeated_event_are_counted():
    retry = EventRetry()
    ended = [TaskProgress('A', 'COMPLETED', 2)]
    retry.set_ended(ended, 0.0)
    wanted = []
    for now in range(1, 30):
        if retry.step(float(now)):
            wanted.append(retry.wanted_again())
            retry.set_ended(ended, float(now))
            assert retry.wanted_again() in ([], ['A'])  # a list sent before does not count
            retry.set_ended(ended, float(now))
    assert wanted[:4] == [[], [], ['A'], ['A']]
    retry.set_ended([], 30.0)
    assert retry.wanted_again() == []
