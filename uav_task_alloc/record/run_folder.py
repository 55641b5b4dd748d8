# SPDX-License-Identifier: Apache-2.0
"""The output folder of a demo: files of an earlier demo are removed, others never."""
from __future__ import annotations

import os
from fnmatch import fnmatchcase
from pathlib import Path

from uav_task_alloc.errors import InvalidValue, first_of
from uav_task_alloc.params import NODES
from uav_task_alloc.record.ground_truth import TRUTH_FILE
from uav_task_alloc.record.record_file import RECORD_FILE

MARKER = '.uav_task_alloc_demo'  # marks a folder that a demo created or found empty
STATE = 'state'  # folder of allocator and bridge
SUMMARY, MAP = 'summary.json', 'map.png'
FILES = (MARKER, SUMMARY, MAP, RECORD_FILE, TRUTH_FILE, *(f'{node}.log' for node in NODES))
STATE_FILES = ('journal.*', *(f'{kind}_*.{suffix}' for kind in ('authority', 'hold', 'fence')
                              for suffix in ('json', 'position', 'tmp')))  # patterns
# identify the folder of a version that wrote no marker
LOGS = ('allocator.log', 'mavlink_bridge.log', 'fleet_sim.log')
_MAX_NAMED = 5  # foreign entries in an error


def prepare(folder: Path) -> None:
    """Create an empty output folder with its marker and `state/`.

    Files of an earlier demo are removed, by their names and only where the marker is. Links are
    never followed. Nothing is removed from a folder that is refused.

    Args:
        folder: created where it is missing, with its parents.

    Raises:
        InvalidValue: the folder holds other files; the text names them.
        OSError: the folder cannot be read or written.
    """
    if folder.exists():
        for path in _own_files(folder):
            path.unlink()
    (folder / STATE).mkdir(parents=True, exist_ok=True)
    (folder / MARKER).write_text('Made by a demo of uav_task_alloc, which clears this folder.\n')


def _own_files(folder: Path) -> list[Path]:
    """All files in a folder of a demo, the marker last. Raises InvalidValue for other files."""
    if not folder.is_dir():
        raise InvalidValue('out', str(folder), 'a folder')
    own: list[Path] = []
    foreign: list[Path] = []
    entries = sorted(folder.iterdir())
    names = {path.name for path in entries}
    marked = MARKER in names or names.issuperset(LOGS)
    for path in entries:
        if path.name == STATE and _is_folder(path):
            for inner in sorted(path.iterdir()):
                is_own = any(fnmatchcase(inner.name, pattern) for pattern in STATE_FILES)
                (own if is_own and _is_file(inner) else foreign).append(inner)
        else:
            (own if path.name in FILES and _is_file(path) else foreign).append(path)
    if entries and not marked:
        raise InvalidValue('out', str(folder), 'a folder that is missing, empty or of an earlier '
                           f'demo; it has no {MARKER}, but {_names(entries, folder)}')
    if foreign:
        raise InvalidValue('out', str(folder), 'only files of an earlier demo in it; others are '
                           f'{_names(foreign, folder)}')
    return sorted(own, key=lambda path: path.name == MARKER)


def _is_file(path: Path) -> bool:
    return path.is_file() and not path.is_symlink()


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _names(paths: list[Path], folder: Path) -> str:
    return first_of((os.fspath(path.relative_to(folder)) for path in paths), _MAX_NAMED)
