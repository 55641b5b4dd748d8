# SPDX-License-Identifier: Apache-2.0
"""The charge that a vehicle counts: resets, jumps, wrong capacities, no sensor."""
import math

import pytest

from uav_task_alloc.mavlink.gcs.battery_energy import BatteryEnergy
from uav_task_alloc.mavlink.gcs.energy_estimate import FlownAmount, NominalEnergy

SPEED, STATED, CAPACITY = 15.0, 10_000.0, 5000.0  # [m/s], [m], [mAh]
NAN = math.nan


class CountedFlight:
    """A battery in flight at a constant drain, reported once a second."""

    def __init__(self, used=1.0, capacity=CAPACITY, reported_share=lambda charge: charge,
                 counted=lambda mah: mah, charge=1.0):
        self.level, self.now = used / STATED, 0.0
        self.charge, self.start = charge, charge
        self.capacity, self.reported_share, self.counted = capacity, reported_share, counted
        self.battery = BatteryEnergy(NominalEnergy(STATED, 0.0, SPEED))
        self.report()
        self.battery.took_off()

    def report(self):
        share = math.floor(100.0 * self.reported_share(self.charge) + 1e-9) / 100.0
        mah = math.floor((self.start - self.charge) * CAPACITY)
        self.battery.read(share, self.counted(mah), self.capacity, self.now)

    def fly(self, seconds):
        for n in range(seconds):
            east = SPEED if n % 40 < 20 else -SPEED
            self.now += 1.0
            self.charge -= self.level * SPEED
            self.battery.estimate.flew(FlownAmount(1.0, SPEED, 0.0, east, 0.0))
            self.report()
        return self

    @property
    def full_range(self):
        return self.limits.full_range

    @property
    def limits(self):
        return self.battery.estimate.limits(FlownAmount(), SPEED, 0.0)


def test_the_drain_is_known_earlier_and_more_exactly_by_the_charge():
    counted, per_cent = CountedFlight(1.5), CountedFlight(1.5, counted=lambda mah: NAN)
    times = [next(n for n in range(200) if flight.fly(1).battery.estimate.known)
             for flight in (counted, per_cent)]
    assert times[0] < times[1]
    counted.fly(60)
    assert counted.full_range == pytest.approx(STATED / 1.5, rel=0.05)
    assert counted.battery.estimate.charge == pytest.approx(counted.charge, abs=0.004)
    assert counted.battery.doubt == ''


@pytest.mark.parametrize('unknown', [-1.0, 0.0, NAN, math.inf])
def test_without_a_measured_charge_the_per_cent_counts(unknown):
    flight = CountedFlight(1.5, counted=lambda mah: unknown).fly(120)
    assert not flight.battery.estimate.counting
    assert flight.battery.doubt == ''
    assert flight.full_range == pytest.approx(STATED / 1.5, rel=0.05)
    assert 'by its per cent' in flight.battery.text


def test_a_capacity_that_is_not_given_is_learnt():
    flight = CountedFlight(1.5, capacity=NAN).fly(20)
    assert not flight.battery.estimate.counting
    flight.fly(100)
    assert flight.battery.estimate.counting
    assert flight.battery.count.used_capacity == pytest.approx(CAPACITY, rel=0.06)
    assert flight.full_range == pytest.approx(STATED / 1.5, rel=0.08)


@pytest.mark.parametrize('set_to', [0.6, 0.8, 1.3, 2.0])
def test_with_a_wrong_capacity_the_worse_counts_and_it_is_reported(set_to):
    flight = CountedFlight(1.2, capacity=CAPACITY * set_to).fly(200)
    charge = flight.battery.estimate.charge
    assert 'check the capacity' in flight.battery.doubt
    assert flight.limits.range < 1.1 * flight.charge / flight.level
    if set_to < 1.0:  # the count falls faster
        assert charge == pytest.approx(1.0 - (1.0 - flight.charge) / set_to, abs=0.03)
        assert flight.full_range == pytest.approx(set_to * STATED / 1.2, rel=0.1)
        assert 'the charge counts' in flight.battery.doubt
    else:
        assert charge == pytest.approx(flight.charge, abs=0.012)
        assert flight.full_range == pytest.approx(STATED / 1.2, rel=0.1)
        assert 'the per cent counts' in flight.battery.doubt


