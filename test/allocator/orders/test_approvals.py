# SPDX-License-Identifier: Apache-2.0
"""The open proposal alone: opened, replaced, decided, and what was rejected stays so."""
from types import SimpleNamespace

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.records import Proposal
from uav_task_alloc.allocator.replanning.approvals import Approvals
from uav_task_alloc.model import Leg


@pytest.fixture
def made():
    """A world with UAV a and tasks t1 to t3, its approvals, and `proposal(task_ids)`."""
    driver = AllocatorDriver(approval='all')
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0), ('t3', 300, 0))
    driver.take()
    driver.notes.clear()

    def proposal(*task_ids, begin_after=0.0):
        stops = tuple(ListStop(driver.world.task_records()[task_id].task, Leg((), 100.0), 10.0,
                               begin_after=begin_after) for task_id in task_ids)
        return Proposal(0, 0, (UavList('a', 0, stops, stamp=1000.0),), 'ADD t1', 1000.0, 1030.0,
                        False, (f'a gains {len(task_ids)}',))

    return SimpleNamespace(driver=driver, world=driver.world, proposal=proposal,
                           approvals=Approvals(driver.world))


def notes(made):
    return [note.text for note in made.world.outbox.notes]


def test_a_proposal_is_opened_under_the_next_revision(made):
    assert made.approvals.propose(made.proposal('t1')) == 'waits for the approval of plan 1'
    assert made.world.proposal.revision == 1
    assert made.world.outbox.proposal is made.world.proposal
    assert notes(made) == ['plan 1 (ADD t1) waits for approval: a gains 1']
    assert made.approvals.quiet


def test_the_same_one_is_not_opened_again(made):
    made.approvals.propose(made.proposal('t1'))
    opened = made.world.proposal
    assert made.approvals.propose(made.proposal('t1')) == 'waits for the approval of plan 1'
    assert made.world.proposal is opened


def test_another_one_replaces_it_and_says_so(made):
    made.approvals.propose(made.proposal('t1'))
    made.approvals.propose(made.proposal('t1', 't2'))
    assert made.world.proposal.revision == 2
    assert made.world.proposal.changes == ('a gains 2', 'replaces plan 1')
    assert notes(made)[-1].startswith('plan 2 (ADD t1) waits for approval, replaces 1: ')


def test_without_a_change_it_is_withdrawn(made):
    assert made.approvals.propose(None) == ''
    assert made.world.outbox.proposal is None
    made.approvals.propose(made.proposal('t1'))
    assert made.approvals.propose(None) == ''
    assert made.world.proposal is None
    closed = made.world.outbox.proposal
    assert (closed.lists, closed.changes) == (
        (), ('plan 1: withdrawn: a newer plan needs no approval',))


def test_what_was_rejected_is_not_proposed_again_but_for_other_tasks(made):
    made.approvals.propose(made.proposal('t1'))
    made.approvals.reject('ann')
    assert notes(made)[-1] == 'plan 1: rejected by ann'
    assert made.approvals.propose(made.proposal('t1')) == 'plan 1 with it was rejected'
    assert made.world.proposal is None
    assert made.approvals.propose(made.proposal('t2')) == 'waits for the approval of plan 2'


def test_no_plan_is_sought_after_a_rejection_until_something_has_changed(made):
    made.approvals.propose(made.proposal('t1'))
    made.approvals.reject('')
    assert notes(made)[-1] == 'plan 1: rejected: its time is over'
    assert not made.approvals.quiet
    made.world.request_replan('plan 1 rejected', 1000.0)
    assert made.approvals.quiet
    made.world.request_replan('another event', 1000.0)
    assert not made.approvals.quiet


def test_only_the_open_revision_can_be_decided(made):
    assert made.approvals.refusal(1) == 'no plan waits for approval'
    made.approvals.propose(made.proposal('t1'))
    assert made.approvals.refusal(1) == ''
    assert made.approvals.refusal(4) == (
        'revision = 4: expected 1, that of the plan that waits for approval')


def test_its_times_move_with_the_published_clock(made):
    made.approvals.clock_jumped(10.0)  # none is open
    made.approvals.propose(made.proposal('t1', begin_after=1010.0))
    made.approvals.clock_jumped(500.0)
    shifted = made.world.proposal
    assert (shifted.stamp, shifted.deadline, shifted.lists[0].stamp) == (1500.0, 1530.0, 1500.0)
    assert shifted.lists[0].stops[0].begin_after == 1510.0
    assert not made.approvals.expired(1529.0)
    assert made.approvals.expired(1530.0)
