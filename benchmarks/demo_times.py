# SPDX-License-Identifier: Apache-2.0
"""Finish, metres and errors of the expected starts of services, over several runs of the demo.

Run with ROS 2 and the built package sourced: `python benchmarks/demo_times.py --runs 5
[--wind 5 0] [--gusts 1] [--keep DIR]`. An error is the start of a service, by the simulator's log,
less the `expected` of its last status at least 60 s before it. The last line is one JSON object.
"""
from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from uav_task_alloc.record.ground_truth import read_run
from uav_task_alloc.record.piece_passes import served
from uav_task_alloc.record.record_file import RECORD_FILE, read_lines
from uav_task_alloc.scenario import load, to_yaml
from uav_task_alloc.scenario.values import DEFAULT_SPEEDUP, ScenarioWind

AHEAD = 60.0  # [s]
DEMO = Path(__file__).resolve().parents[1] / 'config/scenarios/demo.yaml'


def start_errors(out: Path) -> list[float]:
    """Errors [s] of all services that had an expected start AHEAD before; late is positive."""
    state, truth = read_run(out)
    reached = served(state, truth)
    starts = {name: reached[name][0].wall - state.tasks[name].service
              for name in state.statuses.completed() if reached[name]}
    predicted: dict[str, float] = {}
    for line in read_lines(out / RECORD_FILE):
        if line['kind'] == 'statuses':
            predicted.update((row['task'], row['expected']) for row in line['statuses']
                        if 'expected' in row and row['task'] in starts
                        and line['wall'] <= starts[row['task']] - AHEAD)
    return [starts[name] - expected for name, expected in predicted.items()]


def fly(scenario: Path, out: Path, *options: str) -> tuple[dict[str, Any], list[float]]:
    """Fly a scenario; return its summary and the errors of its starts [s]."""
    done = subprocess.run([sys.executable, '-m', 'uav_task_alloc.nodes.demo', '--scenario',
                           str(scenario), '--out', str(out), *options],
                          capture_output=True, text=True, check=False)
    if not (out / 'summary.json').exists():
        raise SystemExit(f'the demo failed: {done.stderr}')
    return json.loads((out / 'summary.json').read_text()), start_errors(out)


def figures(runs: Iterable[tuple[Mapping[str, Any], list[float]]]) -> dict[str, Any]:
    """Medians over all runs, and of the sizes of all errors together."""
    summaries, errors = zip(*runs, strict=True)
    sizes = sorted(abs(error) for each in errors for error in each)
    return {'runs': len(summaries),
            'finish_s': median(summary['finish_s'] for summary in summaries),
            'metres_flown': median(summary['metres_flown'] for summary in summaries),
            'lost': sum(summary['tasks_lost'] for summary in summaries),
            'flown_twice': sum(summary['tasks_flown_twice'] for summary in summaries),
            'expected': len(sizes), 'error_median_s': round(median(sizes), 1) if sizes else None,
            'error_p90_s': round(sizes[int(0.9 * len(sizes))], 1) if sizes else None}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=5)
    parser.add_argument('--scenario', type=Path, default=DEMO)
    parser.add_argument('--wind', type=float, nargs=2, default=(0.0, 0.0),
                        metavar=('EAST', 'NORTH'), help='[m/s]')
    parser.add_argument('--gusts', type=float, default=0.0, help='[m/s]')
    parser.add_argument('--speedup', type=float, default=DEFAULT_SPEEDUP,
                        help='delays of a loaded machine count so many times')
    parser.add_argument('--keep', type=Path, metavar='DIR', help='keep the folders of all runs')
    parser.add_argument('--limit', type=float, default=300.0, help='[s] of one run')
    args = parser.parse_args()
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        windy = Path(folder, 'scenario.yaml')
        windy.write_text(to_yaml(replace(load(args.scenario),
                                         wind=ScenarioWind(*args.wind, args.gusts))))
        for k in range(args.runs):
            runs.append(fly(windy, Path(args.keep or folder, str(k)),
                            '--limit', str(args.limit), '--speedup', str(args.speedup)))
            print(json.dumps(figures(runs[-1:])), flush=True)
    print(json.dumps(figures(runs)))


if __name__ == '__main__':
    main()
