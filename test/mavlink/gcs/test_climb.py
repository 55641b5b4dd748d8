# SPDX-License-Identifier: Apache-2.0
"""A climb after a take-off of the bridge is completed, whatever comes between."""
import pytest
from authority_bench import BOTH, MODES, AuthorityBench, H, L, sends_no_command
from mission_bench import task_list
from pymavlink.dialects.v20 import ardupilotmega as d

POSITIONS = ('EXTENDED_SYS_STATE', 'GLOBAL_POSITION_INT', 'LOCAL_POSITION_NED')


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


@pytest.mark.parametrize('state_lost', [False, True])
@BOTH
def test_a_take_off_whose_answer_is_lost_is_no_refusal(kind, state_lost):
    """ArduPilot refuses the second command, as it climbs by the first one."""
    bench = AuthorityBench(kind, cruise_altitude=100.0,
                           configs={1: {'climb_rate': 2.5}}).discover()
    lost = []

    def lose(direction, message, now):
        kind_of = message.get_type()
        if kind_of == 'COMMAND_ACK' and message.command == d.MAV_CMD_NAV_TAKEOFF:
            lost.append(now)
            return [] if len(lost) == 1 else None
        mute = state_lost and lost and now < lost[0] + 7.0
        return [] if mute and kind_of in POSITIONS else None

    bench.line.tampers.append(lose)
    bench.assign(task_list('ABC'))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == MODES[kind].mission, 120.0)
    assert lost
    assert bench.vehicles[1].flight.body.position[2] >= 89.0
    assert bench.authority() is H
    assert state_lost or not any('take off' in note for note in bench.notes)
