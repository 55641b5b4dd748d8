# SPDX-License-Identifier: Apache-2.0
"""Experiments that anyone can repeat: `python -m uav_task_alloc study NAME`."""
from __future__ import annotations

import argparse
from collections.abc import Sequence

from uav_task_alloc.study import learning, warm

STUDIES = {
    'scouts': (learning.scouts, 'learnt against frozen Q in the constructing bees alone'),
    'whole': (learning.whole, 'forms of learning in the whole solver, paired, at equal time'),
    'warm': (warm.events, 'events in a row: new tasks arrive, UAVs move on'),
}


def main(argv: Sequence[str]) -> int:
    """Run an experiment; returns the exit status."""
    parser = argparse.ArgumentParser(prog='study', description=__doc__)
    commands = parser.add_subparsers(dest='name', required=True)
    for name, (_, text) in STUDIES.items():
        command = commands.add_parser(name, help=text)
        command.add_argument('--budget', type=float, help='[s] of CPU time a run')
        command.add_argument('--runs', type=int, help='instances')
        command.add_argument('--size', help='UAVs x tasks')
    asked = parser.parse_args(argv)
    given = {key: value for key, value in vars(asked).items()
             if key != 'name' and value is not None}
    STUDIES[asked.name][0](**given)
    return 0
