# SPDX-License-Identifier: Apache-2.0
"""Losses of separation are judged by true positions, between the steps of a simulation too."""
import json
import math
import random

import pytest

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.record.ground_truth import GroundTruth
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.separation_judge import SeparationJudge, TrueState
from uav_task_alloc.sim.udp_fleet import UdpFleet

FAR = (1e4, 1e4, 0.0)


def judged(*steps, rule=(10.0, 5.0), homes=(FAR, FAR), dt=1.0):
    """The judge, and the pairs that lost separation, after (a, b) positions a step."""
    judge, begun, ended = SeparationJudge(*rule), [], []
    for k, points in enumerate(steps):
        more, less = judge.step(k * dt, {
            name: TrueState(point or FAR, home, point is not None)
            for name, point, home in zip('ab', points, homes, strict=True)})
        begun += more
        ended += less
    return judge, begun, ended


def test_two_that_pass_each_other_between_two_steps_have_lost_separation():
    judge, begun, _ = judged([(0, 0, 50), (30, 4, 50)], [(30, 0, 50), (0, 4, 50)])
    assert [loss.uavs for loss in begun] == [('a', 'b')]
    nearest = judge.least['a', 'b']
    assert (nearest.t, nearest.distance) == (pytest.approx(0.5), pytest.approx(4.0))


def test_height_suffices_where_the_horizontal_distance_is_not_kept():
    judge, begun, _ = judged([(0, 0, 50), (30, 0, 55)], [(30, 0, 50), (0, 0, 55)])
    assert not begun
    assert judge.least['a', 'b'].distance == pytest.approx(5.0)


def test_a_loss_lasts_until_both_are_apart_again_and_keeps_its_nearest():
    _, begun, ended = judged(
        [(0, 0, 50), (30, 0, 50)], [(12, 0, 50), (18, 0, 50)], [(14, 0, 50), (18, 0, 50)],
        [(0, 0, 50), (18, 0, 50)], [(0, 0, 50), (19, 0, 50)])
    assert len(begun) == len(ended) == 1
    assert ended[0].nearest.distance == pytest.approx(4.0)


@pytest.mark.parametrize('gone', [[None, (0, 0, 50)], [(0, 0, 50), None]])
def test_who_is_on_the_ground_or_lost_is_not_in_the_air(gone):
    judge, begun, _ = judged(gone, gone)
    assert not begun
    assert not judge.least


def test_two_above_their_own_pads_do_not_count_but_one_that_leaves_does():
    homes = ((0, 0, 0), (4, 0, 0))
    low = [(0, 0, 4), (4, 0, 4)]
    assert not judged(low, low, homes=homes)[1]
    assert judged(low, [(0, 0, 6), (4, 0, 4)], homes=homes)[1]
    assert judged([(0, 0, 4), (4, 0, 4)], [(4, 0, 4), (4, 0, 4)], homes=((0, 6, 0), (4, 0, 0)))[1]


def test_without_a_rule_only_distances_are_noted():
    judge, begun, _ = judged(*[[(0, 0, 50), (1, 0, 50)]] * 2, rule=(0.0, 0.0))
    assert not begun
    assert judge.least['a', 'b'].distance == 1.0


@pytest.mark.parametrize('seed', range(200))
def test_a_step_is_judged_as_fine_samples_of_it_are(seed):
    rng = random.Random(seed)
    steps = [[tuple(rng.uniform(-s, s) for s in (25, 25, 8)) for _ in 'ab'] for _ in '12']
    judge, begun, _ = judged(*steps)
    (a0, b0), (a1, b1) = steps
    least, lost, close = math.inf, False, False
    for k in range(2001):
        apart = [(1 - k / 2000) * (q - p) + k / 2000 * (s - r)
                 for p, q, r, s in zip(a0, b0, a1, b1, strict=True)]
        least = min(least, math.hypot(*apart))
        lost |= math.hypot(*apart[:2]) < 10.0 and abs(apart[2]) < 5.0
        close |= math.hypot(*apart[:2]) < 10.1 and abs(apart[2]) < 5.1
    assert judge.least['a', 'b'].distance == pytest.approx(least, abs=0.05)
    assert bool(begun) == lost or close


def test_the_fleet_writes_losses_and_least_distances(tmp_path):
    log = tmp_path / 'flight.jsonl'
    fleet = UdpFleet([(VehicleConfig(f'u{k}', k, Origin(47.4, 8.5, 488.0), (3.0 * k, 0.0, 0.0)),
                       'ardupilot') for k in (1, 2)], ('127.0.0.1', 9), log_file=log,
                     separation=(10.0, 5.0))
    try:
        for k, vehicle in enumerate(fleet.vehicles.values()):
            vehicle.flight.landed, vehicle.flight.body.position = False, (3.0 * k, 0.0, 30.0)
        for now in (0.0, 0.1):
            fleet._step(now)
    finally:
        fleet.close()
    lines = [json.loads(text) for text in log.read_text().splitlines()]
    assert {(line['event'], line['uav'], line['other'], line['horizontal']) for line in lines
            if 'other' in line} == {('separation_lost', 'u1', 'u2', 3.0),
                                    ('least_distance', 'u1', 'u2', 3.0)}
    truth = GroundTruth()
    for line in lines:
        truth.apply(line)
    assert [loss.uavs for loss in truth.losses] == [('u1', 'u2')]
    assert truth.least_distance() == 3.0