def test_a_count_that_starts_again_changes_nothing_of_the_charge():
    flight = CountedFlight(1.5).fly(100)
    before = flight.battery.estimate.charge
    flight.start = flight.charge  # counted from here
    flight.fly(40)
    assert flight.battery.doubt == ''
    assert flight.battery.estimate.charge == pytest.approx(before - 40 * SPEED * flight.level,
                                                           abs=0.006)
    assert flight.full_range == pytest.approx(STATED / 1.5, rel=0.05)


@pytest.mark.parametrize('error', [3000.0, 65_000.0, 2.0**31 - 2.0, -200.0])
def test_a_count_that_jumps_once_or_for_good_uses_no_charge(error):
    wrong = [0.0]
    flight = CountedFlight(1.5, counted=lambda mah: mah + wrong[0]).fly(100)
    for seconds in (1, 60):
        wrong[0] = error
        flight.fly(seconds)
        assert flight.battery.estimate.charge == pytest.approx(flight.charge, abs=0.012)
        assert flight.full_range == pytest.approx(STATED / 1.5, rel=0.06)
        assert flight.battery.doubt == ''
        wrong[0] = 0.0
        flight.fly(30)
    assert flight.battery.estimate.charge == pytest.approx(flight.charge, abs=0.012)


def test_a_count_that_stands_still_is_reported_and_not_used():
    stands = [math.inf]
    flight = CountedFlight(1.5, counted=lambda mah: min(mah, stands[0])).fly(60)
    stands[0] = 500.0
    flight.fly(100)
    assert not flight.battery.estimate.counting
    assert 'stands at 500 mAh' in flight.battery.doubt
    assert flight.battery.estimate.charge == pytest.approx(flight.charge, abs=0.012)
    assert flight.full_range == pytest.approx(STATED / 1.5, rel=0.06)
    stands[0] = math.inf  # the sensor is back
    flight.fly(60)
    assert flight.battery.estimate.counting
    assert flight.battery.doubt == ''
    assert flight.battery.estimate.charge == pytest.approx(flight.charge, abs=0.012)


def test_another_battery_is_another_charge_and_the_drain_stays():
    flight = CountedFlight(1.5).fly(200)
    before = flight.full_range
    flight.charge = flight.start = 1.0
    flight.report()
    assert flight.battery.estimate.charge == pytest.approx(1.0, abs=0.01)
    assert flight.full_range == pytest.approx(before, rel=0.02)


def test_a_per_cent_that_rises_by_its_noise_is_no_other_battery():
    flight = CountedFlight(1.5, reported_share=lambda charge: charge).fly(100)
    flight.reported_share = lambda charge: charge + 0.015
    flight.fly(5)
    assert flight.battery.estimate.charge == pytest.approx(flight.charge, abs=0.008)


def test_a_capacity_that_becomes_known_in_flight_changes_the_drain_at_once():
    flight = CountedFlight(1.5, capacity=2.0 * CAPACITY)
    flight.fly(15)
    flight.capacity = CAPACITY
    flight.fly(1)
    assert flight.full_range == pytest.approx(STATED / 1.5, rel=0.15)


def test_what_was_used_on_the_ground_is_no_drain_of_the_flight():
    flight = CountedFlight(1.0)
    for _ in range(600):  # waits with its motors off, and uses 10 %
        flight.now += 1.0
        flight.charge -= 0.1 / 600
        flight.report()
    flight.battery.took_off()
    flight.fly(60)
    assert flight.full_range == pytest.approx(STATED, rel=0.06)


def test_a_battery_that_is_no_longer_reported_still_empties():
    flight = CountedFlight(1.5, counted=lambda mah: NAN).fly(100)
    before = flight.limits.range
    for _ in range(60):
        flight.battery.estimate.flew(FlownAmount(1.0, SPEED, 0.0, 0.0, 0.0))
    assert flight.limits.range == pytest.approx(before - 60 * SPEED, rel=0.05)
