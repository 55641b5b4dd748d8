# SPDX-License-Identifier: Apache-2.0
"""The state machine of authority: each cell, suspensions, kills, holds, and what may be sent."""
import itertools

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.authority import (
    _ENDS,
    _GIVEN_BACK_BY,
    _SUSPENDS,
    AUTHORITY_TABLE,
    PERMISSIONS,
    Authority,
    AuthorityEvent,
    HoldStage,
    SendAction,
    Suspension,
    table_text,
)
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.send_gate import action_of, allowed_messages

E = AuthorityEvent
N, H, S, L = (
    AuthorityState.NONE,
    AuthorityState.HELD,
    AuthorityState.SUSPENDED,
    AuthorityState.LOST,
)
# event -> the next state for HELD, SUSPENDED, LOST and NONE, independent of the code
CELLS = {
    E.GRANTED: (H, S, L, H), E.WITHDRAWN_IN_AIR: (H, S, L, N), E.WITHDRAWN: (N, S, L, N),
    E.OWN: (H, L, L, N), E.OWN_LANDING: (N, L, L, N), E.MISSION_ENDED: (H, L, L, N),
    E.UNEXPLAINED: (S, L, L, N), E.EXPLAINED: (H, H, L, N), E.TAKEN: (L, L, L, L),
    E.AVOIDING: (S, S, L, N), E.AVOIDED: (H, H, L, N), E.STICK_TO_HOLD: (H, L, H, H),
    E.TO_MISSION: (H, H, H, H), E.FAILSAFE_MODE: (L, L, L, N), E.FAILSAFE_STAYS: (S, S, L, N),
    E.FAILSAFE_OVER: (H, H, L, N), E.REPLACEMENT_TAKEN: (L, L, L, N),
    E.ARMED_BY_OTHER: (L, L, L, N),
    E.KILLED: (L, L, L, L), E.LINK_STALE: (S, S, L, N), E.LINK_BACK: (H, H, L, N),
    E.LINK_CHANGED: (L, L, L, N), E.NEW_ADDRESS: (S, S, L, N), E.REBOOTED: (H, S, L, N),
    E.REBOOTED_FLOWN: (L, L, L, N), E.BATTERY_CHANGED: (H, S, H, N),
    E.RESTART_AGREES: (H, H, L, N),
    E.RESTART_DIFFERS: (L, L, L, N), E.RESTART_OURS: (H, S, H, H),
    E.RESTART_AIRBORNE: (L, L, L, L), E.FOREIGN: (S, S, L, N), E.FOREIGN_OVER: (H, H, L, N),
    E.HAND_OVER: (H, S, H, H),
}
ENDS = {E.AVOIDED: E.AVOIDING, E.FAILSAFE_OVER: E.FAILSAFE_STAYS, E.LINK_BACK: E.LINK_STALE,
        E.FOREIGN_OVER: E.FOREIGN, E.EXPLAINED: E.UNEXPLAINED}


def authority_in(state, event=None):
    """In a state; SUSPENDED by what `event` ends, else by the link."""
    authority = Authority(0.0, AuthorityRecord(L if state is S else state))
    if state is H:
        authority.apply(E.RESTART_AGREES, 0.0)
    elif state is S:
        authority.apply(E.HAND_OVER, 0.0)
        authority.hold = HoldStage.NO
        authority.apply(ENDS.get(event, E.LINK_STALE), 0.0)
    assert authority.state is state
    return authority


def suspended(*events):
    authority = authority_in(H)
    for event in events:
        authority.apply(event, 1.0, event.name)
    assert authority.state is S
    return authority


