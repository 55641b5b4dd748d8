# SPDX-License-Identifier: Apache-2.0
"""Where a campaign's jobs run: processes of this machine, or a Dask cluster by its address."""
from __future__ import annotations

import argparse
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from multiprocessing.connection import wait

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.study.campaign import Opened

_PATIENCE = 10.0  # [s] that a scheduler may take to answer


@contextmanager
def processes(count: int) -> Iterator[Executor]:
    """So many processes of this machine; none outlives the campaign, however that ends."""
    pool = ProcessPoolExecutor(count, multiprocessing.get_context('spawn'), _enter)
    before = set(multiprocessing.active_children())
    try:
        yield pool
    except BaseException:
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()  # what they were at is not worth waiting for
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _enter() -> None:
    """In a worker: Ctrl-C is the campaign's business, and its end is the worker's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


@contextmanager
def dask(address: str) -> Iterator[Executor]:
    """The workers of a Dask scheduler; jobs of workers that die move on. OSError: none there."""
    try:
        distributed = import_module('distributed')
    except ModuleNotFoundError as error:
        raise InvalidValue('--dask', address, f"dask.distributed to be installed ({error}); "
                           "pip install '.[study]'") from None
    with distributed.Client(address, timeout=_PATIENCE, set_as_default=False) as client:
        yield client.get_executor(pure=False)


def add_arguments(parser: argparse.ArgumentParser, jobs: int) -> None:
    """--jobs and --dask."""
    parser.add_argument('--jobs', type=int, default=jobs,
                        help='processes of this machine (%(default)s)')
    parser.add_argument('--dask', metavar='tcp://HOST:PORT',
                        help='run on the workers of this Dask scheduler instead')


def chosen(asked: argparse.Namespace) -> Opened:
    """The executor that the arguments ask for. Raises InvalidValue."""
    if asked.dask:
        return lambda: dask(asked.dask)
    if asked.jobs < 1:
        raise InvalidValue('--jobs', asked.jobs, 'an integer in [1, inf)')
    return lambda: processes(asked.jobs)
