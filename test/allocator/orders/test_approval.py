# SPDX-License-Identifier: Apache-2.0
"""Plans that wait for an operator: what is proposed, decided, replaced, and what never waits."""
import pytest
from allocation import AllocatorDriver

from uav_task_alloc import plan
from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.model import Task, ThreatZone


def make(approval, saved=None, **more):
    driver = AllocatorDriver(saved, plan, approval=approval, uav_timeout=5.0, **more)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 1000.0, 0.0, 50.0)
    return driver


@pytest.fixture
def driver():
    driver = make('replan')
    driver.add(('t1', 100, 0), ('t2', 200, 0), ('t3', 900, 0))
    driver.settle()
    assert (driver.route('a'), driver.route('b')) == (('t1', 't2'), ('t3',))
    return driver


def decide(driver, accept, operator='ann'):
    driver.core.decide(accept, operator, driver.now, driver.now)
    driver.take()
    driver.settle()


def test_the_first_tasks_of_a_uav_need_approval_only_with_all(driver):
    assert driver.proposals == []
    driver = make('all')
    driver.add(('t1', 100, 0))
    driver.settle()
    assert 'a' not in driver.lists
    assert (driver.state('t1'), driver.reason('t1')) == (
        'UNASSIGNED', 'waits for the approval of plan 1')
    decide(driver, accept=True)
    assert driver.route('a') == ('t1',)
    assert driver.allocations[-1].trigger == 'plan 1 accepted by ann'
    assert driver.allocations[-1].plan.unassigned == {}


@pytest.mark.parametrize('route_end', ['hold', 'home'])
def test_what_asks_nothing_of_a_uav_needs_no_approval(route_end):
    driver = make('all', route_end=route_end)
    driver.settle()
    assert driver.proposals == []
    driver.add(('t1', 100, 0))
    driver.settle()
    proposal, = driver.proposals
    assert [each.uav for each in proposal.lists] == ['a']
    assert len(proposal.changes) == 2


def test_a_new_plan_is_proposed_and_the_fleet_flies_on(driver):
    driver.add(('t4', 300, 0))
    driver.settle()
    assert (driver.route('a'), driver.route('b')) == (('t1', 't2'), ('t3',))
    proposal, = driver.proposals
    assert [each.task_ids for each in proposal.lists] == [('t1', 't2', 't4')]
    assert proposal.changes == ('a gains t4 (new): 2 -> 3 tasks, +100 m',
                                'in all +100 m, the last UAV ends +13 s')
    assert proposal.base_revision < proposal.revision
    assert not proposal.accepted_on_timeout
    assert driver.reason('t4') == f'waits for the approval of plan {proposal.revision}'
    decide(driver, accept=True)
    assert driver.route('a') == ('t1', 't2', 't4')
    assert (driver.proposals[-1].lists, driver.proposals[-1].changes) == (
        (), (f'plan {proposal.revision}: accepted by ann',))


def test_a_rejected_plan_is_not_proposed_again(driver):
    driver.add(('t4', 300, 0))
    driver.settle()
    decide(driver, accept=False)
    driver.world.request_replan('replan service', driver.now)
    driver.settle()
    assert [len(each.lists) for each in driver.proposals] == [1, 0]
    assert driver.route('a') == ('t1', 't2')
    assert driver.reason('t4') == f'plan {driver.proposals[0].revision} with it was rejected'
    driver.add(('t5', 400, 0))
    driver.settle()
    assert len(driver.proposals) == 3


@pytest.mark.parametrize(('on_timeout', 'route'), [
    ('accept', ('t1', 't2', 't4')), ('reject', ('t1', 't2'))])
def test_the_deadline_decides_as_stated(on_timeout, route):
    driver = make('replan', approval_on_timeout=on_timeout, approval_timeout=20.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0))
    driver.settle()
    driver.add(('t4', 300, 0))
    driver.settle()
    assert driver.proposals[-1].accepted_on_timeout == (on_timeout == 'accept')
    for _ in range(6):
        driver.settle(wait=3.0)
    assert driver.route('a') == ('t1', 't2')
    driver.settle(wait=3.0)
    assert driver.route('a') == route
    assert driver.proposals[-1].changes[0].endswith(f'{on_timeout}ed: its time is over')


def test_a_newer_proposal_replaces_the_open_one_visibly(driver):
    driver.add(('t4', 300, 0))
    driver.settle()
    first = driver.proposals[-1]
    driver.add(('t5', 800, 0))
    driver.settle()
    second = driver.proposals[-1]
    assert f'replaces plan {first.revision}' in second.changes
    assert driver.core.approvals.refusal(first.revision) == (
        f'revision = {first.revision}: expected {second.revision}, that of the plan that waits '
        'for approval')
    decide(driver, accept=True)
    assert {'t4', 't5'} <= {*driver.route('a'), *driver.route('b')}


