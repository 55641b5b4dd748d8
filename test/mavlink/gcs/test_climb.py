# SPDX-License-Identifier: Apache-2.0
"""A climb after a take-off of the bridge is completed, whatever comes between."""
import pytest
from authority_bench import BOTH, MODES, AuthorityBench, H, L, sends_no_command
from mission_bench import task_list


def climbing_to_100_m(kind):
    bench = AuthorityBench(kind, cruise_altitude=100.0,
                           configs={1: {'climb_rate': 2.5}}).discover()
    bench.assign(task_list('EABC'))
    assert bench.run(lambda: bench.vehicles[1].flight.body.position[2] > 6.0, 60.0)
    return bench


@BOTH
@pytest.mark.parametrize('what', ['link', 'restart', 'failsafe', 'list'])
def test_mission_mode_is_set_only_at_the_height_of_the_take_off(kind, what):
    bench = climbing_to_100_m(kind)
    if what == 'link':
        bench.line.cut = True
        bench.run(limit=4.0)
        bench.line.cut = False
    elif what == 'restart':
        bench.kill_and_restart(2.0)
        bench.assign(task_list('EABC', 2))
    elif what == 'failsafe':
        bench.vehicles[1].failsafe('radio', None)
        bench.run(limit=3.0)
        bench.vehicles[1].failsafe_over()
    else:
        bench.assign(task_list('ABC', 2))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == MODES[kind].mission, 120.0)
    assert bench.vehicles[1].flight.body.position[2] >= 89.0
    assert bench.authority() is H
    assert bench.run(lambda: 'A' in bench.completed(), 200.0)


@BOTH
def test_a_long_climb_is_completed(kind):
    bench = AuthorityBench(kind, cruise_altitude=400.0,
                           configs={1: {'climb_rate': 2.5}}).discover()
    bench.assign(task_list('A'))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == MODES[kind].mission, 300.0)
    assert bench.vehicles[1].flight.body.position[2] >= 355.0


@pytest.mark.parametrize('kind', ['ardupilot'])
def test_a_climb_that_another_ended_while_suspended_is_a_loss(kind):
    bench = climbing_to_100_m(kind)
    bench.vehicles[1].failsafe('radio', None)
    bench.run(limit=3.0)
    bench.vehicles[1].flight.track = None  # as when a mode was set, and set back, unseen
    bench.vehicles[1].failsafe_over()
    assert bench.reaches(L, 20.0)
    assert sends_no_command(bench)
