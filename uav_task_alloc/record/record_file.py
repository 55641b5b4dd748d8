# SPDX-License-Identifier: Apache-2.0
"""The file of a record: one JSON object a line, the last one possibly unfinished."""
from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import count
from os import SEEK_END
from pathlib import Path
from typing import Any

RECORD_FILE = 'record.jsonl'
# `wall`: time of the record, that of /clock where its node lives by simulated time
Line = Mapping[str, Any]  # `wall` [unix s], `kind`, and the values that RunState.on_KIND reads


class RecordWriter:
    """Writes the record of a run; a record that is there already is moved, never overwritten.

    It goes to `earlier_1`, `earlier_2`, ... in the folder. `earlier` is that folder; None: there
    was no record.

    Args:
        folder: created where it does not exist.

    Arguments of methods:
        line: of the record.

    Raises:
        OSError: also by `write` and `flush`; the file cannot be written. Close it then.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / RECORD_FILE
        self.earlier: Path | None = None
        if path.exists() and path.stat().st_size > 0:
            self.earlier = next(each for number in count(1)
                                if not (each := folder / f'earlier_{number}').exists())
            self.earlier.mkdir()
            path.rename(self.earlier / RECORD_FILE)
        self._file = path.open('w', encoding='utf-8')

    def write(self, line: Line) -> None:
        """Write a line, which may stay in memory until `flush`."""
        self._file.write(json.dumps(line) + '\n')

    def flush(self) -> None:
        """Write to the disk what is in memory."""
        self._file.flush()

    def close(self) -> None:
        """Close the file, with what can still be written."""
        with suppress(OSError):
            self._file.close()


def read_lines(path: Path) -> Iterable[Line]:
    """Read the objects of a file of JSON lines; an unfinished last line is ignored.

    Args:
        path: of the file.

    Returns:
        One object a line, read as they are iterated.

    Raises:
        OSError: while iterating; the file cannot be read.
    """
    with path.open(encoding='utf-8') as file:
        for text in file:
            if text.endswith('\n'):
                yield json.loads(text)


def unfinished(path: Path) -> str:
    """Say whether a file of JSON lines has a whole last line.

    Args:
        path: of the file.

    Returns:
        What is wrong, as the rest of a sentence; '': nothing.

    Raises:
        OSError: the file cannot be read.
    """
    with path.open('rb') as file:
        if not file.seek(0, SEEK_END):
            return 'is empty'
        file.seek(-1, SEEK_END)
        return '' if file.read() == b'\n' else 'is cut: its last line is not finished'
