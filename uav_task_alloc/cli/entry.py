# SPDX-License-Identifier: Apache-2.0
"""Entry point of the installed program; from its import on Ctrl-C ends the process silently.

Python's own handler would print where the imports were interrupted. `main` installs another one,
so only programs import this, before anything that takes time: `signal` itself takes a millisecond.
"""
import _signal  # type: ignore[import-not-found]

if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
    _signal.signal(_signal.SIGINT, _signal.SIG_DFL)
if hasattr(_signal, 'pthread_sigmask'):  # not on Windows; the scripts in resource/ block it
    _signal.pthread_sigmask(_signal.SIG_UNBLOCK, [_signal.SIGINT])

from uav_task_alloc.cli.commands import main

__all__ = ['main']
