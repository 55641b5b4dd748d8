# SPDX-License-Identifier: Apache-2.0
"""The allocator with an area, as other programs meet it: pieces in lists, statuses, a restart."""
import signal

import pytest
from geometry_msgs.msg import Point
from test_allocator import Fleet, S, add, begin, task
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SubmitTasks

pytestmark = pytest.mark.ros
CORNERS = [Point(x=x, y=y, z=50.0) for x, y in (
    (100.0, 0.0), (400.0, 0.0), (400.0, 160.0), (100.0, 160.0))]


def area(**more):
    return m.Task(task_id='field', kind=m.Task.AREA, path=CORNERS, strip_width=40.0, value=4.0,
                  actions=[m.Action(name='trigger', keys=['distance'], values=[10.0])], **more)


def listed(fleet):
    """(piece, uav_id) of all lists."""
    return {(planned.piece, uav_id) for uav_id, msg in fleet.lists.items() if msg
            for planned in msg.tasks if planned.task.task_id == 'field'}


def listed_ways(fleet):
    """The paths of all pieces in lists, by number."""
    return {planned.piece: planned.task.path for msg in fleet.lists.values()
            for planned in msg.tasks if planned.piece}


def test_an_area_is_flown_in_pieces_also_after_a_restart(start, probe, tmp_path):
    fleet = Fleet(probe)
    state_dir = ('-p', f'state_dir:={tmp_path}', '-p', 'objective:=finish')
    node = begin(start, fleet, *state_dir)
    fleet.uav('a', 0.0)
    fleet.uav('b', 0.0, 160.0)
    response = probe.call(SubmitTasks, 'allocator/submit_tasks', SubmitTasks.Request(
        announcement=add(area(), task('t1', 50.0, 80.0), m.Task(task_id='x', kind=7))))
    assert (list(response.accepted), list(response.rejected)) == (['field', 't1'], ['x'])
    assert 'POINT (0), LINE (1), AREA (2) or ORBIT (3)' in response.reasons[0]
    probe.until(lambda: {piece for piece, _ in listed(fleet)} == {1, 2, 3, 4}
                and {uav_id for _, uav_id in listed(fleet)} == {'a', 'b'})
    first = next(msg for msg in fleet.lists.values() if msg.tasks[0].task.task_id == 'field')
    planned = first.tasks[0]
    assert planned.task.kind == m.Task.LINE
    assert len(planned.task.path) == 2
    assert [action.name for action in planned.task.actions] == ['trigger']

    fleet.event(m.TaskEvent.COMPLETED, 'field', first.uav_id, piece=planned.piece)
    probe.until(lambda: fleet.status('field').pieces_done == 1)
    whole = fleet.status('field')
    assert (whole.piece, whole.pieces, whole.reason[:11]) == (0, 4, '1 of 4 stri')
    probe.until(lambda: len(listed(fleet)) == 3)
    ways = listed_ways(fleet)

    node.stop(signal.SIGKILL)
    for uav_id in fleet.lists:
        fleet.lists[uav_id] = None
    fleet.statuses.clear()
    begin(start, fleet, *state_dir)
    probe.until(lambda: len(listed(fleet)) == 3 and fleet.status('field').pieces_done == 1)
    assert listed_ways(fleet) == ways

    def all_flown():
        for piece, uav_id in listed(fleet):
            fleet.event(m.TaskEvent.COMPLETED, 'field', uav_id, piece=piece)
        return fleet.status('field').state == S.COMPLETED
    probe.until(all_flown)
    assert fleet.status('field').pieces_done == 4
