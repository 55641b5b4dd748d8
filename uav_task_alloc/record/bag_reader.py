# SPDX-License-Identifier: Apache-2.0
"""Reads an MCAP file of a fleet as the lines of a record, as far as the file goes."""
from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from zstandard import ZstdError

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import check_number
from uav_task_alloc.record import message_records as lines
from uav_task_alloc.record.bag import ABOUT
from uav_task_alloc.record.run_state import Line

_OURS = 'uav_task_alloc_msgs/msg/'
_LONGEST = 2**30  # [bytes] of a record that is believed in
# by type, so that the namespace of a fleet does not matter
READ: dict[str, Callable[[Any], lines.RecordBody]] = {
    _OURS + 'ThreatZoneArray': lines.announced_zones, _OURS + 'TaskStatusArray': lines.statuses,
    _OURS + 'Allocation': lines.allocation_record, _OURS + 'TaskList': lines.task_list_record,
    _OURS + 'UavState': lines.state, 'diagnostic_msgs/msg/DiagnosticArray': lines.uploads}
TASKS = _OURS + 'TaskAnnouncement'


class BagReader:
    """Iterate once for the lines; afterwards `trouble` says what could not be read, if anything.

    Raises OSError where there is no file, InvalidValue where it is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.trouble = ''
        self.unread: Counter[str] = Counter()  # messages by topic that make no sense
        self.counted: Counter[str] = Counter()  # messages by topic
        self.origin: Origin | None = None
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.decoders = DecoderFactory()

    def __iter__(self) -> Iterator[Line]:
        with self.path.open('rb') as file:
            try:
                yield from self.records(file)
            except InvalidMagic:
                if file.tell() <= 8:
                    raise InvalidValue('file', str(self.path), 'an MCAP file') from None
                self.trouble = 'its last bytes are not those of an MCAP file'
            except EndOfFile:
                if not self.counted and file.seek(0, 2) < 8:
                    raise InvalidValue('file', str(self.path), 'an MCAP file') from None
                self.trouble = 'it was not closed: the recorder was killed, or it still records'
            except (McapError, ZstdError, struct.error, ValueError, MemoryError) as error:
                self.trouble = f'it is damaged after {self.counted.total()} messages: {error}'

    def records(self, file: IO[bytes]) -> Iterator[Line]:
        """The lines, until the end or the first fault."""
        for record in StreamReader(file, record_size_limit=_LONGEST, validate_crcs=True).records:
            if isinstance(record, Schema):
                self.schemas[record.id] = record
            elif isinstance(record, Channel):
                self.channels[record.id] = record
            elif isinstance(record, Metadata) and record.name == ABOUT:
                yield from self.about(record.metadata)
            elif isinstance(record, Message):
                yield from self.line(record)

    def about(self, told: dict[str, str]) -> Iterator[Line]:
        """What the recorder knew of the run."""
        try:
            if 'origin.latitude' in told:
                self.origin = Origin(*(float(told[f'origin.{name}']) for name in (
                    'latitude', 'longitude', 'altitude_amsl')))
            yield {'kind': 'run', 'speedup': check_number(
                'speedup', float(told.get('speedup', 1.0)), 0.0, 1e6, open_low=True)}
        except (KeyError, ValueError):
            self.unread['about'] += 1

    def line(self, message: Message) -> Iterator[Line]:
        """A message of a type that a report wants."""
        channel = self.channels[message.channel_id]
        schema = self.schemas.get(channel.schema_id)
        self.counted[channel.topic] += 1
        if schema is None or (schema.name not in READ and schema.name != TASKS):
            return
        try:
            decode = self.decoders.decoder_for(channel.message_encoding, schema)
            if decode is None:
                raise ValueError(f'{channel.message_encoding}: expected cdr')
            body = (
                lines.announced_tasks(decode(message.data), self.origin)
                if schema.name == TASKS
                else READ[schema.name](decode(message.data))
            )
        except Exception:  # whatever a decoder makes of bytes that are none of its type
            self.unread[channel.topic] += 1
            return
        yield {'wall': message.log_time * 1e-9, **body}