@pytest.mark.parametrize('event', AuthorityEvent)
@pytest.mark.parametrize('column', range(4))
def test_each_event_leads_from_each_state_to_the_next_state_of_the_table(event, column):
    authority = authority_in((H, S, L, N)[column], event)
    before = authority.state, authority.why, authority.since, authority.hold
    authority.suspensions.pop(Suspension.RESTART, None)
    if event is E.RESTART_AGREES and authority.state is S:
        authority = Authority(0.0, AuthorityRecord(H))
    changed = authority.apply(event, 5.0, 'because')
    assert authority.state is CELLS[event][column]
    assert authority.held is (authority.state is H)
    if authority.state is before[0]:
        assert authority.since == 0.0
    else:
        assert changed
        assert (authority.why, authority.since) == ('because', 5.0)
    if AUTHORITY_TABLE[event].next_state(before[0]) is None:
        assert not changed
        assert (authority.state, authority.why, authority.since, authority.hold) == before


def test_the_table_has_a_row_for_each_event_and_each_suspension_has_an_end():
    assert set(AUTHORITY_TABLE) == set(AuthorityEvent) == set(CELLS)
    assert set(_SUSPENDS.values()) == set(Suspension) - {Suspension.RESTART}
    assert set(_ENDS.values()) == set(Suspension) == set(_GIVEN_BACK_BY)


PAIRS = [(a, b) for a, b in itertools.permutations(ENDS.items(), 2)
         if b[1] is not E.UNEXPLAINED]  # a change of mode while SUSPENDED is a loss


@pytest.mark.parametrize(('first', 'second'), PAIRS,
                         ids=[f'{a[1].name}-{b[1].name}' for a, b in PAIRS])
def test_suspended_for_two_causes_it_is_held_again_only_after_the_end_of_both(first, second):
    authority = suspended(first[1], second[1])
    words = [_GIVEN_BACK_BY[_SUSPENDS[each]] for each in (first[1], second[1])]
    assert authority.why == f'{first[1].name}; {second[1].name}'
    assert authority.given_back_by == ' and '.join(words)
    authority.apply(first[0], 2.0)
    assert authority.state is S
    assert (authority.why, authority.given_back_by) == (second[1].name, words[1])
    authority.apply(first[0], 3.0)
    assert authority.state is S
    authority.apply(second[0], 4.0)
    assert authority.state is H
    assert authority.suspensions == {}
    assert authority.given_back_by == ''


def test_the_same_suspension_twice_needs_one_end():
    authority = suspended(E.LINK_STALE, E.LINK_STALE, E.NEW_ADDRESS)
    assert authority.suspended_by(Suspension.LINK)
    authority.apply(E.LINK_BACK, 2.0)
    assert authority.held


def test_a_loss_while_suspended_outlasts_the_suspension():
    for ends, begins in ENDS.items():
        authority = suspended(begins)
        authority.apply(E.TAKEN, 2.0)
        authority.apply(ends, 3.0)
        assert authority.state is L
        assert authority.suspensions == {}


def test_a_mission_mode_set_by_a_pilot_ends_every_suspension_but_a_foreign_mission():
    authority = suspended(E.AVOIDING, E.FAILSAFE_STAYS)
    authority.apply(E.TO_MISSION, 2.0)
    assert authority.held
    authority = suspended(E.AVOIDING, E.FOREIGN)
    authority.apply(E.TO_MISSION, 2.0)
    assert set(authority.suspensions) == {Suspension.FOREIGN}
    assert authority.state is S


@pytest.mark.parametrize('state', [H, S, L, N])
def test_after_a_kill_only_a_hand_over_leads_to_held(state):
    authority = authority_in(state)
    assert authority.apply(E.KILLED, 1.0, 'killed')
    assert not authority.apply(E.KILLED, 2.0, 'killed again')
    for event in AuthorityEvent:
        if event is not E.HAND_OVER:
            authority.apply(event, 3.0)
            assert (authority.state, authority.killed, authority.why) == (L, True, 'killed')
    assert authority.given_back_by == '~/hand_over, on the ground and disarmed'
    assert authority.apply(E.HAND_OVER, 4.0)
    assert (authority.held, authority.killed) == (True, False)


def test_a_kill_persists_over_a_restart():
    authority = Authority(0.0, AuthorityRecord(L, 'killed', killed=True))
    assert not authority.apply(E.TO_MISSION, 1.0)
    assert authority.state is L


