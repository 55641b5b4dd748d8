# SPDX-License-Identifier: Apache-2.0
"""What tests have started ends with them, also where they are killed."""
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

TEST = Path(__file__).parent
DOCS = """
import signal
import sys
from contextlib import ExitStack
from pathlib import Path
from docs_pages import ROOT, Block
from test_docs import Sandbox
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it
block = Block(ROOT / 'README.md', 1, 'bash', sys.argv[2], 'until', 'started')
with ExitStack() as stack:
    sandbox = Sandbox(Path(sys.argv[1]), stack)
    getattr(sandbox, sys.argv[3])(block, ['bash', '-c', block.text])
    print('goes on', flush=True)
    sys.stdin.read()
"""


def is_running(pid):
    """Whether a process runs; one that has ended may wait for its parent."""
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(') ')[2][0] != 'Z'
    except OSError:
        return False


def until(condition):
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)
    return True


@pytest.mark.skipif(sys.platform != 'linux', reason='needs prctl')
@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGKILL, signal.SIGHUP])
@pytest.mark.parametrize('method', ['start', 'run'])
def test_what_the_commands_of_a_page_have_started_ends_with_the_test(tmp_path, method, number):
    (tmp_path / 'box').mkdir()
    pids = tmp_path / 'pids'
    # a program in the foreground and one behind it, as a shell that is killed leaves both
    command = f'sleep 600 & echo $! > {pids}; sh -c "echo \\$\\$ >> {pids}; exec sleep 600"'
    test = subprocess.Popen(
        [sys.executable, '-c', DOCS, str(tmp_path / 'box'), f'echo started; {command}', method],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, cwd=TEST,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(
            [str(TEST), str(TEST.parent), *sys.path])})
    try:
        until(lambda: pids.exists() and len(pids.read_text().split()) == 2)
        started = [int(pid) for pid in pids.read_text().split()]
        assert all(map(is_running, started))
        test.send_signal(number)
        test.wait(60.0)
        assert until(lambda: not any(map(is_running, started)))
    finally:
        test.kill()
        test.stdin.close()
        test.wait()


@pytest.mark.parametrize(('words', 'status'), [('true', 0), ('exit 3', 3), ('kill -9 $$', 137)])
def test_the_status_is_that_of_the_command(words, status):
    done = subprocess.run([sys.executable, TEST / 'ends_with_parent.py', 'sh', '-c', words],
                          check=False, start_new_session=True)
    assert done.returncode == status
