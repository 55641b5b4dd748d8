# SPDX-License-Identifier: Apache-2.0
"""The command `compile`: all numba kernels compiled ahead of time into the cache on disk."""
from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from uav_task_alloc.cli.options import OptionParser
from uav_task_alloc.params import AllocatorParams


def main(argv: Sequence[str]) -> int:
    """Compile the kernels that the allocator uses; those in the cache are only loaded.

    Raises:
        OSError: the cache cannot be removed.
        SystemExit: the arguments are malformed, or ask for the help.
    """
    parser = OptionParser(
        'compile', 'Compile all kernels ahead of time, about a minute once for each '
        'installation, and print the folders of the cache. They are __pycache__ beside the '
        "sources where that can be written, else in the user's cache directory, or in "
        'NUMBA_CACHE_DIR if that is set.')
    parser.add_argument('--remove', action='store_true',
                        help='remove the compiled kernels instead, before the package is '
                             'uninstalled (default: compile)')
    if parser.parsed(argv).remove:
        for folder in cache_folders():
            shutil.rmtree(folder)
            print(f'removed {folder}')
        return 0
    from uav_task_alloc.allocator.warm_up import compile_kernels  # imports numba
    from uav_task_alloc.solver.solve import plan
    compile_kernels(plan, AllocatorParams())
    for folder in cache_folders():
        size = sum(path.stat().st_size for path in folder.iterdir())
        print(f'{folder}: {size / 1e6:.1f} MB')
    return 0


def cache_folders() -> list[Path]:
    """The folders that hold compiled kernels of this installation, of earlier versions too."""
    from uav_task_alloc.kernel_cache import KERNEL_FOLDER, KernelCacheLocator, kernel_sources
    found = set()
    for source in kernel_sources():
        locator = KernelCacheLocator.from_function(cache_folders, str(source))
        if locator is not None:
            found |= set(Path(locator.get_cache_path()).parent.glob(f'{KERNEL_FOLDER}*'))
    return sorted(found)
