# SPDX-License-Identifier: Apache-2.0
"""Stores the holds of operators as a JSON file for each UAV, for a bridge that restarts."""
from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from uav_task_alloc.atomic_files import read_file, replace_file
from uav_task_alloc.mavlink.gcs.authority_store import uav_file_name

_FILE_LIMIT = 4096  # [bytes] of a file that is read


class HoldStore(Protocol):
    """Stores which UAVs an operator holds, over a restart of the bridge."""

    def load_hold(self, uav_id: str) -> str:
        """The reason of the hold of a UAV, or why it is not known; '' where there is none."""

    def save_hold(self, uav_id: str, reason: str) -> None:
        """Save the reason of a hold, '' at its end; it is on disk when this returns."""


class HoldFileStore:
    """A `HoldStore` on disk.

    Args:
        folder: that exists.
        report: called with a line for the operator where a file cannot be read or written.

    Arguments of methods:
        uav_id: of a UAV.
        reason: of its hold; '' at its end.
    """

    def __init__(self, folder: str, report: Callable[[str], object]) -> None:
        self._folder, self._report = Path(folder).expanduser(), report

    def path(self, uav_id: str) -> Path:
        """Return the path of a UAV's file."""
        return self._folder / uav_file_name(uav_id).replace('authority_', 'hold_', 1)

    def load_hold(self, uav_id: str) -> str:
        """Return the reason of the hold saved last; '' where there is none.

        Of a file that cannot be used, why: who was held stays held.
        """
        path = self.path(uav_id)
        try:
            body = json.loads(read_file(path, _FILE_LIMIT))
            if body['uav_id'] != uav_id or not str(body['reason']).isprintable():
                raise ValueError('not the hold of this UAV')
            return str(body['reason'])
        except FileNotFoundError:
            return ''
        except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
            self._report(f'{path}: {error or type(error).__name__}: cannot be used; {uav_id} is '
                         'held until the allocator, or ~/resume_uav, lets it go on')
            return 'its saved hold cannot be read; ~/resume_uav ends this'

    def save_hold(self, uav_id: str, reason: str) -> None:
        """Write or remove the file before returning; a failure is reported."""
        path = self.path(uav_id)
        try:
            if reason:
                replace_file(path, json.dumps({'uav_id': uav_id, 'reason': reason}) + '\n')
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            self._report(f'{path}: not written: {error}; a bridge that restarts does not know '
                         f'whether {uav_id} is held')
