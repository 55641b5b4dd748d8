# SPDX-License-Identifier: Apache-2.0
"""The detector of conflicts against a judge that samples flights at 10 Hz, and its time.

Usage: python benchmarks/separation_detector.py [--pairs N] [--seed S]

The judge shares no code with the detector: it moves both UAVs in steps of 0.1 s and compares all
positions whose times differ by no more than the lag. Half of the pairs are in conflict. The last
line is one JSON object with `pairs`, `in_conflict`, `missed`, `in_vain`, `ms_20_uavs` (200 tasks)
and `ms_200_uavs` (5000 tasks), medians of five runs, and the same in CPU time.
"""
import argparse
import json
import math
import random
import statistics
import time

import numpy as np

from uav_task_alloc import Separation
from uav_task_alloc.separation.conflicts import find_conflicts
from uav_task_alloc.separation.flight_legs import Flight, FlightLeg
from uav_task_alloc.separation.volumes import flight_volumes

STEP = 0.1  # [s]


def sampled(leg):
    """Positions (n, 3) [m] and times (n,) [s] of a leg: begin [s], start, end [m], speed [m/s].

    Both UAVs are sampled at the same times: multiples of the step.
    """
    begin, a, b, speed = leg
    seconds = math.dist(a[:2], b[:2]) / speed
    times = STEP * np.arange(math.ceil(begin / STEP), math.floor((begin + seconds) / STEP) + 1)
    share = ((times - begin) / seconds)[:, None]
    return (1.0 - share) * np.array(a) + share * np.array(b), times


def judge(one, other, horizontal, vertical, lag):
    """Whether two legs lose separation, by all pairs of samples within the lag."""
    (p, s), (q, t) = sampled(one), sampled(other)
    near = np.abs(s[:, None] - t[None]) <= lag + 1e-9
    level = np.hypot(p[:, None, 0] - q[None, :, 0], p[:, None, 1] - q[None, :, 1])
    upright = np.abs(p[:, None, 2] - q[None, :, 2])
    return bool((near & (level < horizontal) & (upright < vertical)).any())


def detected(one, other, horizontal, vertical, lag):
    """The same by the detector."""
    rule = Separation(horizontal, vertical, lag, 0.0)
    flights = [Flight(name, (FlightLeg((leg[1], leg[2]), 't'),), leg[1], leg[3], begin=leg[0])
               for name, leg in (('a', one), ('b', other))]
    return any(each.legs == (0, 0) for each in find_conflicts(flight_volumes(flights, rule), rule))


def random_leg(rng):
    """Begin, start, end and speed."""
    size = 300.0
    a, b = (tuple(rng.uniform(0.0, size) for _ in 'xy') + (rng.choice((20.0, rng.uniform(
        15.0, 35.0))),) for _ in 'ab')
    return rng.uniform(0.0, 20.0), a, b, rng.uniform(3.0, 20.0)


def compare(pairs, seed):
    """Random pairs, half of them in conflict by the judge.

    Returns:
        How many are in conflict, are missed by the detector, and are called in vain.
    """
    rng = random.Random(seed)
    left = {True: pairs // 2, False: pairs - pairs // 2}
    missed = in_vain = 0
    while left[True] or left[False]:
        one, other = random_leg(rng), random_leg(rng)
        horizontal, vertical = rng.choice(((10.0, 5.0), (30.0, 10.0)))
        lag = rng.choice((0.0, 1.0, 3.0))
        truth = judge(one, other, horizontal, vertical, lag)
        if not left[truth]:
            continue
        left[truth] -= 1
        found = detected(one, other, horizontal, vertical, lag)
        missed += truth and not found
        in_vain += found and not truth
    return pairs // 2, missed, in_vain


def random_flights(uavs, tasks, seed):
    """Flights of one base each, over a square whose density of tasks is that of a survey."""
    rng = random.Random(seed)
    size = 200.0 * math.sqrt(tasks)
    flights = []
    for u in range(uavs):
        home = (rng.uniform(0.0, size), rng.uniform(0.0, size), 0.0)
        stops = [(rng.uniform(0.0, size), rng.uniform(0.0, size), rng.uniform(20.0, 60.0))
                 for _ in range(tasks // uavs)]
        legs = [FlightLeg((a, b), f't{u}_{k}', 5.0, takes_off=k == 0)
                for k, (a, b) in enumerate(zip((home, *stops), stops, strict=False))]
        legs.append(FlightLeg((stops[-1], home), lands=True))
        flights.append(Flight(f'u{u}', tuple(legs), home, 15.0, 2.5, 1.5, in_air=False))
    return flights


def milliseconds(uavs, tasks, seed):
    """Median time and CPU time of five detections [ms]."""
    rule = Separation(10.0, 5.0, 2.0)
    volumes = flight_volumes(random_flights(uavs, tasks, seed), rule)
    times = []
    for _ in range(5):
        begin = time.perf_counter(), time.process_time()
        found = find_conflicts(volumes, rule)
        times.append((1e3 * (time.perf_counter() - begin[0]),
                      1e3 * (time.process_time() - begin[1])))
    wall, cpu = (statistics.median(each) for each in zip(*times, strict=True))
    print(f'{uavs} UAVs, {tasks} tasks: {len(volumes.rows)} pieces, {len(found)} conflicts, '
          f'{wall:.2f} ms, CPU time {cpu:.2f} ms')
    return wall, cpu


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n', 1)[0])
    parser.add_argument('--pairs', type=int, default=1000)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    small = milliseconds(20, 200, options.seed)
    large = milliseconds(200, 5000, options.seed)
    conflicts, missed, in_vain = compare(options.pairs, options.seed)
    print(json.dumps({'pairs': options.pairs, 'in_conflict': conflicts, 'missed': missed,
                      'in_vain': in_vain, 'ms_20_uavs': round(small[0], 2),
                      'ms_200_uavs': round(large[0], 2), 'cpu_ms_20_uavs': round(small[1], 2),
                      'cpu_ms_200_uavs': round(large[1], 2)}))


if __name__ == '__main__':
    main()
