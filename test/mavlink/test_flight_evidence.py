# SPDX-License-Identifier: Apache-2.0
"""The evidence of benchmarks/endurance/flight_evidence.py: what the delivered frames show."""
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as d
from test_flight_judge import AWAY, PLACE, heartbeat

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'benchmarks' / 'endurance'))

from flight_evidence import DeliveredEvidence

from uav_task_alloc.sim.config import FlightMode

REACHED_AT = 10.0  # [s]


class Visit:
    """One vehicle that reaches item 2 at PLACE at REACHED_AT, and flies on."""

    def __init__(self, hold=0.0, ends=False, px4=False):
        self.evidence, self.hold, self.ends = DeliveredEvidence(px4), hold, ends
        self.flight = SimpleNamespace(body=SimpleNamespace(position=AWAY), seq=2, booted=0.0,
                                      mode=FlightMode.MISSION, items=['home', 'A', 'B', 'C'])

    def fly(self, until=20.0):
        """States of the vehicle, tick by tick."""
        for tick in range(round(10 * until)):
            now = 0.1 * tick
            there = REACHED_AT - self.hold <= now + 1e-6 <= REACHED_AT + 0.3
            self.flight.body.position = PLACE if there else AWAY
            if abs(now - REACHED_AT) < 0.05:
                self.flight.seq = 3
                self.flight.mode = FlightMode.HOLD if self.ends else FlightMode.MISSION
            self.evidence.add_state(now, self.flight)
            if self.flight.seq == 3 and abs(now - REACHED_AT) < 0.05:
                self.evidence.reached('B', REACHED_AT, 2, PLACE, self.hold, now)
        return self.evidence


def current(seq, state=d.MISSION_STATE_ACTIVE):
    return d.MAVLink_mission_current_message(seq, 3, state, 1)


