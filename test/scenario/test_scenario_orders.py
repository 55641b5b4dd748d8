# SPDX-License-Identifier: Apache-2.0
"""Orders of an operator in scenario files: read, refused, written, and when they are given."""
import pytest

from uav_task_alloc import scenario
from uav_task_alloc.errors import ScenarioError

TEXT = """uavs: [{id: u1, position: [0, 0, 0]}]
tasks:
  - {id: t1, position: [1, 1, 1]}
  - {id: t2, position: [1, 1, 1], at: 9}
orders:
  - {at: 12, order: next, uav: u1, tasks: [t1, t2]}
  - {at: 10, order: forbid, uav: u1, tasks: [t2]}
"""


def test_orders_are_read_by_time_written_and_in_the_timeline():
    read = scenario.parse(TEXT)
    assert [order.text for order in read.orders] == ['forbid t2 to u1', 'next of u1 t1 t2']
    assert read.duration == 12.0
    assert scenario.parse(scenario.to_yaml(read)) == read
    assert [(m.at, m.orders) for m in scenario.timeline(read) if m.orders] == [
        (10.0, read.orders[:1]), (12.0, read.orders[1:])]


@pytest.mark.parametrize(('old', 'new', 'text'), [
    ('next, uav: u1', 'next, uav: u9',
     "uav = u9: expected one of the UAVs of this file; nearest is 'u1'"),
    ('[t1, t2]', '[t1, t22]',
     "tasks = [t1, t22]: expected one of the tasks of this file; nearest is 't2'"),
    ('[t1, t2]', '[t2, t2]', 'tasks = [t2, t2]: expected each task once'),
    ('[t1, t2]', '[]', 'tasks = []: expected a list of ids of tasks'),
    ('order: next', 'order: pin', 'tasks = [t1, t2]: expected one task to pin'),
    ('order: next', 'order: fly', 'order = fly: expected one of pin, forbid, next'),
    ('at: 12', 'at: 8', 'at = 8: expected not before t2 is announced at 9'),
])
def test_a_wrong_order_is_refused_with_its_line(old, new, text):
    assert TEXT.count(old) == 1
    with pytest.raises(ScenarioError) as refused:
        scenario.parse(TEXT.replace(old, new), 's.yaml')
    assert str(refused.value).startswith(f's.yaml:6: scenario.orders[0].{text}')