def test_a_lost_uav_is_never_held_up(driver):
    driver.settle(wait=4.0, report=False)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.settle(wait=2.0, report=False)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.settle(report=False)
    assert (driver.route('a'), driver.route('b')) == (('t1', 't2', 't3'), ())
    assert 'without approval for safety' in driver.allocations[-1].trigger
    assert 'b is silent' in driver.allocations[-1].trigger


def test_a_zone_across_a_leg_is_never_held_up(driver):
    dome = ThreatZone.cylinder('dome', (150.0, 0.0), 30.0)
    driver.world.set_zones([dome], (), driver.now)
    driver.settle()
    assert driver.lists['a'].revision > 1
    assert driver.proposals == []
    assert any(stop.leg.via for stop in driver.lists['a'].stops)


def test_a_cancelled_task_leaves_its_list_at_once(driver):
    driver.add(('t4', 300, 0))
    driver.settle()
    driver.cancel('t2')
    driver.settle()
    assert driver.route('a') == ('t1',)
    assert driver.world.proposal is not None


def test_what_was_flown_meanwhile_is_not_flown_again(driver):
    driver.add(('t4', 300, 0))
    driver.settle()
    assert driver.event('STARTED', 't1', 'a') == ''
    assert driver.event('COMPLETED', 't1', 'a') == ''
    driver.settle()
    decide(driver, accept=True)
    assert driver.route('a') == ('t2', 't4')


def test_an_order_goes_out_at_once(driver):
    assert driver.order('PIN', 'b', 't1').success
    driver.settle()
    assert 't1' in driver.route('b')
    assert 't1' not in driver.route('a')


@pytest.mark.parametrize(('action', 'uav_id', 'routes'), [
    ('PIN', 'b', (('t2',), ('t3', 't1'))), ('FORBID', 'a', (('t2',), ('t3', 't1'))),
    ('ORDER', 'b', (('t2',), ('t1', 't3')))])
@pytest.mark.parametrize('approval', ['replan', 'all'])
def test_a_task_that_an_order_moves_waits_for_no_approval(approval, action, uav_id, routes):
    driver = AllocatorDriver(approval=approval, uav_timeout=5.0)  # no other task moves
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 1000.0, 0.0, 50.0)
    driver.add(('t1', 100, 0), ('t2', 200, 0), ('t3', 900, 0))
    driver.settle()
    if approval == 'all':
        decide(driver, accept=True)
    assert driver.order(action, uav_id, 't1').success
    driver.settle()
    assert (driver.route('a'), driver.route('b')) == routes
    assert driver.world.proposal is None
    driver.add(('t4', 950, 0))
    driver.settle()
    assert driver.reason('t4').startswith('waits for the approval of plan')
    assert driver.order('PIN', 'b', 't4').success  # it has no UAV yet
    driver.settle()
    assert 't4' in driver.route('b')
    assert driver.world.proposal is None


def test_an_open_proposal_outlives_a_restart_and_is_applied_once(driver):
    driver.add(('t4', 300, 0))
    driver.settle()
    driver.core.nothing_written()
    state = restored_state(driver.core.rows())
    assert state.unreadable == []
    assert state.proposal == driver.world.proposal
    again = make('replan', state)
    again.settle(wait=4.0)
    assert again.route('a') == ('t1', 't2')
    assert again.proposals[0] == state.proposal
    decide(again, accept=True)
    assert again.route('a') == ('t1', 't2', 't4')
    again.core.nothing_written()
    assert restored_state(again.core.rows()).proposal is None


def test_the_first_proposal_of_a_fleet_waits_after_a_restart_until_its_uavs_report():
    driver = make('all')
    driver.add(('t1', 100, 0), ('t2', 900, 0))
    driver.settle()
    driver.core.nothing_written()
    again = AllocatorDriver(restored_state(driver.core.rows()), plan, approval='all',
                            uav_timeout=5.0)
    revision = again.world.proposal.revision
    again.settle(wait=1.0)
    assert again.core.awaited(again.now) == ['a', 'b']
    again.uav('a', 0.0, 0.0, 50.0)
    again.settle(wait=1.0)
    again.uav('b', 1000.0, 0.0, 50.0)
    again.settle(wait=4.0)
    assert again.world.proposal.revision == revision
    assert again.desk().approve(revision, True, 'ann', False, again.now, again.now).success
    again.settle()
    assert (again.route('a'), again.route('b')) == (('t1',), ('t2',))


