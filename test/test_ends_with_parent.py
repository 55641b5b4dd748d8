# SPDX-License-Identifier: Apache-2.0
"""What tests have started ends with them, also where they are killed."""
import os
import select
import signal
import subprocess
import sys
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


def received(pipe):
    """The next byte of a pipe; b'': all who had it open have ended."""
    assert select.select([pipe], [], [], 60.0)[0]
    return os.read(pipe, 1)


@pytest.mark.skipif(sys.platform != 'linux', reason='needs prctl')
@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGKILL, signal.SIGHUP])
@pytest.mark.parametrize('method', ['start', 'run'])
def test_what_the_commands_of_a_page_have_started_ends_with_the_test(tmp_path, method, number):
    (tmp_path / 'box').mkdir()
    pipe = tmp_path / 'pipe'  # which all that was started has open
    os.mkfifo(pipe)
    # a program in the background and one in the foreground: a killed shell ends neither
    command = f'exec 3> {pipe}; sleep 600 & printf 1 >&3; sh -c "printf 2 >&3; exec sleep 600"'
    test = subprocess.Popen(
        [sys.executable, '-c', DOCS, str(tmp_path / 'box'), f'echo started; {command}', method],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, cwd=TEST,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(
            [str(TEST), str(TEST.parent), *sys.path])})
    started = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        assert {received(started), received(started)} == {b'1', b'2'}
        assert not select.select([started], [], [], 0.2)[0]  # they run
        test.send_signal(number)
        assert received(started) == b''  # the last one has ended
    finally:
        os.close(started)
        test.kill()
        test.stdin.close()
        test.wait()


@pytest.mark.parametrize(('words', 'status'), [('true', 0), ('exit 3', 3), ('kill -9 $$', 137)])
def test_the_status_is_that_of_the_command(words, status):
    done = subprocess.run([sys.executable, TEST / 'ends_with_parent.py', 'sh', '-c', words],
                          check=False, start_new_session=True)
    assert done.returncode == status
