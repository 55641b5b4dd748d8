# SPDX-License-Identifier: Apache-2.0
"""Landing, `relaunch`, and arming by others."""
import pytest
from authority_bench import (
    BOTH,
    MODES,
    AuthorityBench,
    H,
    L,
    N,
    S,
    armed_by_us,
    flying,
    keeps_quiet,
    lost,
    on_ground,
    shows,
)
from mission_bench import task_list

BY_HAND = '; given back by ~/hand_over'


# landing, relaunch

@BOTH
@pytest.mark.parametrize('end', ['item', 'mode'])
@pytest.mark.parametrize('relaunch', ['operator', 'automatic'])
def test_after_our_landing_it_starts_again_as_relaunch_says(kind, relaunch, end):
    bench = AuthorityBench(kind, relaunch=relaunch).discover()
    bench.assign(task_list('A', returns=end == 'item'))
    assert bench.run(lambda: bench.completed() == ['A'], 60.0)
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=5.0)
    if relaunch == 'operator':
        assert shows(bench, N, 'landed')
        assert bench.state().reason.endswith(BY_HAND)
        assert keeps_quiet(bench)
        for takeoff in (False, True):
            bench.wants(takeoff=takeoff)
            bench.run(limit=2.0)
        assert shows(bench, N)
        assert 'waits for ~/hand_over: it has landed' in bench.notes
        assert bench.hand_over() == ''
    assert bench.authority() is H
    bench.assign(task_list('B', 9))
    assert bench.run(lambda: bench.completed() == ['A', 'B'], 100.0)


@BOTH
def test_after_a_landing_a_restarted_bridge_waits_for_the_hand_over_too(kind):
    bench = flying(kind, 'A')
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    bench.run(limit=3.0)
    bench.dead_for(3.0)
    assert keeps_quiet(bench)
    assert bench.state().reason.endswith(BY_HAND)


@BOTH
def test_while_it_is_suspended_a_landing_of_ours_is_a_loss(kind):
    bench = flying(kind, 'A')
    bench.assign(task_list('', 2, returns=True))
    assert bench.run(lambda: bench.vehicles[1].flight.custom_mode == MODES[kind].rtl, 60.0)
    bench.run(limit=2.0)
    bench.vehicles[1].failsafe('radio', None)
    assert bench.becomes(S)
    assert bench.becomes(L, 60.0)
    assert keeps_quiet(bench, 20.0)


@BOTH
@pytest.mark.parametrize('relaunch', ['operator', 'automatic'])
def test_a_landing_of_the_pilot_gives_nothing(kind, relaunch):
    bench = lost(kind, relaunch=relaunch)
    bench.vehicles[1].rc_mode(MODES[kind].land)
    assert bench.run(lambda: not bench.vehicles[1].flight.armed, 100.0)
    assert keeps_quiet(bench)
    assert bench.authority() is L


# arming by others

@BOTH
@pytest.mark.parametrize('state', [H, S])
def test_armed_by_another_it_is_a_loss(kind, state):
    bench = on_ground(kind, state)
    bench.vehicles[1].rc_arm(True)
    assert bench.becomes(L, 3.0)
    assert shows(bench, L, 'armed, not by the bridge')
    assert keeps_quiet(bench)


@BOTH
@pytest.mark.parametrize('state', [L, N])
def test_armed_and_disarmed_by_another_changes_nothing_where_it_is_not_ours(kind, state):
    bench = on_ground(kind, state)
    for armed in (True, False):
        bench.vehicles[1].rc_arm(armed)
        bench.run(limit=3.0)
        assert bench.authority() is state
    assert keeps_quiet(bench, 20.0)


@BOTH
def test_disarmed_by_another_after_our_arming_it_is_a_loss(kind):
    bench = armed_by_us(on_ground(kind, H))
    bench.vehicles[1].rc_arm(False)
    assert bench.run(lambda: bench.authority() is L, 3.0)
    assert keeps_quiet(bench)
    assert shows(bench, L, 'disarmed, not by the bridge')


@BOTH
def test_a_vehicle_that_disarms_itself_before_its_take_off_is_a_loss(kind):
    bench = armed_by_us(on_ground(kind, H))
    bench.line.tampers.append(lambda way, m, now: [] if way == 'up' and (
        m.get_type() == 'COMMAND_LONG' and m.command == 400) else None)
    assert bench.run(lambda: bench.authority() is L, 20.0)
    assert keeps_quiet(bench)
    assert shows(bench, L, 'disarmed, not by the bridge')


@BOTH
def test_an_arming_of_ours_that_comes_late_gives_nothing_back(kind):
    bench = on_ground(kind, H)
    bench.line.tampers.append(lambda way, m, now: [(5.0, m)] if way == 'up' and (
        m.get_type() == 'COMMAND_LONG' and m.command == 400) else None)
    bench.assign(task_list('AB', 2))
    bench.run(limit=1.5)
    bench.wants(takeoff=False)
    bench.run(limit=0.2)
    assert bench.authority() is N
    assert keeps_quiet(bench)