@pytest.mark.parametrize('state', [H, L, N])
@pytest.mark.parametrize(('event', 'hold'), [
    (E.HAND_OVER, HoldStage.FIRST), (E.STICK_TO_HOLD, HoldStage.FIRST),
    (E.TO_MISSION, HoldStage.UNLESS_VERIFIED)])
def test_a_hand_over_in_flight_holds_first(state, event, hold):
    authority = authority_in(state)
    authority.apply(event, 1.0)
    due = HoldStage.NO if AUTHORITY_TABLE[event].next_state(state) is None else hold
    assert authority.hold is due
    authority.apply(E.LINK_STALE, 2.0)
    assert authority.hold is (
        HoldStage.NO if AUTHORITY_TABLE[event].next_state(state) is None else hold
    )  # it is still due
    authority.apply(E.TAKEN, 3.0)
    assert authority.hold is HoldStage.NO


def test_a_grant_on_the_ground_needs_no_hold():
    authority = authority_in(N)
    authority.apply(E.GRANTED, 1.0)
    assert authority.hold is HoldStage.NO


def test_after_our_own_landing_only_a_hand_over_leads_to_held():
    authority = authority_in(H)
    authority.apply(E.OWN_LANDING, 1.0)
    assert (authority.state, authority.landed, authority.given_back_by) == (N, True, '~/hand_over')
    authority.apply(E.HAND_OVER, 2.0)
    assert not authority.landed
    authority.apply(E.WITHDRAWN, 3.0)
    assert not authority.landed
    assert authority.given_back_by.startswith('takeoff: true on the ground, ')


def test_takeoff_withdrawn_in_the_air_lasts_until_a_loss_or_the_landing():
    for event in (E.OWN_LANDING, E.TAKEN):
        authority = authority_in(H)
        authority.apply(E.WITHDRAWN_IN_AIR, 1.0)
        assert authority.until_landing
        authority.apply(E.LINK_STALE, 2.0)
        authority.apply(E.LINK_BACK, 3.0)
        assert authority.until_landing
        authority.apply(event, 4.0)
        assert not authority.until_landing


def test_after_a_restart_nothing_may_be_sent_until_a_heartbeat_agrees():
    for state in (H, S):
        authority = Authority(0.0, AuthorityRecord(state, 'before'))
        assert (authority.state, authority.why) == (S, 'before')
        assert not any(authority.allows(action) for action in SendAction)
        authority.apply(E.RESTART_AGREES, 1.0)
        assert authority.held
    for state in (L, N):
        assert Authority(0.0, AuthorityRecord(state)).state is state


# what may be sent

SENT = {
    N: {SendAction.READ, SendAction.UPLOAD},
    H: set(SendAction),
    S: set(),
    L: {SendAction.READ},
}


@pytest.mark.parametrize('state', [N, H, S, L])
def test_each_state_allows_the_actions_of_the_table(state):
    authority = authority_in(state)
    assert {action for action in SendAction if authority.allows(action)} == SENT[state] == set(
        PERMISSIONS[state][1])


def test_while_undecided_or_with_a_foreign_mission_only_reading_is_allowed():
    authority = authority_in(N)
    authority.undecided = True
    assert [action for action in SendAction if authority.allows(action)] == [SendAction.READ]
    assert not authority.held
    authority = suspended(E.FOREIGN)  # else its end would not be detected
    assert [action for action in SendAction if authority.allows(action)] == [SendAction.READ]
    authority.apply(E.LINK_STALE, 2.0)
    assert not any(authority.allows(action) for action in SendAction)


def command(number, *params):
    return d.MAVLink_command_long_message(1, 1, number, 0, *params, *[0] * (7 - len(params)))


READS = [
    d.MAVLink_mission_request_list_message(1, 1), d.MAVLink_mission_request_int_message(1, 1, 0),
    d.MAVLink_mission_request_message(1, 1, 0), d.MAVLink_mission_ack_message(1, 1, 0),
    d.MAVLink_param_request_read_message(1, 1, b'RTL_ALT', -1),
    command(d.MAV_CMD_SET_MESSAGE_INTERVAL), command(d.MAV_CMD_REQUEST_MESSAGE)]
