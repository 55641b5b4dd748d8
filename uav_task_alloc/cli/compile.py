# SPDX-License-Identifier: Apache-2.0
"""The command `compile`: all numba kernels compiled ahead of time into the cache on disk."""
from __future__ import annotations

from collections.abc import Sequence

from uav_task_alloc.params import AllocatorParams


def main(argv: Sequence[str]) -> int:
    """Compile the kernels that the allocator uses; those in the cache are only loaded.

    Raises:
        SystemExit: arguments are given.
    """
    if argv:
        raise SystemExit('usage: python -m uav_task_alloc compile')
    from uav_task_alloc.allocator.warm_up import compile_kernels  # imports numba
    from uav_task_alloc.solver.solve import plan
    compile_kernels(plan, AllocatorParams())
    return 0
