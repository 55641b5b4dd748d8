# SPDX-License-Identifier: Apache-2.0
"""Failsafe returns at random moments of flights among zones: which enter a zone, and was it said?

Run: `python benchmarks/endurance/returns.py --moments 200 --seed 1 --json`. Bridge and vehicle are
those of test/mavlink/fence/test_failsafe_returns.py. ArduPilot with a path planner must enter no
zone; what ArduPilot without one and PX4 enter must have been in the diagnostics before. The status
is 1 where that does not hold, or a vehicle did not return. The last line is one JSON object.
"""
from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'test/mavlink'))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'test/mavlink/fence'))

from test_failsafe_returns import AROUND, flown_return

VEHICLES = {'ardupilot_around': ('ardupilot', AROUND),
            'ardupilot': ('ardupilot', (('FENCE_ENABLE', 1.0),)),
            'px4': ('px4', (('GF_ACTION', 1.0),))}


def named(said: str) -> list[str]:
    """The zones that a text of the diagnostics names."""
    return said.replace(',', ' ').split()


def judged(name: str, seeds: range, quiet: bool) -> dict[str, int]:
    """Fly a return of one vehicle for each seed, and count."""
    counts = dict.fromkeys(('moments', 'entered', 'entered_unsaid', 'said', 'not_returned'), 0)
    for seed in seeds:
        counts['moments'] += 1
        try:
            entered, said = flown_return(*VEHICLES[name], seed)
        except AssertionError as error:
            counts['not_returned'] += 1
            print(f'{name} seed {seed}: {error}', file=sys.stderr)
            continue
        counts['entered'] += bool(entered)
        counts['said'] += bool(said)
        counts['entered_unsaid'] += not all(zone in named(said) for zone in entered)
        if not quiet and (entered or said):
            print(f'{name} seed {seed}: entered {sorted(entered)}, said {said!r}')
    return counts


def main() -> int:
    """Fly, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--moments', type=int, default=200, help='for each kind of vehicle')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--vehicles', nargs='*', default=list(VEHICLES), choices=list(VEHICLES))
    parser.add_argument('--json', action='store_true', help='the last line only')
    args = parser.parse_args()
    first = args.seed * 1_000_000
    found = {name: judged(name, range(first, first + args.moments), args.json)
             for name in args.vehicles}
    print(json.dumps({'seed': args.seed, **found}))
    around = found.get('ardupilot_around', {}).get('entered', 0)
    return int(around > 0 or any(each['entered_unsaid'] or each['not_returned']
                                 for each in found.values()))


if __name__ == '__main__':
    sys.exit(main())
