# SPDX-License-Identifier: Apache-2.0
"""Lists that a UAV may have on board are kept: from the one it reports to the one in force."""
from allocation import AllocatorDriver

from uav_task_alloc.allocator.sent_lists import SentLists


class Sent(AllocatorDriver):
    """One UAV that gets a list for each task that is added."""

    def __init__(self):
        super().__init__()
        self.uav('u1', 0.0, 0.0, 0.0)
        self.kept = SentLists(self.world)
        self.kept.update()

    def revision(self):
        return self.world.list_of('u1').revision

    def send(self, name, place):
        self.add((name, place, 0.0))
        self.settle(5.0)  # so long that the list is not limited in rate
        self.kept.update()


def test_lists_before_the_reported_one_are_forgotten():
    sent = Sent()
    sent.send('t1', 100.0)
    first = sent.revision()
    sent.send('t2', 200.0)
    second = sent.revision()
    assert second > first
    assert sent.kept.sent('u1', first).task_ids == ('t1',)
    assert sent.kept.sent('u1', second).task_ids == ('t1', 't2')
    sent.uav('u1', 0.0, 0.0, 0.0, list_revision=second)
    sent.kept.update()
    assert sent.kept.sent('u1', first) is None
    assert sent.kept.sent('u1', second).task_ids == ('t1', 't2')


def test_a_list_stays_while_it_is_reported_however_many_follow():
    sent = Sent()
    sent.send('t0', 100.0)
    first = sent.revision()
    sent.uav('u1', 0.0, 0.0, 0.0, list_revision=first)
    for k in range(1, 60):
        sent.send(f't{k}', 100.0 + k)
    assert sent.kept.sent('u1', first).task_ids == ('t0',)
    assert sent.kept.sent('u1', first + 1) is None
    assert len(sent.kept.sent('u1', sent.revision()).task_ids) == 60


def test_nothing_is_kept_of_a_uav_that_is_forgotten():
    sent = Sent()
    sent.send('t1', 100.0)
    revision = sent.revision()
    sent.world.forget_uav('u1')
    sent.kept.update()
    assert sent.kept.sent('u1', revision) is None