def position():
    return d.MAVLink_global_position_int_message(0, 1, 1, 0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(('sent', 'message', 'known'), [
    (10.0, d.MAVLink_mission_item_reached_message(2), True),
    (14.0, d.MAVLink_mission_item_reached_message(2), True),  # a repetition by PX4
    (9.9, d.MAVLink_mission_item_reached_message(2), False),  # of an earlier mission
    (10.0, d.MAVLink_mission_item_reached_message(1), False),
    (10.1, current(3), True),
    (18.0, current(3), True),
    (10.1, current(2), False),
    (10.1, current(2, d.MISSION_STATE_COMPLETE), True),
    (9.0, current(3), False),  # before it was reached
])
def test_a_frame_is_evidence_where_it_shows_that_the_item_was_reached(sent, message, known):
    evidence = Visit().fly()
    evidence.delivered(sent, message)
    assert ('B' in evidence.known) is known


@pytest.mark.parametrize(('sent', 'known'), [(10.6, True), (11.4, False)])
def test_a_current_item_that_another_station_has_set_is_no_evidence(sent, known):
    evidence = Visit().fly()
    evidence.set_by_other(11.0)
    evidence.delivered(sent, current(4))
    assert ('B' in evidence.known) is known
    evidence.delivered(sent, d.MAVLink_mission_item_reached_message(2))
    assert 'B' in evidence.known


@pytest.mark.parametrize(('sent', 'mode_sent', 'known'), [
    (10.0, 10.1, True),
    (10.0, 9.9, False),  # a pilot may have taken it in between
    (9.0, 10.1, False),  # not there yet
    (12.0, 12.1, False),  # on its way to the next item
])
def test_a_position_is_evidence_where_a_frame_after_it_shows_mission_mode(sent, mode_sent, known):
    evidence = Visit().fly()
    for when, message in sorted(((sent, position()), (mode_sent, heartbeat(True))),
                                key=lambda row: row[0]):
        evidence.delivered(when, message)
    assert ('B' in evidence.known) is known


@pytest.mark.parametrize(('first', 'known'), [(8.0, True), (9.2, False)])
def test_positions_are_evidence_once_they_span_the_service_time(first, known):
    evidence = Visit(hold=2.0).fly()
    for sent in (first, 9.9):
        evidence.delivered(sent, position())
    evidence.delivered(9.9, heartbeat(True))
    assert ('B' in evidence.known) is known


@pytest.mark.parametrize(('ends', 'known'), [(False, True), (True, False)])
def test_a_position_after_the_mission_has_ended_is_no_evidence(ends, known):
    evidence = Visit(ends=ends).fly()
    evidence.delivered(REACHED_AT, position())
    evidence.delivered(REACHED_AT + 0.1, heartbeat(True))
    assert ('B' in evidence.known) is known


@pytest.mark.parametrize('change', ['reboot', 'mission'])
def test_a_current_item_of_another_mission_is_no_evidence(change):
    visit = Visit()
    evidence = visit.fly(11.0)
    if change == 'reboot':
        visit.flight.booted = 11.0
    else:
        visit.flight.items = ['home', 'X', 'Y', 'Z', 'B']
    evidence.add_state(12.0, visit.flight)
    evidence.delivered(12.0, current(3))
    assert evidence.known == {}


@pytest.mark.parametrize(('killed', 'known'), [(12.0, False), (18.0, True)])
def test_a_bridge_killed_without_a_file_forgets_what_it_had_still_to_judge(killed, known):
    visit = Visit()
    evidence = visit.fly(10.2)
    evidence.delivered(10.1, current(3))
    evidence.add_state(killed, visit.flight)
    evidence.forget()
    assert ('B' in evidence.known) is known


@pytest.mark.parametrize(('booted', 'known'), [(0.0, True), (12.0, False)])
def test_mission_mode_after_a_restart_of_the_vehicle_shows_none_of_before(booted, known):
    visit = Visit()
    evidence = visit.fly()
    evidence.delivered(REACHED_AT, position())
    visit.flight.booted = booted
    evidence.add_state(20.0, visit.flight)
    evidence.delivered(20.0, heartbeat(True))
    assert ('B' in evidence.known) is known


@pytest.mark.parametrize(('items', 'known'), [
    (['home', 'A', 'B', 'D'], True), (['home', 'X', 'Y', 'B'], False)])
def test_a_reached_of_a_mission_replaced_before_a_bridge_without_a_file_is_no_evidence(
        items, known):
    visit = Visit(px4=True)
    evidence = visit.fly(11.0)
    visit.flight.items = items
    evidence.add_state(11.0, visit.flight)
    evidence.forget()
    evidence.delivered(10.0, d.MAVLink_mission_item_reached_message(2))
    assert ('B' in evidence.known) is known


def test_a_reached_of_a_mission_of_a_bridge_without_a_file_is_evidence():
    visit = Visit(px4=True)
    visit.evidence.add_state(0.0, visit.flight)
    visit.evidence.forget()
    visit.flight.items = ['home', 'X', 'B', 'C']
    evidence = visit.fly(11.0)
    evidence.delivered(10.0, d.MAVLink_mission_item_reached_message(2))
    assert 'B' in evidence.known


@pytest.mark.parametrize(('px4', 'mode', 'known'), [
    (False, FlightMode.HOLD, False), (False, FlightMode.MISSION, True),
    (True, FlightMode.HOLD, True)])
def test_a_current_item_of_an_ardupilot_that_was_held_for_a_mission_is_no_evidence(
        px4, mode, known):
    visit = Visit(px4=px4)
    evidence = visit.fly(11.0)
    evidence.forget()
    visit.flight.mode = mode
    evidence.add_state(12.0, visit.flight)
    evidence.delivered(12.0, current(3))
    assert ('B' in evidence.known) is known


@pytest.mark.parametrize(('px4', 'mode', 'known'), [
    (True, FlightMode.LAND, False), (True, FlightMode.TAKEOFF, False),
    (True, FlightMode.HOLD, True), (False, FlightMode.LAND, True)])
def test_the_end_of_a_landing_of_a_px4_is_no_evidence_that_its_mission_has_ended(
        px4, mode, known):
    visit = Visit(px4=px4)
    evidence = visit.fly(11.0)
    visit.flight.mode = mode
    evidence.add_state(12.0, visit.flight)
    visit.flight.mode = FlightMode.HOLD
    evidence.add_state(13.0, visit.flight)
    evidence.delivered(13.0, current(2, d.MISSION_STATE_COMPLETE))
    assert ('B' in evidence.known) is known


def test_a_reached_of_the_next_item_at_that_index_is_no_evidence():
    visit = Visit()
    evidence = visit.fly()
    evidence.reached('C', 15.0, 2, AWAY, 0.0, 15.0)
    evidence.delivered(15.0, d.MAVLink_mission_item_reached_message(2))
    assert 'B' not in evidence.known
    evidence.delivered(14.9, d.MAVLink_mission_item_reached_message(2))
    assert 'B' in evidence.known