def test_a_proposal_is_not_accepted_before_its_uavs_have_reported(driver):
    driver.add(('t4', 300, 0))
    driver.settle()
    driver.core.nothing_written()
    again = AllocatorDriver(restored_state(driver.core.rows()), plan, approval='replan',
                            uav_timeout=5.0)
    revision = again.world.proposal.revision

    def approve():
        return again.desk().approve(revision, True, 'ann', False, again.now, again.now)

    early = approve()
    assert (early.success, early.message) == (
        False, 'refused: after the restart a, b have not reported yet: try again when they have')
    again.uav('a', 0.0, 0.0, 50.0)
    again.uav('b', 1000.0, 0.0, 50.0)
    again.settle()
    assert approve().success
    again.settle()
    assert again.route('a') == ('t1', 't2', 't4')


def test_without_approval_an_open_proposal_goes_out(driver):
    driver.add(('t4', 300, 0))
    driver.settle()
    driver.world.set_params(type(driver.world.params)(
        route_end='hold', background_budget=0.0, list_interval=0.0), driver.now)
    driver.settle()
    assert driver.route('a') == ('t1', 't2', 't4')
    assert driver.world.proposal is None


def with_trips(approval, **more):
    """Two UAVs in flight whose batteries may be changed."""
    driver = AllocatorDriver(None, plan, approval=approval, trips=2, uav_timeout=3600.0,
                             approval_timeout=1e4,
                             **{'route_end': 'home', 'objective': 'balanced', **more})
    report(driver)
    return driver


def report(driver, metres=8000.0):
    for uav_id, x in (('a', 0.0), ('b', 1000.0)):
        driver.uav(uav_id, x, 0.0, 50.0, home=(x, 0.0, 0.0), range=metres, full_range=metres,
                   endurance=900.0, battery=0.9, turnaround=60.0, climb_speed=2.5,
                   descent_speed=1.5, mode='ON_MISSION', authority='HELD',
                   active_task=(driver.world.list_of(uav_id).task_ids or ('',))[0])


def add(driver, *places, allowed=None):
    driver.add(*(Task(name, (x, 60.0, 50.0), allowed_uavs=allowed) for name, x in places))
    driver.settle(report=False)


def add_two_trips(driver):
    """Two tasks of which the battery of the only UAV that may fly them carries one."""
    report(driver, 1000.0)
    add(driver, ('t1', 350.0), ('t2', -350.0), allowed=frozenset({'a'}))


def routes(driver):
    return {uav_id: each.task_ids for uav_id, each in driver.world.lists_in_force().items()}


@pytest.mark.parametrize(('approval', 'at_once'), [('all', {}), ('replan', {'b': ('t3',)})])
def test_with_several_trips_a_plan_waits_too(approval, at_once):
    driver = with_trips(approval)
    add(driver, ('t1', 200.0))
    if approval == 'all':
        assert routes(driver) == {}
        decide(driver, accept=True)
    report(driver)
    add(driver, ('t2', 400.0), ('t3', 900.0))
    assert routes(driver) == {'a': ('t1',), **at_once}
    proposal = driver.world.proposal
    assert {'a': ('t1', 't2'), 'b': ('t3',)}.items() >= {
        each.uav: each.task_ids for each in proposal.lists}.items()
    assert (driver.state('t2'), driver.reason('t2')) == (
        'UNASSIGNED', f'waits for the approval of plan {proposal.revision}')
    decide(driver, accept=False)
    assert routes(driver) == {'a': ('t1',), **at_once}


def test_with_several_trips_no_task_is_on_two_uavs_while_a_plan_waits():
    driver = with_trips('replan', objective='finish', route_end='hold', locked_tasks=0)
    add(driver, ('t1', 200.0))
    report(driver)
    driver.add(Task('t1', (950.0, 60.0, 50.0)), action=AnnouncementAction.UPDATE)
    driver.settle(report=False)
    assert routes(driver) == {'a': ('t1',)}
    assert {each.uav: each.task_ids for each in driver.world.proposal.lists} == {
        'a': (), 'b': ('t1',)}


def test_later_trips_of_a_plan_wait_with_its_lists():
    driver = with_trips('all', route_end='hold')
    add_two_trips(driver)
    proposal = driver.world.proposal
    (last,), = proposal.later['a']
    assert (driver.world.later, driver.state(last)) == ({}, 'UNASSIGNED')
    driver.core.nothing_written()
    assert restored_state(driver.core.rows()).proposal == proposal
    decide(driver, accept=True)
    assert driver.world.later == proposal.later
    assert driver.lists['a'].returns
    assert (driver.state(last), driver.reason(last)) == (
        'ASSIGNED', 'after battery change 1 of a')


def test_uavs_that_wait_for_a_plan_keep_their_later_trips():
    driver = with_trips('all', route_end='hold')
    add_two_trips(driver)
    decide(driver, accept=True)
    before = routes(driver), driver.world.later
    assert before[1]
    report(driver, 1000.0)
    add(driver, ('t3', 0.0))
    assert driver.world.proposal is not None
    assert (routes(driver), driver.world.later) == before
    decide(driver, accept=False)
    assert (routes(driver), driver.world.later) == before
