# SPDX-License-Identifier: Apache-2.0
"""Orders of operators to a real allocator: services, the command, holds, restarts."""
import os
import signal
import subprocess
import sys

import pytest
from test_allocator import Fleet, add, task
from uav_task_alloc_msgs import msg as m, srv

from uav_task_alloc.nodes.conversions.messages import LATCHED

pytestmark = pytest.mark.ros


@pytest.fixture
def fleet(start, probe, tmp_path):
    fleet = Fleet(probe)
    fleet.start = lambda *more: start(
        'allocator', '-p', f'state_dir:={tmp_path}/state', '-p', 'uav_timeout:=60.0', '-p',
        'route_end:=hold', *more)
    fleet.allocator = fleet.start()
    fleet.uav('a', 0.0)
    fleet.uav('b', 1000.0)
    fleet.holds = probe.collect(m.UavHold, 'a/hold', LATCHED)
    fleet.tasks.publish(add(task('t1', 100), task('t2', 200), task('t3', 900)))
    probe.until(lambda: fleet.route('a') == ['t1', 't2'] and fleet.route('b') == ['t3'], 150.0,
                lambda: fleet.allocator.output())
    return fleet


def order(fleet, kind, name, **fields):
    return fleet.probe.call(kind, f'allocator/{name}', kind.Request(operator_name='ann', **fields))


def test_an_order_is_priced_given_kept_over_a_kill_and_undone(fleet):
    probe = fleet.probe
    before = dict(fleet.lists)
    dry = order(fleet, srv.PinTask, 'pin_task', task_id='t1', uav_id='b', dry_run=True)
    assert (dry.success, dry.order_id) == (True, '')
    assert dry.extra_distance > 100.0
    assert fleet.lists == before
    given = order(fleet, srv.PinTask, 'pin_task', task_id='t1', uav_id='b')
    assert (given.success, given.order_id) == (True, 'o1'), given.message
    probe.until(lambda: 't1' in fleet.route('b') and 't1' not in fleet.route('a'))
    refused = order(fleet, srv.ForbidTask, 'forbid_task', task_id='t1', uav_id='b')
    assert not refused.success
    assert 'it contradicts order o1 of ann (pin t1 to b)' in refused.message
    paused = order(fleet, srv.PauseUav, 'pause_uav', uav_id='a', keep_tasks=True)
    assert paused.success
    probe.until(lambda: fleet.holds and fleet.holds[-1].hold)
    assert fleet.holds[-1].reason == 'order o2 of ann'
    fleet.allocator.stop(signal.SIGKILL)
    fleet.holds.clear()
    fleet.allocator = fleet.start()
    probe.until(lambda: fleet.holds and fleet.holds[-1].hold)
    assert order(fleet, srv.UndoOrder, 'undo_order', order_id='o2').success
    probe.until(lambda: not fleet.holds[-1].hold)
    assert order(fleet, srv.UndoOrder, 'undo_order', order_id='o1').success
    code, text = fleet.allocator.stop()
    assert code == 0
    assert 'ann: undo o2; before: pause a (order o2 of ann); after: free' in text


def facts(proposal):
    return (proposal.plan.revision, proposal.base_revision, proposal.deadline, proposal.changes,
            [[each.task.task_id for each in tasks.tasks] for tasks in proposal.plan.lists])


