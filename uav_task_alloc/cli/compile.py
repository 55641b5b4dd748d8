# SPDX-License-Identifier: Apache-2.0
"""The command `compile`: all numba kernels compiled ahead of time into the cache on disk."""
from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence

from uav_task_alloc.cli.options import OptionParser
from uav_task_alloc.params import AllocatorParams


def main(argv: Sequence[str]) -> int:
    """Compile the kernels that the allocator uses; those in the cache are only loaded.

    Raises:
        OSError: the cache cannot be removed.
        SystemExit: the arguments are malformed, or ask for the help.
    """
    parser = OptionParser(
        'compile', 'Compile all kernels ahead of time, about 80 s once for each '
        'installation, and print the folders of the cache. They are __pycache__ beside the '
        "sources where that can be written, else in the user's cache directory, or in "
        'NUMBA_CACHE_DIR if that is set.')
    parser.add_argument('--remove', action='store_true',
                        help='remove the compiled kernels instead, before the package is '
                             'uninstalled (default: compile)')
    remove = parser.parsed(argv).remove
    from uav_task_alloc.kernel_cache import NOTICE, KernelWork, kernel_folders  # imports numba
    if remove:
        for folder in kernel_folders():
            shutil.rmtree(folder)
            print(f'removed {folder}')
        return 0
    from uav_task_alloc.allocator.warm_up import compile_kernels
    from uav_task_alloc.solver.solve import plan
    from uav_task_alloc.solver.timed.solve import load_timed_kernels
    with NOTICE.shown_on(sys.stderr), NOTICE.until_loaded(
            'all', KernelWork(79.0, 489), whole=True):
        compile_kernels(plan, AllocatorParams())
        load_timed_kernels(zones=True, large=True, few=True)  # with time
        load_timed_kernels(zones=True, paths=True)  # of lines, areas and orbits
    for folder in kernel_folders():
        size = sum(path.stat().st_size for path in folder.iterdir())
        print(f'{folder}: {size / 1e6:.1f} MB')
    return int(NOTICE.not_kept)
