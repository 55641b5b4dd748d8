# SPDX-License-Identifier: Apache-2.0
"""The record that a node writes: where the disk fails the record ends, and the node goes on."""
from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.record.record_file import Line, RecordWriter


class RunRecord:
    """A record in the folder of the parameter `out_dir`, until it cannot be written.

    Args:
        out_dir: created where it does not exist; '': nothing is recorded.
        warning, error: write one line of the log.

    Raises:
        InvalidValue: the record cannot be created.
    """

    def __init__(self, out_dir: str, warning: Callable[[str], object],
                 error: Callable[[str], object]) -> None:
        self._log_error = error
        self._writer: RecordWriter | None = None
        if not out_dir:
            return
        try:
            self._writer = RecordWriter(Path(out_dir))
        except OSError as reason:
            raise InvalidValue('out_dir', out_dir,
                               f'a folder that can be written to ({reason})') from None
        if self._writer.earlier:
            warning(f'out_dir: its record was moved to {self._writer.earlier}')

    def write(self, line: Line) -> None:
        """Write a line, which may stay in memory until `flush`.

        Args:
            line: of the record.
        """
        self._attempt(lambda writer: writer.write(line))

    def flush(self) -> None:
        """Write to the disk what is in memory."""
        self._attempt(RecordWriter.flush)

    def close(self) -> None:
        """End the record, with what can still be written."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def _attempt(self, write: Callable[[RecordWriter], None]) -> None:
        if self._writer is None:
            return
        try:
            write(self._writer)
        except OSError as error:
            self._log_error(f'out_dir: {error}: the record ends, the node goes on')
            self.close()
