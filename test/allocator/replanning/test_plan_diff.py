# SPDX-License-Identifier: Apache-2.0
"""What counts as changed by a re-plan, and what does not."""
import pytest

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.replanning.plan_diff import changed_tasks
from uav_task_alloc.model import Leg, Task


def lists(**routes):
    return [UavList(uav, 1, tuple(ListStop(Task(name, (0, 0, 0)), Leg((), 1.0), 0.0)
                                  for name in names)) for uav, names in routes.items()]


@pytest.mark.parametrize(('before', 'after', 'changed'), [
    ({}, {'a': '12'}, '12'),
    ({'a': '12'}, {'a': '12'}, ''),
    ({'a': '123'}, {'a': '23'}, ''),  # 1 was flown
    ({'a': '123'}, {'a': '13'}, ''),  # 2 was withdrawn
    ({'a': '12'}, {'a': '132'}, '32'),  # 2 follows on another task now
    ({'a': '123'}, {'a': '213'}, '213'),
    ({'a': '12', 'b': '3'}, {'a': '1', 'b': '32'}, '2'),
    ({'a': '12', 'b': '3'}, {'a': '', 'b': '312'}, '12'),
    ({'a': '1'}, {'b': '1'}, '1'),
])
def test_a_task_is_changed_where_it_is_new_moved_or_follows_on_another(before, after, changed):
    assert changed_tasks(lists(**before), lists(**after)) == set(changed)
