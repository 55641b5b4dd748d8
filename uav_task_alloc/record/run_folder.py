# SPDX-License-Identifier: Apache-2.0
"""The folder of a demo: cleared of what an earlier demo left in it, and of nothing else."""
from __future__ import annotations

import os
from fnmatch import fnmatchcase
from pathlib import Path

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.params import NODES
from uav_task_alloc.record import ground_truth as truth, run_state as heard

MARKER = '.uav_task_alloc_demo'  # a folder with it was made, or found empty, by a demo
STATE = 'state'  # of allocator and bridge
SUMMARY, MAP = 'summary.json', 'map.png'
FILES = (MARKER, SUMMARY, MAP, heard.FILE, truth.FILE, *(f'{node}.log' for node in NODES))
STATE_FILES = ('journal.*', 'authority_*.json', 'authority_*.tmp')  # patterns
LOGS = ('allocator.log', 'mavlink_bridge.log', 'fleet_sim.log')  # mark those of versions before
_NAMED = 5  # strange entries that a refusal names


def prepare(folder: Path) -> None:
    """Make an empty folder of a demo, with its marker and `state/`.

    Files of an earlier demo are removed, by their names and only where the marker is. Links are
    never followed. Nothing is removed from a folder that is refused.

    Args:
        folder: is created where it is missing, with its parents.

    Raises:
        InvalidValue: something else is in the folder; the text names it.
        OSError: it cannot be read or written.
    """
    if folder.exists():
        for path in _own_files(folder):
            path.unlink()
    (folder / STATE).mkdir(parents=True, exist_ok=True)
    (folder / MARKER).write_text('Made by a demo of uav_task_alloc, which clears this folder.\n')


def _own_files(folder: Path) -> list[Path]:
    """All files in a folder of a demo, the marker last; InvalidValue where others are there."""
    if not folder.is_dir():
        raise InvalidValue('out', str(folder), 'a folder')
    found: list[Path] = []
    strange: list[Path] = []
    entries = sorted(folder.iterdir())
    names = {path.name for path in entries}
    marked = MARKER in names or names.issuperset(LOGS)
    for path in entries:
        if path.name == STATE and _is_folder(path):
            for inner in sorted(path.iterdir()):
                own = any(fnmatchcase(inner.name, pattern) for pattern in STATE_FILES)
                (found if own and _is_file(inner) else strange).append(inner)
        else:
            (found if path.name in FILES and _is_file(path) else strange).append(path)
    if entries and not marked:
        raise InvalidValue('out', str(folder), 'a folder that is missing, empty or of an earlier '
                           f'demo; it has no {MARKER}, but {_names(entries, folder)}')
    if strange:
        raise InvalidValue('out', str(folder), 'only files of an earlier demo in it; others are '
                           f'{_names(strange, folder)}')
    return sorted(found, key=lambda path: path.name == MARKER)


def _is_file(path: Path) -> bool:
    return path.is_file() and not path.is_symlink()


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _names(paths: list[Path], folder: Path) -> str:
    more = f' and {len(paths) - _NAMED} more' if len(paths) > _NAMED else ''
    return ', '.join(os.fspath(path.relative_to(folder)) for path in paths[:_NAMED]) + more