def test_a_plan_waits_for_approval_over_a_kill_and_is_applied_once(fleet):
    probe = fleet.probe
    fleet.allocator.stop()
    more = ('-p', 'approval:=replan', '-p', 'approval_timeout:=600.0')
    fleet.allocator = fleet.start(*more)
    proposals = probe.collect(m.PlanProposal, 'plan_proposal', LATCHED)
    fleet.tasks.publish(add(task('t4', 300)))
    probe.until(lambda: proposals and proposals[-1].plan.lists, 150.0)
    proposed = proposals[-1]
    assert fleet.route('a') == ['t1', 't2']
    assert proposed.changes[0].startswith('a gains t4 (new): 2 -> 3 tasks')
    fleet.allocator.stop(signal.SIGKILL)
    proposals.clear()
    fleet.allocator = fleet.start(*more)
    probe.until(lambda: proposals, 150.0)
    assert facts(proposals[-1]) == facts(proposed)  # NaN of a task differs from itself
    stale = order(fleet, srv.ApprovePlan, 'approve_plan', revision=1, accept=True)
    assert not stale.success
    assert f'expected {proposed.plan.revision}' in stale.message
    probe.until(lambda: 'ann: accept plan 1 refused: revision = 1: expected '
                in fleet.allocator.output())

    def accept():  # refused until both UAVs have reported since the restart
        done = command('accept', str(proposed.plan.revision), '--operator', 'bob')
        assert done.stderr == '' or 'have not reported yet' in done.stderr
        return done.returncode == 0

    probe.until(accept)
    probe.until(lambda: fleet.route('a') == ['t1', 't2', 't4'])
    probe.until(lambda: not proposals[-1].plan.lists)
    assert proposals[-1].changes == [f'plan {proposed.plan.revision}: accepted by bob']
    assert not order(fleet, srv.ApprovePlan, 'approve_plan', accept=True,
                     revision=proposed.plan.revision).success


def test_bad_requests_are_refused_with_the_field(fleet):
    for kind, name, fields, why in (
            (srv.PinTask, 'pin_task', {'task_id': 't 1', 'uav_id': 'a'}, 'task_id'),
            (srv.PinTask, 'pin_task', {'task_id': 't1', 'uav_id': ''}, 'uav_id'),
            (srv.OrderTasks, 'order_tasks', {'task_ids': ['t1'], 'uav_id': 'x'}, "uav_id = 'x'"),
            (srv.PauseUav, 'pause_uav', {'uav_id': 'a', 'revision': 77}, 'revision = 77'),
            (srv.ResumeUav, 'resume_uav', {'uav_id': 'c'}, "uav_id = 'c'"),
            (srv.ReturnUav, 'return_uav', {'uav_id': 'c'}, "uav_id = 'c'"),
            (srv.UndoOrder, 'undo_order', {'order_id': 'o9'}, "order_id = 'o9'")):
        answer = order(fleet, kind, name, **fields)
        assert not answer.success
        assert answer.message.startswith('refused: ')
        assert why in answer.message


def command(*args):
    return subprocess.run([sys.executable, '-m', 'uav_task_alloc', 'order', *args],
                          capture_output=True, text=True, timeout=60, env=os.environ)


def test_the_command_gives_orders_and_prints_their_log(fleet, tmp_path):
    dry = command('pin', 't1', 'b', '--dry-run')
    assert (dry.returncode, dry.stderr) == (0, '')
    assert dry.stdout.startswith('dry run: pin t1 to b: +')
    assert command('next', 'b', 't2', 't3', '--operator', 'bob').returncode == 0
    fleet.probe.until(lambda: fleet.route('b')[:2] == ['t2', 't3'])
    refused = command('pin', 't9', 'b')
    assert (refused.returncode, refused.stdout) == (1, '')
    assert "refused: task_id = 't9': expected an accepted task" in refused.stderr
    assert command('return', 'all', '--operator', 'bob').returncode == 0
    fleet.probe.until(lambda: fleet.route('a') == fleet.route('b') == [])
    log = command('log', f'{tmp_path}/state')
    assert log.returncode == 0
    assert '  bob  order b: t2 t3; before: t2 ASSIGNED on a; t3 ASSIGNED on b' in log.stdout
    assert '  bob  return a, b; before: ' in log.stdout


def test_a_name_that_no_node_can_have_is_one_line():
    done = subprocess.run([sys.executable, '-m', 'uav_task_alloc', 'order', 'pause', 'a',
                           '--allocator', 'bad name'], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert done.stderr.count('\n') == 1
    assert "--allocator = 'bad name': expected the full name of a node" in done.stderr
