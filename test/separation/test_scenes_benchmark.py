# SPDX-License-Identifier: Apache-2.0
"""The last line of the benchmark of separation is a JSON object, however many scenes it flies."""
import json
import subprocess
import sys
from pathlib import Path

BENCHMARK = Path(__file__).parents[2] / 'benchmarks/endurance/separation.py'


def test_no_scenes_are_a_line_of_json_too():
    done = subprocess.run([sys.executable, BENCHMARK, '--scenes', '0', '--json'], check=True,
                          capture_output=True, text=True)
    assert json.loads(done.stdout.splitlines()[-1])['scenes'] == 0
