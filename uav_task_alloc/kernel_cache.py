# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels on disk, keyed by all sources with kernels; and the notice of a compilation.

The index of numba itself misses changes of functions that a kernel calls in other files: it is
keyed by the kernel's own file. Here the key is a hash of all files with kernels.
"""
from __future__ import annotations

import functools
import gc
import hashlib
import os
import re
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from numba.core import caching, event

from uav_task_alloc.errors import InvalidValue

_COMPILER_SOURCES = ('kernel.py', 'kernel_arguments.py', 'kernel_inner.py', 'kernel_shortcuts.py',
                     'model/zone.py')
ROOMS = ('anticipation', 'geometry', 'separation', 'solver')


def _of_numba(name: str) -> Any:
    """A class of numba, which had an underscore before its name up to some version."""
    return getattr(caching, name, None) or getattr(caching, f'_{name}', None)


_CacheLocator: Any = _of_numba('CacheLocator') or object
_BASES = tuple(map(_of_numba, ('UserProvidedCacheLocator', 'InTreeCacheLocator',
                               'UserWideCacheLocator')))
_LOCATORS: Any = getattr(_of_numba('CacheImpl'), '_locator_classes', None)
# where numba has other classes, each process compiles: its own index misses edits of callees
ON_DISK = _CacheLocator is not object and None not in _BASES and isinstance(_LOCATORS, list)


class KernelWork(NamedTuple):
    """What it takes to compile some kernels."""

    seconds: float  # of CPU
    kernels: int  # that are compiled one after another

    def plus(self, other: KernelWork) -> KernelWork:
        """Both.

        Args:
            other: kernels.
        """
        return KernelWork(self.seconds + other.seconds, self.kernels + other.kernels)


NO_WORK = KernelWork(0.0, 0)
# chain_q up to its first plan, its search; the same of problems with time; paths around zones, in
# problems with time besides; searches of many tasks, of few UAVs with time; on a core of an Intel
# Xeon server
FIRST_WORK, SEARCH_WORK = KernelWork(6.0, 29), KernelWork(8.0, 63)
TIMED_FIRST_WORK, TIMED_SEARCH_WORK = KernelWork(10.0, 77), KernelWork(6.0, 31)
ZONES_WORK, TIMED_ZONES_WORK = KernelWork(9.0, 102), KernelWork(11.0, 110)
TIMED_LARGE_WORK, TIMED_FEW_WORK = KernelWork(9.0, 40), KernelWork(2.5, 16)
_UNUSED = 600.0  # [s] a folder of another hash is kept after the last write: it may be in use
_SELDOM = 300_000, 50, 1000  # thresholds of the garbage collection, else a tenth of a load
_COUNT_ON = 10  # kernels, before the time left follows from them
_FOLDER = 'kernels-'
# comments and docstrings; whatever has a quote in it and is no docstring stays
_NO_CODE = re.compile(r'^\s*""".*?"""$|\s*#[^\'"\n]*$', re.MULTILINE | re.DOTALL)


def kernel_sources(root: Path = Path(__file__).parent) -> list[Path]:
    """Files whose code or constants are compiled into kernels: those that use numba, zones."""
    files = [path for room in ROOMS for path in (root / room).rglob('*.py')]
    return sorted([path for path in files if re.search('numba|kernel', path.read_text())]
                  + [root / name for name in _COMPILER_SOURCES])


@functools.cache
def sources_hash(root: Path = Path(__file__).parent) -> str:
    """Hash of the kernel sources, without comments and docstrings, as they are at the first call.

    Returns:
        16 hexadecimal digits.
    """
    digest = hashlib.sha256()
    for path in kernel_sources(root):
        code = _NO_CODE.sub('', path.read_text())
        digest.update(f'{path.relative_to(root).as_posix()}\0{code}\0'.encode())
    return digest.hexdigest()[:16]


class KernelCacheLocator(_CacheLocator):  # type: ignore[misc]
    """Where numba keeps the kernels of one source file: a folder for each hash of all sources.

    The folder lies where numba's own locators put their files: in NUMBA_CACHE_DIR if that is set,
    in `__pycache__` beside the source, or else in the user's cache directory.
    """

    def __init__(self, py_file: str, parent: str) -> None:
        self._py_file = py_file
        self._parent = Path(parent)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> KernelCacheLocator | None:
        """The locator of a function; None for functions of other packages, and if not ON_DISK.

        Raises:
            InvalidValue: no folder can be written.
        """
        if not (ON_DISK and py_func.__module__.startswith(f'{__package__}.')):
            return None
        for base in _BASES:
            locator = base.from_function(py_func, py_file)
            if locator is not None:
                return cls(py_file, locator.get_cache_path())
        raise InvalidValue('NUMBA_CACHE_DIR', os.environ.get('NUMBA_CACHE_DIR', ''),
                           'a folder for compiled kernels, as neither the folder of the package '
                           'nor that of the user can be written')

    def get_cache_path(self) -> str:
        """The folder; it need not exist."""
        return str(self._parent / f'{_FOLDER}{sources_hash()}')

    def get_source_stamp(self) -> str:
        """What an entry must have been written for to be valid."""
        return sources_hash()

    def get_disambiguator(self) -> str:
        """Nothing: names are unique in a file, and lines may shift without compiling again."""
        return 'kernel'

    def ensure_cache_path(self) -> None:
        """Make the folder, before each write; remove those of other hashes not in use."""
        super().ensure_cache_path()
        for other in self._parent.glob(f'{_FOLDER}*'):
            with suppress(OSError):
                if (str(other) != self.get_cache_path()
                        and time.time() - other.stat().st_mtime > _UNUSED):
                    shutil.rmtree(other, ignore_errors=True)
        for older in self._parent.glob('*.nb[ic]'):  # as numba names them by default
            older.unlink(missing_ok=True)


def kernel_folders() -> list[Path]:
    """The folders on disk that hold kernels of this installation.

    Returns:
        Those of earlier sources too; none that is missing.
    """
    found: set[Path] = set()
    for source in kernel_sources():
        locator = KernelCacheLocator.from_function(kernel_folders, str(source))
        if locator is not None:
            found |= set(Path(locator.get_cache_path()).parent.glob(f'{_FOLDER}*'))
    return sorted(found)


class CompilationNotice(event.Listener):
    """Reports on stderr that kernels are compiled, and lets Ctrl-C end the process meanwhile.

    A line is printed once for each load, and on a terminal another one counts the kernels.

    Python would handle SIGINT only when LLVM returns, seconds later. The signal's default action
    stands in for Python's own handler while a kernel is compiled in the main thread of a program;
    any other handler, and that of an interactive session, stays.

    Args:
        clock: [s], monotonic.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.compiled = 0  # kernels of this package since the process began
        self._clock = clock
        self._terminal: TextIO | None = None
        self._printed, self._loaded = False, set[object]()
        self.not_kept = False  # a kernel could not be written to disk
        self._depth = 0  # passes under way in the main thread: a kernel compiles those it calls
        self._now, self._later = FIRST_WORK.plus(SEARCH_WORK).plus(ZONES_WORK), NO_WORK
        self._began, self._compiled_before = 0.0, 0  # when the line was printed
        self._loading = 0  # in the main thread: depth of `until_loaded`
        self._loads, self._thresholds = 0, gc.get_threshold()  # in all threads
        self._whole = False  # what is loaded is counted already
        self._replaced: Any = None

    def on_start(self, event: Any) -> None:
        """A pass of the compiler begins, over a kernel of this package or over what it calls."""
        ours = str(event.data['module']).startswith(f'{__package__}.')
        if threading.current_thread() is threading.main_thread() and (ours or self._depth):
            self._depth += 1
            if (self._depth == 1 and not hasattr(sys, 'ps1')
                    and signal.getsignal(signal.SIGINT) is signal.default_int_handler):
                self._replaced = signal.signal(signal.SIGINT, signal.SIG_DFL)
        if ours and not self._printed:
            self._print_once()
        if ours and _is_lowering(event):
            self._show(f'compiling kernel {self._count() + 1} of {self._total()}, '
                       f'about {self._time_left():.0f} s left: {event.data["qualname"]}')

    def on_end(self, event: Any) -> None:
        """It ends."""
        if str(event.data['module']).startswith(f'{__package__}.') and _is_lowering(event):
            self.compiled += 1
        if threading.current_thread() is threading.main_thread() and self._depth:
            self._depth -= 1
            self._restore()

    @contextmanager
    def until_loaded(self, key: object, first: KernelWork, rest: KernelWork = NO_WORK,
                     search: bool = True, whole: bool = False) -> Iterator[None]:
        """Within it, from the first compilation to the end, Ctrl-C ends the process at once.

        Args:
            key: of what is loaded.
            first: the kernels up to a first plan, which are loaded once.
            rest: those of the search.
            search: whether the search is loaded, too.
            whole: `first` contains what is loaded within this.
        """
        left = NO_WORK if key in self._loaded else first
        now, later = (left.plus(rest), NO_WORK) if search else (left, rest)
        if self._loads == 0:
            self._now, self._later, self._whole = now, later, whole
            self._printed = self._printed and not self._loaded  # reading a scenario compiles some
        elif not self._whole:  # of another thread: both are counted together
            self._now = self._now.plus(now)
        main = threading.current_thread() is threading.main_thread()
        self._loading += main
        self._loads += 1
        if self._loads == 1:
            self._thresholds = gc.get_threshold()
            gc.set_threshold(*_SELDOM)
        try:
            yield
            self._loaded.add(key)
        finally:
            self._loads -= 1
            if self._loads == 0:
                gc.set_threshold(*self._thresholds)
                self._show('')
            self._loading -= main
            if main:
                self._restore()

    @contextmanager
    def shown_on(self, stream: TextIO) -> Iterator[None]:
        """Within it, kernels are counted on a stream.

        Args:
            stream: nothing is shown where it is no terminal.
        """
        self._terminal = stream if stream.isatty() else None
        try:
            yield
        finally:
            self._terminal = None

    def report_not_kept(self, error: OSError) -> None:
        """Print once why compiled kernels are not on disk.

        Args:
            error: of the write.
        """
        if not self.not_kept:
            self.not_kept = True
            print(f'compiled kernels cannot be kept on disk ({error}): the next start compiles '
                  'them again; NUMBA_CACHE_DIR names another folder', file=sys.stderr, flush=True)

    def _print_once(self) -> None:
        self._printed, self._began, self._compiled_before = True, self._clock(), self.compiled
        text = f'{self._now.seconds:.0f} s'
        if self._later.seconds:
            text += (f' to a first plan, {self._now.seconds + self._later.seconds:.0f} s in all')
        often = 'once' if ON_DISK else 'at each start: the cache of this numba is not known'
        print(f'compiling kernels ({often}, about {text})', file=sys.stderr, flush=True)

    def _count(self) -> int:
        """Kernels compiled in this load."""
        return self.compiled - self._compiled_before

    def _total(self) -> int:
        """Kernels to compile in this load; fewer where some are on disk."""
        return max(self._now.kernels, self._count() + 1)

    def _time_left(self) -> float:
        """[s] of this load: by the kernels so far, after some of them."""
        left = self._total() - self._count()
        if self._count() < _COUNT_ON:
            return self._now.seconds * left / self._total()
        return (self._clock() - self._began) / self._count() * left

    def _show(self, text: str) -> None:
        """Replace the line on the terminal."""
        if self._terminal is not None:
            self._terminal.write(f'\r\x1b[K{text}')
            self._terminal.flush()

    def _restore(self) -> None:
        """Restore Python's handler of SIGINT after the last pass and the loading."""
        if self._depth == 0 and self._loading == 0 and self._replaced is not None:
            signal.signal(signal.SIGINT, self._replaced)
            self._replaced = None


def _is_lowering(event: Any) -> bool:
    """Whether a pass is the one that makes machine code, the longest of a kernel."""
    return str(event.data['name']).startswith('native_lowering')


NOTICE = CompilationNotice()


def install() -> None:
    """Make numba keep kernels of this package here, and report compilations."""
    if ON_DISK:
        _LOCATORS.insert(0, KernelCacheLocator)
    register: Any = event.register
    register('numba:run_pass', NOTICE)
