# SPDX-License-Identifier: Apache-2.0
"""Range and endurance by what a flight used: terms, wind, batteries in whole per cents."""
import math

import pytest
from flight_bench import FlightBench
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.energy_estimate import (
    EnergyEstimate,
    FlownAmount,
    NominalEnergy,
    planned_amount,
)
from uav_task_alloc.mavlink.gcs.status import state_of
from uav_task_alloc.mavlink.gcs.vehicle_energy import VehicleEnergy
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task

SPEED, STATED = 15.0, 10_000.0  # [m/s], [m]


class TrueFlight:
    """A battery that falls by known terms, and reads whole per cents."""

    def __init__(self, used=1.0, hover=0.9, wind=0.0, nominal=None):
        self.level = used / STATED  # share for a metre
        self.hover = hover * SPEED * self.level  # share for a second
        self.along = (1.0 - hover) * self.level
        self.wind = wind * self.level  # share saved for a metre to the east
        self.charge = 1.0
        self.estimate = EnergyEstimate(nominal or NominalEnergy(STATED, 0.0, SPEED))
        self.estimate.read(1.0)
        self.estimate.took_off()

    def fly(self, seconds, speed=SPEED, east=0.0, climb=0.0):
        for _ in range(seconds):
            self.charge -= (self.hover + self.along * speed + 1.5 * self.level * climb
                            - self.wind * east * speed)
            self.estimate.flew(FlownAmount(1.0, speed, climb, east * speed, 0.0))
            self.estimate.read(math.floor(100.0 * self.charge) / 100.0)
        return self

    def limits(self, ahead=None, deviations=0.0):
        return self.estimate.limits(ahead or FlownAmount(), SPEED, deviations)


@pytest.mark.parametrize('used', [0.7, 1.0, 1.6])
def test_range_follows_what_the_flight_used_not_what_is_stated(used):
    flight = TrueFlight(used)
    assert not flight.estimate.known
    for k in range(4):
        flight.fly(50, east=1.0 - 2.0 * (k % 2)).fly(10, speed=0.0)
    assert flight.estimate.known
    assert flight.limits().full_range == pytest.approx(STATED / used, rel=0.05)
    assert flight.limits().range == pytest.approx(flight.charge / flight.level, rel=0.07)
    assert flight.limits(deviations=2.0).range < flight.charge / flight.level


def test_hovering_and_climbing_have_terms_of_their_own():
    flight = TrueFlight(hover=0.5)
    for k in range(8):
        flight.fly(30, east=1.0 - 2.0 * (k % 2)).fly(30, speed=0.0).fly(5, 0.0, climb=3.0)
    hovering = flight.estimate.charge_after(FlownAmount(seconds=100.0))
    level = flight.estimate.charge_after(FlownAmount(100.0, 100.0 * SPEED))
    now = flight.estimate.charge_after(FlownAmount())
    assert now - hovering == pytest.approx(100.0 * flight.hover, rel=0.15)
    assert now - level == pytest.approx(100.0 * SPEED * flight.level, rel=0.1)
    climbs = planned_amount([(0.0, 0.0, 0.0), (0.0, 0.0, 100.0)], SPEED)
    assert flight.limits(climbs).range < flight.limits().range - 75.0


def test_a_way_out_with_the_wind_leaves_less_for_the_way_home():
    flight = TrueFlight(wind=0.3)
    for _ in range(3):
        flight.fly(60, east=1.0).fly(30, east=-1.0)
    out = flight.fly(100, east=1.0)
    home = FlownAmount(150.0, 150.0 * SPEED, 0.0, -150.0 * SPEED)
    needs = 150.0 * SPEED * flight.level * 1.3
    expected = out.estimate.charge_after(FlownAmount()) - out.estimate.charge_after(home)
    assert expected == pytest.approx(needs, rel=0.12)
    assert out.limits(home).range < out.limits(FlownAmount(150.0, 150.0 * SPEED)).range


def test_before_the_way_back_is_known_its_cost_is_uncertain():
    flight = TrueFlight(wind=0.3).fly(150, east=1.0)
    home = FlownAmount(150.0, 150.0 * SPEED, 0.0, -150.0 * SPEED)
    on = FlownAmount(150.0, 150.0 * SPEED, 0.0, 150.0 * SPEED)
    left = [flight.estimate.charge_after(way) - flight.estimate.charge_after(way, 1.0)
            for way in (home, on)]
    assert left[0] > 2.0 * left[1]


def test_a_reading_that_jumps_is_another_charge_and_the_terms_stay():
    flight = TrueFlight(1.5).fly(150)
    before = flight.limits().full_range
    flight.estimate.read(0.99)
    assert flight.limits().full_range == pytest.approx(before)
    assert flight.limits().range == pytest.approx(0.99 * before, rel=0.02)
    flight.estimate.read(0.40)
    assert flight.limits().range == pytest.approx(0.40 * before, rel=0.03)


@pytest.fixture(params=['ardupilot', 'px4'])
def bench(request):
    made = FlightBench(request.param, takeoff=True, configs={1: {
        'range': 3000.0, 'batteries': 2, 'second_battery': 0.8}})
    made.discover()
    assert made.run(lambda: made.executor().telemetry.has_position)
    made.executor().energy.nominal = NominalEnergy(6000.0, 0.0, 15.0)
    return made


def test_a_simulated_flight_shows_its_range_by_the_battery_that_ends_first(bench):
    assert isinstance(bench.executor().energy, VehicleEnergy)
    session = bench.ground_station.sessions[1]
    battery = bench.executor().telemetry.battery
    assert state_of(session, bench.now).range_remaining == pytest.approx(6000.0 * battery)
    assert math.isnan(state_of(session, bench.now).endurance)
    places = [(x, y, 50.0) for x, y in ((200, 0), (0, 0), (0, 250), (200, 100), (0, 50), (150, 0))]
    bench.assign(TaskList(1, tuple(MissionStop(Task(f't{k}', place, service_time=2.0))
                                   for k, place in enumerate(places)), returns=True))
    energy = bench.executor().energy
    assert bench.run(lambda: energy.limits is not None and len(
        bench.executor().onboard.progress.completed) >= 5)
    true = 3000.0 * bench.vehicles[1].flight.body.battery
    status = state_of(session, bench.now + 1.0)
    assert status.range_remaining == pytest.approx(true, rel=0.3)
    assert 2200.0 < status.full_range < 4700.0  # of the second battery: 3000 / 0.8 m
    assert 0.0 < status.endurance < 400.0


def test_the_battery_of_sys_status_counts_where_there_is_no_other():
    made = FlightBench('px4', configs={1: {'batteries': 0}})
    assert made.run(lambda: made.ground_station.sessions and made.executor().energy.batteries)
    assert list(made.executor().energy.batteries) == [-1]
    assert d.MAVLINK_MSG_ID_SYS_STATUS in made.executor().telemetry.received_ids
