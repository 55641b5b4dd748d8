# SPDX-License-Identifier: Apache-2.0
"""Stores which fence items the bridge has uploaded, a JSON file for each UAV: they are its own."""
from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Protocol

from uav_task_alloc.atomic_files import read_file, replace_file
from uav_task_alloc.mavlink.fence.onboard_fence import ItemKey
from uav_task_alloc.mavlink.gcs.authority_store import uav_file_name

_FILE_LIMIT = 65536  # [bytes] of a file that is read


class FenceStore(Protocol):
    """Stores the items of fences that may be on board, over a restart of the bridge."""

    def load_fence(self, uav_id: str) -> frozenset[ItemKey]:
        """The items saved last; none where there are none."""

    def save_fence(self, uav_id: str, own: Iterable[ItemKey]) -> None:
        """Save the items; they are on disk when this returns."""


class FenceFileStore:
    """A `FenceStore` on disk.

    Args:
        folder: that exists.
        report: called with a line for the operator where a file cannot be read or written.

    Arguments of methods:
        uav_id: of a UAV.
        own: items that may be on board.
    """

    def __init__(self, folder: str, report: Callable[[str], object]) -> None:
        self._folder, self._report = Path(folder).expanduser(), report

    def path(self, uav_id: str) -> Path:
        """Return the path of a UAV's file."""
        return self._folder / uav_file_name(uav_id).replace('authority_', 'fence_', 1)

    def load_fence(self, uav_id: str) -> frozenset[ItemKey]:
        """Return the items saved last; none where there is no file, or it is unusable."""
        path = self.path(uav_id)
        try:
            body = json.loads(read_file(path, _FILE_LIMIT))
            if body['uav_id'] != uav_id:
                raise ValueError('not the fence of this UAV')
            return frozenset((int(c), float(p), int(x), int(y)) for c, p, x, y in body['items'])
        except FileNotFoundError:
            return frozenset()
        except (OSError, ValueError, LookupError, TypeError, OverflowError,
                RecursionError) as error:
            self._report(f'{path}: {error or type(error).__name__}: not used; a fence of the '
                         f'bridge on {uav_id} counts as that of another station')
            return frozenset()

    def save_fence(self, uav_id: str, own: Iterable[ItemKey]) -> None:
        """Write the file before returning; a failure is reported."""
        path = self.path(uav_id)
        try:
            replace_file(path, json.dumps({'uav_id': uav_id, 'items': sorted(own)}) + '\n')
        except OSError as error:
            self._report(f'{path}: not written: {error}; after a restart of the bridge its fence '
                         f'on {uav_id} counts as that of another station')
