# SPDX-License-Identifier: Apache-2.0
"""The services of an allocator on a stand-in of its node: what is answered, and saved before."""
from types import SimpleNamespace

import pytest
from allocation import AllocatorDriver
from std_srvs.srv import Trigger
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SetAvailability, SubmitTasks

from uav_task_alloc.allocator.records import TaskVerdict
from uav_task_alloc.nodes.ros.allocator_services import AllocatorServices

pytestmark = pytest.mark.ros


@pytest.fixture
def made():
    """Services of a world with UAV a; `saves` counts, `conflict` is why no lists are published."""
    state = SimpleNamespace(driver=AllocatorDriver(), saves=0, conflict='', offered=[],
                            verdicts=[])
    state.driver.uav('a', 0.0, 0.0, 50.0)

    def save():
        state.saves += 1

    node = SimpleNamespace(create_service=lambda kind, name, callback: state.offered.append(
        (name, callback)))
    state.services = AllocatorServices(node, state.driver.world, lambda msg: state.verdicts, save,
                                       lambda: state.conflict)
    return state


def test_it_offers_four_services(made):
    assert len(made.services.offer()) == 4
    assert [name for name, _ in made.offered] == [
        '~/submit_tasks', '~/replan', '~/forget_demand', '~/set_availability']


def test_an_announcement_is_saved_and_answered(made):
    made.verdicts = [TaskVerdict('t1', True), TaskVerdict('t2', False, 'no')]
    response = made.services.submit_tasks(
        SubmitTasks.Request(announcement=m.TaskAnnouncement()), SubmitTasks.Response())
    assert (response.accepted, response.rejected, response.reasons) == (['t1'], ['t2'], ['no'])
    assert made.saves == 1


def test_availability_is_saved_and_answered(made):
    answers = []
    for uav_id, available in (('a', False), ('a', True), ('unknown', True)):
        answer = made.services.set_availability(SetAvailability.Request(
            uav_id=uav_id, available=available), SetAvailability.Response())
        answers.append((answer.success, answer.message))
    assert answers == [(True, 'a is not available'), (True, 'a is available'),
                       (False, "uav_id = 'unknown': expected a known UAV")]
    assert made.saves == 3


def test_a_plan_is_requested_but_the_answer_says_why_none_follows(made):
    version = made.driver.world.version
    answer = made.services.replan(Trigger.Request(), Trigger.Response())
    assert (answer.success, answer.message) == (True, 'a new plan follows on `allocation`')
    made.conflict = 'origins differ'
    answer = made.services.replan(Trigger.Request(), Trigger.Response())
    assert (answer.success, answer.message) == (False, 'nothing is planned: origins differ')
    assert made.driver.world.version == version + 2


def test_the_answer_says_how_many_announcements_are_forgotten(made):
    answer = made.services.forget_demand(Trigger.Request(), Trigger.Response())
    assert (answer.success, answer.message, made.saves) == (True, '0 announcements forgotten', 1)
