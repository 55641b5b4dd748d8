# SPDX-License-Identifier: Apache-2.0
"""The process of benchmarks/endurance/flood.py that publishes states ends without an error."""
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros
ENDURANCE = Path(__file__).parents[2] / 'benchmarks/endurance'
SCRIPT = """
import flood

plain = flood.header
def first(stamp):
    print('publishes', flush=True)
    flood.header = plain
    return plain(stamp)

flood.header, flood.RATE = first, 10 ** 9  # it never waits, so the signal comes as it publishes
flood.publish_states()
"""


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGINT])
def test_a_signal_amid_a_publication_ends_the_process_silently(number):
    with subprocess.Popen([sys.executable, '-c', SCRIPT], cwd=ENDURANCE, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout.readline() == 'publishes\n'
        process.send_signal(number)
        assert process.communicate(timeout=30) == ('', '')
    assert process.returncode == -number
