# SPDX-License-Identifier: Apache-2.0
"""Wind at a simulated vehicle: what it holds, how it is slowed, and when it is carried off."""
import math

import numpy as np
import pytest
from vehicle_bench import ORIGIN

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.dynamics import PointMass
from uav_task_alloc.sim.wind import Wind, WindAtVehicle, held_velocity


def leg_time(wind, length=900.0, target=None, **config):
    """Time [s] and the body after a straight leg with a target to the east."""
    body = PointMass(VehicleConfig('u', 1, ORIGIN, (0.0, 0.0, 50.0), wind=wind, range=10_000.0,
                                   cruise_speed=15.0, **config))
    end, t, aside = target or (length, 0.0, 50.0), 0.0, 0.0
    while math.dist(body.position, end) > 1.0 and t < 600.0:
        body.step(0.1, end, 15.0, 0.0)
        aside = max(aside, abs(body.position[1] - end[1]))
        t += 0.1
    return t, body, aside


def test_wind_within_the_lean_angle_changes_neither_speed_nor_track_but_costs_battery():
    calm, body_calm, _ = leg_time(None)
    against, body, aside = leg_time(Wind(east=-4.0))  # 19 of 19.5 m/s through the air
    assert against == pytest.approx(calm, abs=0.3)
    assert aside < 0.1
    used, calm_used = 1.0 - body.battery, 1.0 - body_calm.battery
    assert used / calm_used == pytest.approx(19.0 / 15.0, rel=0.03)
    tail, body, _ = leg_time(Wind(east=4.0))
    assert tail == pytest.approx(calm, abs=0.3)
    assert (1.0 - body.battery) / calm_used == pytest.approx(11.0 / 15.0, rel=0.05)


def test_wind_beyond_the_lean_angle_slows_a_leg_down_on_its_track():
    t, _, aside = leg_time(Wind(east=-10.0))  # 9.5 m/s over ground are left
    assert 900.0 / 9.5 <= t <= 900.0 / 9.5 + 6.0  # and it accelerates and brakes
    assert aside < 0.1
    t, _, aside = leg_time(Wind(north=15.0))  # from the side: sqrt(19.5^2 - 15^2) = 12.5 m/s
    ideal = 900.0 / math.sqrt(19.5**2 - 15.0**2)
    assert ideal <= t <= ideal + 6.0
    assert aside < 2.0


def test_a_stronger_wind_carries_it_off():
    assert held_velocity((15.0, 0.0, 1.0), (-25.0, 0.0), 20.0) == (-5.0, 0.0, 1.0)
    assert held_velocity((15.0, 0.0, 0.0), (0.0, 30.0), 20.0) == pytest.approx((0.0, 10.0, 0.0))
    assert held_velocity((0.0, 0.0, -2.0), (0.0, 30.0), 20.0) == pytest.approx((0.0, 10.0, -2.0))
    assert held_velocity((0.0, 0.0, 0.0), (12.0, 0.0), 20.0) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('seed', range(20))
def test_the_airspeed_limit_is_kept_wherever_it_can_be(seed):
    rng = np.random.default_rng(seed)
    for _ in range(200):
        wanted = tuple(rng.uniform(-20.0, 20.0, 3))
        wind, most = tuple(rng.uniform(-25.0, 25.0, 2)), rng.uniform(5.0, 25.0)
        vx, vy, vz = held_velocity(wanted, wind, most)
        assert math.hypot(vx - wind[0], vy - wind[1]) <= most + 1e-9
        assert math.hypot(vx, vy) <= max(math.hypot(*wanted[:2]), math.hypot(*wind)) + 1e-9
        assert vz == wanted[2]


def test_gusts_have_their_spread_and_repeat_with_their_seed():
    def samples(system_id, seed=7):
        one = WindAtVehicle(Wind(3.0, -1.0, gusts=2.0, seed=seed), system_id)
        rows = []
        for _ in range(20_000):
            one.step(1.0)
            rows.append(one.velocity)
        return np.array(rows)

    first = samples(1)
    assert np.array_equal(first, samples(1))
    assert not np.array_equal(first, samples(2))
    assert not np.array_equal(first, samples(1, seed=8))
    assert first.mean(axis=0) == pytest.approx([3.0, -1.0], abs=0.3)
    assert first.std(axis=0) == pytest.approx([2.0, 2.0], rel=0.1)


def test_climb_and_descent_have_rates_of_their_own():
    up, _, _ = leg_time(None, target=(0.0, 0.0, 90.0), climb_rate=2.5, descent_rate=1.5)
    down, _, _ = leg_time(None, target=(0.0, 0.0, 10.0), climb_rate=2.5, descent_rate=1.5)
    assert up == pytest.approx(40.0 / 2.5, abs=1.5)
    assert down == pytest.approx(40.0 / 1.5, abs=1.5)


def test_endurance_empties_the_battery_of_a_slow_vehicle():
    body = PointMass(VehicleConfig('u', 1, ORIGIN, (0.0, 0.0, 50.0), endurance=100.0))
    for _ in range(500):
        body.step(0.1, None, 15.0, 0.0)
    assert body.battery == pytest.approx(0.5)


@pytest.mark.parametrize(('given', 'text'), [
    ({'east': math.nan}, 'wind: east = nan'), ({'north': 101.0}, 'wind: north = 101.0'),
    ({'gusts': -1.0}, 'wind: gusts = -1.0')])
def test_a_wind_that_is_none_is_refused(given, text):
    with pytest.raises(InvalidValue, match=text):
        Wind(**given)
