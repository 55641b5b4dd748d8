# SPDX-License-Identifier: Apache-2.0
"""The executors of a campaign: processes of this machine, or the workers of a Dask cluster."""
from __future__ import annotations

import argparse
import multiprocessing
import os
import re
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from multiprocessing.connection import wait

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.study.campaign import ExecutorFactory

_CONNECT_TIMEOUT = 10.0  # [s]


@contextmanager
def processes(count: int) -> Iterator[Executor]:
    """An executor of `count` processes; none outlives the campaign, however that ends."""
    pool = ProcessPoolExecutor(count, multiprocessing.get_context('spawn'), _init_worker)
    before = set(multiprocessing.active_children())
    try:
        yield pool
    except BaseException:
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()  # unfinished jobs are run again
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _init_worker() -> None:
    """In a worker process: leave Ctrl-C to the campaign, exit when the campaign's process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


@contextmanager
def dask(address: str) -> Iterator[Executor]:
    """An executor on the workers of a Dask scheduler; jobs of dead workers are moved to others.

    Raises:
        InvalidValue: dask.distributed is not installed, or no scheduler answers at the address.
    """
    try:
        distributed = import_module('distributed')
    except ModuleNotFoundError as error:
        raise InvalidValue('--dask', address, f"dask.distributed to be installed ({error}); "
                           "pip install '.[study]'") from None
    if not re.fullmatch(r'([a-z]+://)?\S+:\d+', address):
        raise InvalidValue('--dask', address, 'tcp://HOST:PORT')
    try:
        client = distributed.Client(address, timeout=_CONNECT_TIMEOUT, set_as_default=False)
    except OSError as error:
        raise InvalidValue('--dask', address, 'a Dask scheduler that answers, as '
                           f'tcp://HOST:PORT ({error})') from None
    with client:
        yield client.get_executor(pure=False)


def chosen(args: argparse.Namespace) -> ExecutorFactory:
    """Return the executor that --jobs and --dask select.

    Args:
        args: with the options of `cli.options.add_executor_options`.

    Returns:
        Starts the executor when it is called.

    Raises:
        InvalidValue: --jobs is less than 1.
    """
    if args.dask:
        return lambda: dask(args.dask)
    if args.jobs < 1:
        raise InvalidValue('--jobs', args.jobs, 'an integer in [1, inf)')
    return lambda: processes(args.jobs)
