# SPDX-License-Identifier: Apache-2.0
"""What an allocator saves in steps, and at its end what a disk refused a moment before."""
import pytest
import rclpy
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SubmitTasks

from uav_task_alloc.allocator.persistence.persistence import Persistence
from uav_task_alloc.nodes.allocator import AllocatorNode

pytestmark = pytest.mark.ros


def test_a_task_accepted_while_the_disk_failed_is_saved_at_the_end(domain, tmp_path):
    rclpy.init(args=['--ros-args', '-p', f'state_dir:={tmp_path}', '--log-level', 'fatal'])
    node = AllocatorNode()
    database = node.persistence._journal._db
    database.execute('PRAGMA query_only = ON')
    announced = m.TaskAnnouncement(tasks=[m.Task(task_id='t1', value=1.0)])
    response = node.requests.submit_tasks(SubmitTasks.Request(announcement=announced),
                                          SubmitTasks.Response())
    assert response.accepted == ['t1']
    node.persistence._retry += 1000.0  # it is not tried again in time
    database.execute('PRAGMA query_only = OFF')
    node.destroy_node()
    rclpy.shutdown()
    saved = Persistence(str(tmp_path), print).saved
    assert [record.task.id for record in saved.tasks] == ['t1']


def test_no_step_looks_at_all_tasks_again_before_what_is_new_is_saved_and_published(
        domain, tmp_path, monkeypatch):
    rclpy.init(args=['--ros-args', '-p', f'state_dir:={tmp_path}', '--log-level', 'fatal'])
    node = AllocatorNode()
    ticks, tick = [], node.core.tick
    monkeypatch.setattr(node, 'leads', lambda: True)
    monkeypatch.setattr(node.pacing, 'is_due', lambda now: True)
    monkeypatch.setattr(node.core, 'tick', lambda *times: ticks.append(times) or tick(*times))
    node.on_tasks(m.TaskAnnouncement(tasks=[
        m.Task(task_id=f't{k}', value=1.0) for k in range(1600)]))  # 500 are saved in a step
    counts = []
    for _ in range(5):
        node.on_step()
        counts.append((len(ticks), node.pending))
    assert counts == [(1, True), (1, True), (1, True), (1, False), (2, False)]
    node.destroy_node()
    rclpy.shutdown()
    assert len(Persistence(str(tmp_path), print).saved.tasks) == 1600
