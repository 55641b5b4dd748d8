# SPDX-License-Identifier: Apache-2.0
"""Random faults: each upload ends VERIFIED and correct, or reports its failure."""
import random

import pytest
from flight_bench import FlightBench
from mission_bench import UploadBench, task_list
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.mission.outcomes import Failed, Verified
from uav_task_alloc.sim.stored_item import from_message

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


class Faults:
    """A tamper that loses, delays, repeats, cuts and forges messages, by a seed."""

    def __init__(self, bench, rng):
        self.bench, self.rng = bench, rng
        self.loss, self.delay = rng.uniform(0.0, 0.4), rng.uniform(0.0, 1.0)
        self.repeat, self.forge = rng.uniform(0.0, 0.2), rng.uniform(0.0, 0.05)
        begin = rng.uniform(0.0, 10.0)
        self.cut = (begin, begin + rng.choice([0.0, 2.0, 6.0, 15.0]))
        self.reboot_at = rng.choice([None, None, rng.uniform(0.0, 8.0)])
        bench.line.tampers.append(self)

    def __call__(self, direction, message, now):
        rng = self.rng
        if self.reboot_at is not None and now >= self.reboot_at:
            self.reboot_at = None
            self.bench.vehicle.reboot(now)
        if self.cut[0] <= now < self.cut[1]:
            return []
        carried = [(rng.uniform(0.0, self.delay), message)
                   for _ in range(1 + (rng.random() < self.repeat)) if rng.random() >= self.loss]
        if direction == 'down' and message.get_type().startswith('MISSION_') and (
                rng.random() < self.forge):
            result = rng.choice([0, 0, 1, 13, 14, 15])
            carried.append((0.0, d.MAVLink_mission_ack_message(245, 190, result, 0)))
        return carried


@BOTH
@pytest.mark.parametrize('seed', range(200))
def test_a_mixture_of_faults_never_ends_in_a_false_success(kind, seed):
    rng = random.Random(seed)
    bench = UploadBench(kind, seed=seed)
    Faults(bench, rng)
    mission = bench.replace(bench.mission('ABCDEFGHIJ'[:rng.randint(1, 10)]))
    last = bench.settle(900.0)
    assert isinstance(last, (Verified, Failed)), f'seed {seed}'
    if isinstance(last, Verified):
        assert bench.holds(mission), f'seed {seed}'
    else:
        assert last.reason, f'seed {seed}'


@BOTH
@pytest.mark.parametrize('seed', range(8))
def test_lists_replaced_over_a_line_of_faults_complete_what_was_flown_and_no_more(kind, seed):
    rng = random.Random(1000 + seed)
    bench = FlightBench(kind, seed=seed, loss=rng.uniform(0.0, 0.25),
                        delay=(0.0, rng.uniform(0.0, 0.5))).discover()
    given = list('ABCDEFGH')
    bench.assign(task_list(given))
    for revision in range(2, 5):
        bench.run(limit=rng.uniform(1.0, 25.0))
        given = [t for t in given if t not in bench.completed()]
        rng.shuffle(given)
        bench.assign(task_list(given, revision))
    assert bench.run(lambda: len(bench.completed()) == 8, 1500.0), f'seed {seed}'
    assert sorted(bench.completed()) == list('ABCDEFGH')
    real = [(round(p[0] / 100.0), round(p[1] / 100.0)) for p in bench.flown()]
    assert len(set(real)) == 8, f'seed {seed}: a task was reported that was not flown'
    assert len(real) == 8, f'seed {seed}: a task was flown twice'
    assert bench.run(lambda: bench.onboard().state is MissionState.VERIFIED)


@BOTH
def test_the_bench_sees_a_false_success(kind):
    bench = UploadBench(kind)
    mission = bench.replace(bench.mission('ABC'))
    bench.settle()
    items = bench.vehicle.mission.items
    items[-1] = from_message(d.MAVLink_mission_item_int_message(
        1, 1, 0, 5, 16, 0, 1, 0, 0, 0, 0, 1, 2, 3.0, 0))
    assert not bench.holds(mission)