UPLOADS = [
    d.MAVLink_mission_count_message(1, 1, 3),
    d.MAVLink_mission_item_int_message(1, 1, 0, 0, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0.0),
    d.MAVLink_mission_ack_message(1, 1, d.MAV_MISSION_OPERATION_CANCELLED),
    d.MAVLink_mission_clear_all_message(1, 1, d.MAV_MISSION_TYPE_FENCE),
    d.MAVLink_mission_clear_all_message(1, 1, d.MAV_MISSION_TYPE_RALLY)]
KNOWN_COMMANDS = ('DO_SET_MODE', 'COMPONENT_ARM_DISARM', 'NAV_TAKEOFF', 'DO_SET_MISSION_CURRENT',
                  'MISSION_START', 'DO_PAUSE_CONTINUE', 'NAV_RETURN_TO_LAUNCH', 'DO_REPOSITION',
                  'DO_FLIGHTTERMINATION', 'NAV_LAND')


def test_each_message_type_is_a_read_an_upload_or_a_command():
    assert {action_of(m) for m in READS} == {SendAction.READ}
    assert {action_of(m) for m in UPLOADS} == {SendAction.UPLOAD}
    for name in KNOWN_COMMANDS:
        assert action_of(command(getattr(d, 'MAV_CMD_' + name))) is SendAction.COMMAND
    assert action_of(d.MAVLink_mission_clear_all_message(
        1, 1, d.MAV_MISSION_TYPE_MISSION)) is SendAction.COMMAND
    harmless = {m.get_type() for m in READS + UPLOADS}
    for number, kind in d.mavlink_map.items():
        message = kind.__new__(kind)
        message._type = kind.msgname
        if kind.msgname not in harmless:
            assert action_of(message) is SendAction.COMMAND, number


class Watch:
    """Stores the commands that it is to record."""

    def __init__(self, authority):
        self.authority, self.commands, self.uploads = authority, [], 0

    def record_command(self, message, now):
        self.commands.append(message)

    def record_upload(self):
        self.uploads += 1


@pytest.mark.parametrize('state', [N, H, S, L])
def test_the_gate_keeps_the_order_of_allowed_messages_and_records_commands(state):
    commands = [command(getattr(d, 'MAV_CMD_' + name)) for name in KNOWN_COMMANDS]
    commands.append(d.MAVLink_mission_set_current_message(1, 1, 2))
    watch = Watch(authority_in(state))
    out = allowed_messages([*commands, *UPLOADS, *READS], watch, 1.0)
    assert out == [*(commands if SendAction.COMMAND in SENT[state] else []),
                   *(UPLOADS if SendAction.UPLOAD in SENT[state] else []),
                   *(READS if SendAction.READ in SENT[state] else [])]
    assert watch.commands == (commands if state is H else [])
    assert watch.uploads == sum(m.get_type() == 'MISSION_COUNT' for m in out)


# the generated table

def test_the_generated_table_has_each_state_each_event_and_each_cell():
    lines = table_text().splitlines()
    for state in (N, H, S, L):
        assert sum(line.startswith(f'| {state.name} |') for line in lines) == 1
    rows = {line.split(' | ')[0].removeprefix('| '): line for line in lines}
    for event, row in AUTHORITY_TABLE.items():
        cells = rows[event.value].strip('| ').split(' | ')[1:5]
        for cell, target in zip(cells, (row.held, row.suspended, row.lost, row.none),
                                strict=True):
            assert cell == ('same' if target is None else target.name)
        assert row.note in rows[event.value]
    assert {
        line.count('|')
        for line in lines
        if line.startswith('| event')
        or '---|---|---|---' in line
        or line.split(' | ')[0].removeprefix('| ') in {e.value for e in AuthorityEvent}
    } == {7}
