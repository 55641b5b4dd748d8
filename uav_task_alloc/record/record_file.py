# SPDX-License-Identifier: Apache-2.0
"""The file of a record: one JSON object a line, the last one possibly unfinished."""
from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from os import SEEK_END
from pathlib import Path
from typing import Any

RECORD_FILE = 'record.jsonl'
# `wall`: time of the record, that of /clock where its node lives by simulated time
Line = Mapping[str, Any]  # `wall` [unix s], `kind`, and the values that RunState.on_KIND reads


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
