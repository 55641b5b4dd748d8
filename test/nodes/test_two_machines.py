# SPDX-License-Identifier: Apache-2.0
"""The allocator on one machine and its UAV on another: they meet, and meet again after a cut."""
import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros
CUT = Path(__file__).parents[2] / 'benchmarks/endurance/cut.py'


def test_two_machines_meet_again_after_a_cut_and_nothing_is_lost():
    done = subprocess.run([sys.executable, CUT, '--seconds', '2'], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    if 'skipped' in told:
        pytest.skip(told['skipped'])
    assert not told['heard_amid'], 'the wire was never cut'
    assert told['all_tasks']
    assert told['revisions'] == sorted(set(told['revisions']))
    assert told['allocator_status'] == 0
