# SPDX-License-Identifier: Apache-2.0
"""The allocator on one machine and its UAV on another: they meet, and meet again after a cut."""
import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros
CUT = Path(__file__).parents[2] / 'benchmarks/endurance/cut.py'


def test_two_machines_reconnect_after_a_cut_and_nothing_is_lost():
    done = subprocess.run([sys.executable, CUT, '--seconds', '2'], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads(done.stdout.splitlines()[-1])
    if 'skipped' in result:
        pytest.skip(result['skipped'])
    assert not result['received_during_cut'], 'the wire was never cut'
    assert result['all_tasks']
    assert result['revisions'] == sorted(set(result['revisions']))
    assert result['allocator_status'] == 0
