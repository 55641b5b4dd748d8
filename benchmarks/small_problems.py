# SPDX-License-Identifier: Apache-2.0
"""Random small problems with time, loads and trips against exact optima and their own insertion.

    python benchmarks/small_problems.py [--problems 5000] [--seed 1] [--tasks 5] [--paths 0.6]
        [--rounds 2000] [--plain]

Progress and faults go to stderr, one JSON object to stdout. The exit status is 1 where a plan is
not valid, worse than its own insertion or the plan it starts from, or gives an untrue reason.
"""
from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT)]

from uav_task_alloc.study.small_problems import compare_small, small_problem  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--problems', type=int, default=5000)
    parser.add_argument('--seed', type=int, default=1, help='of the first problem')
    parser.add_argument('--tasks', type=int, default=5, help='at most')
    parser.add_argument('--paths', type=float, default=0.0,
                        help='share of the tasks that have a path')
    parser.add_argument('--rounds', type=int, default=2000)
    parser.add_argument('--plain', action='store_true',
                        help='without loads, endurances, battery swaps, locked tasks')
    args = parser.parse_args()
    gaps, faulty, impossible = list[float](), list[int](), 0
    for seed in range(args.seed, args.seed + args.problems):
        try:
            result = compare_small(small_problem(
                seed, args.tasks, paths=args.paths, plain=args.plain), args.rounds)
        except (ArithmeticError, LookupError, TypeError, ValueError, AssertionError) as error:
            print(f'{seed}: {error!r}', file=sys.stderr, flush=True)
            faulty.append(seed)
            continue
        if result is None:
            impossible += 1
            continue
        gaps.append(result.gap)
        wrong = [*result.faults, *(f'warm: {text}' for text in result.warm_faults)]
        for text in wrong:
            print(f'{seed}: {text}', file=sys.stderr, flush=True)
        faulty += [seed] * bool(wrong)
        if len(gaps) % 100 == 0:
            print(f'{len(gaps)} problems, {len(faulty)} faulty', file=sys.stderr, flush=True)
    known = [gap for gap in gaps if not math.isnan(gap)]
    print(json.dumps({
        'problems': len(gaps), 'without a valid plan': impossible, 'faulty': faulty,
        'less value than the optimum': len(gaps) - len(known),
        'optimal': sum(gap < 1e-6 for gap in known), 'worst gap': max(known, default=0.0),
        'mean gap': sum(known) / max(len(known), 1)}))
    return int(bool(faulty))


if __name__ == '__main__':
    sys.exit(main())
