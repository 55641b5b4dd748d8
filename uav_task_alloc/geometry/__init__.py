# SPDX-License-Identifier: Apache-2.0
"""Where things are: zones, detours, distances and frames; knows no solver, no ROS."""
from contextlib import suppress
from pathlib import Path


def _drop_stale_kernels() -> None:
    """Numba renews a cached kernel when its file changed, but not when one that it calls did."""
    here = Path(__file__).parent
    newest = max(source.stat().st_mtime for source in here.glob('*.py'))
    for index in here.glob('__pycache__/*.nbi'):
        with suppress(OSError):
            if index.stat().st_mtime < newest:
                index.unlink()


_drop_stale_kernels()
