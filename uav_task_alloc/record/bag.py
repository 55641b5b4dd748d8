# SPDX-License-Identifier: Apache-2.0
"""Writer of ROS 2 messages into an MCAP file, with the definitions of their types."""
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import Writer

from uav_task_alloc.errors import InvalidValue

METADATA_NAME = 'uav_task_alloc'  # of the metadata record: origin, speedup
_CHUNK = 512 * 1024  # [bytes] in memory at most, before compression


class Bag:
    """An MCAP file of ROS 2 messages; what was flushed survives a crash of the process.

    Memory: one chunk, and an index of each chunk written (0.6 kB with messages of three topics,
    2.4 kB with those of thirty).

    Args:
        path: of the file; its folder is created where it is missing.
        about: metadata: origin, speedup.

    Raises:
        InvalidValue: the file exists and is not empty.
        OSError: the file cannot be written.
    """

    def __init__(self, path: Path, about: Mapping[str, str]) -> None:
        if path.exists() and path.stat().st_size:
            raise InvalidValue('record', str(path), 'a file that is not there yet')
        path.parent.mkdir(parents=True, exist_ok=True)
        self.file = path.open('wb')
        self.writer = Writer(self.file, chunk_size=_CHUNK)
        self.writer.start(profile=Profile.ROS2, library='uav_task_alloc')
        self.writer.add_metadata(METADATA_NAME, dict(about))
        self.flush()
        self.schemas: dict[str, int] = {}
        self.channels: dict[str, tuple[int, int]] = {}  # topic: channel, messages so far

    def open(self, topic: str, type_name: str, definition: str) -> None:
        """Register a topic.

        Args:
            topic: fully qualified name.
            type_name: as `package/msg/Type`.
            definition: text of the type and of all types it contains, as MCAP specifies.
        """
        if type_name not in self.schemas:
            self.schemas[type_name] = self.writer.register_schema(
                type_name, SchemaEncoding.ROS2, definition.encode())
        channel = self.writer.register_channel(topic, MessageEncoding.CDR,
                                               self.schemas[type_name])
        self.channels[topic] = (channel, 0)

    def add(self, topic: str, data: bytes, received: int, published: int) -> None:
        """Add one message.

        Args:
            topic: registered before.
            data: the message as CDR.
            received, published: [ns] since the epoch.
        """
        channel, count = self.channels[topic]
        self.channels[topic] = (channel, count + 1)
        self.writer.add_message(channel, received, data, published, count)

    def flush(self) -> None:
        """Write the current chunk, which is then readable without the end of the file."""
        self.writer.flush()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Write the index and close the file."""
        if not self.file.closed:
            try:
                self.writer.finish()  # type: ignore[no-untyped-call]
            finally:
                self.file.close()

    def __enter__(self) -> Bag:
        """`with Bag(...) as bag`."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Close."""
        self.close()
