# SPDX-License-Identifier: Apache-2.0
"""Starts nodes as processes that need not import all modules and load all kernels once more.

A process is a fork of this one, which has done both: 2 s less CPU for an allocator, half a second
for another node. From `start` of its program on it runs what the program runs, with signals, exit
status and output of its own. test_programs.py, test_demo.py and test_launch.py start the programs
themselves.
"""
import gc
import json
import os
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent))  # where it is the program
from ends_with_parent import end_with_parent

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class NodeServer:
    """The side of the tests."""

    def __init__(self):
        self._popen = subprocess.Popen([sys.executable, __file__], stdin=subprocess.PIPE,
                                       stdout=subprocess.PIPE, text=True)

    def ask(self, **request):
        """What the server answers."""
        self._popen.stdin.write(json.dumps(request) + '\n')
        self._popen.stdin.flush()
        return json.loads(self._popen.stdout.readline())

    def close(self):
        """End the server; its nodes have ended before."""
        self._popen.stdin.close()
        self._popen.wait(90)
        self._popen.stdout.close()


class Forked:
    """A process of a server, to be used as `subprocess.Popen`."""

    def __init__(self, server, argv, log):
        self.args, self.returncode, self._server = argv, None, server
        self.pid = server.ask(argv=argv, log=str(log), env=dict(os.environ), folder=os.getcwd())

    def poll(self):
        """Exit status; None while it runs."""
        if self.returncode is None:
            self.returncode = self._server.ask(ended=self.pid)
        return self.returncode

    def wait(self, timeout=None):
        """Exit status, after at most `timeout` [s]."""
        end = time.monotonic() + (timeout or 0.0)
        while self.poll() is None:
            if timeout is not None and time.monotonic() > end:
                raise subprocess.TimeoutExpired(self.args, timeout)
            time.sleep(0.01)
        return self.returncode

    def send_signal(self, number):
        """Send it, unless the process has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self):
        """SIGTERM."""
        self.send_signal(signal.SIGTERM)

    def kill(self):
        """SIGKILL."""
        self.send_signal(signal.SIGKILL)


def load(argv):
    """Import the node's module; load kernels where it does."""
    name = os.path.basename(argv[0])
    import_module(f'uav_task_alloc.nodes.{name}')
    if name == 'allocator':
        from uav_task_alloc.allocator.warm_up import compile_kernels
        from uav_task_alloc.params import AllocatorParams
        from uav_task_alloc.solver.solve import plan
        compile_kernels(plan, AllocatorParams())


def status(pid):
    """Exit status of a fork, or None."""
    ended, code = os.waitpid(pid, os.WNOHANG)
    return os.waitstatus_to_exitcode(code) if ended else None


def serve():
    """Answer requests. Returns in forks only: with what one is to run; None at the end."""
    loaded = set()
    for line in iter(sys.stdin.readline, ''):
        request = json.loads(line)
        if 'ended' in request:
            answer = status(request['ended'])
        else:
            if request['argv'][0] not in loaded:
                load(request['argv'])
                loaded.add(request['argv'][0])
                gc.collect()
                gc.freeze()
            answer = os.fork()
            if not answer:
                return request
        sys.stdout.write(json.dumps(answer) + '\n')
        sys.stdout.flush()
    return None


def become(request):
    """Turn the fork into the program; it ends with the server, as that does with the tests."""
    end_with_parent()
    nothing, log = os.open(os.devnull, os.O_RDONLY), os.open(request['log'], os.O_WRONLY)
    for number, opened in enumerate((nothing, log, log)):
        os.dup2(opened, number)
    os.close(nothing)
    os.close(log)
    os.environ.clear()
    os.environ.update(request['env'])
    os.chdir(request['folder'])
    sys.argv = request['argv']
    start = import_module('uav_task_alloc.nodes.ros.start').start
    start(os.path.basename(sys.argv[0]))


if __name__ == '__main__':
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # as a program does, until `start`
    wanted = serve()
    if wanted:
        become(wanted)
