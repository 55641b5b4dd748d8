# SPDX-License-Identifier: Apache-2.0
"""Reader of an MCAP file as the lines of a record, up to the first damage."""
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

from uav_task_alloc.checks import check_number
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.record import diagnostic_records, message_records
from uav_task_alloc.record.bag import METADATA_NAME
from uav_task_alloc.record.record_file import Line

_PACKAGE = 'uav_task_alloc_msgs/msg/'
_MAX_RECORD_SIZE = 2**30  # [bytes]; a larger size is damage
# by type, so that the namespace of the topics does not matter
_BUILDERS: dict[str, Callable[[Any], message_records.RecordBody]] = {
    _PACKAGE + 'ThreatZoneArray': message_records.zones_record,
    _PACKAGE + 'TaskStatusArray': message_records.statuses_record,
    _PACKAGE + 'Allocation': message_records.allocation_record,
    _PACKAGE + 'TaskList': message_records.task_list_record,
    _PACKAGE + 'UavState': message_records.state_record,
    _PACKAGE + 'SeparationAlert': message_records.separation_record,
    _PACKAGE + 'FleetOrigin': message_records.origin_record,
    'diagnostic_msgs/msg/DiagnosticArray': diagnostic_records.uploads_record}
_ANNOUNCEMENT = _PACKAGE + 'TaskAnnouncement'


class BagReader:
    """The lines of an MCAP file; iterate once.

    Afterwards `damage` is a text on the damage that ended the iteration, or '', and `undecodable`
    has the number of undecodable messages by topic.

    Args:
        path: of the MCAP file.

    Arguments of methods:
        file: open, binary.
        message: as stored, with its channel.

    Raises:
        OSError: while iterating; the file cannot be read.
        InvalidValue: while iterating; it is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage = ''
        self.undecodable: Counter[str] = Counter()  # messages by topic
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
                self.damage = 'its end is not that of an MCAP file'
            except EndOfFile:
                if not self.counted and file.seek(0, 2) < 8:
                    raise InvalidValue('file', str(self.path), 'an MCAP file') from None
                self.damage = 'it was not closed: the recorder was killed, or is still recording'
            except (McapError, ZstdError, struct.error, ValueError, OverflowError,
                    MemoryError) as error:
                self.damage = f'it is damaged after {self.counted.total()} messages: {error}'

    def records(self, file: IO[bytes]) -> Iterator[Line]:
        """The lines, up to the end of the file; raises errors of mcap at damage."""
        reader = StreamReader(file, record_size_limit=_MAX_RECORD_SIZE, validate_crcs=True)
        for record in reader.records:
            if isinstance(record, Schema):
                self.schemas[record.id] = record
            elif isinstance(record, Channel):
                self.channels[record.id] = record
            elif isinstance(record, Metadata) and record.name == METADATA_NAME:
                yield from self.about(record.metadata)
            elif isinstance(record, Message):
                yield from self.line(record)

    def about(self, metadata: dict[str, str]) -> Iterator[Line]:
        """The line `run` from the metadata, which also has the origin."""
        try:
            if 'origin.latitude' in metadata:
                self.origin = Origin(*(float(metadata[f'origin.{name}']) for name in (
                    'latitude', 'longitude', 'altitude_amsl')))
            yield {'kind': 'run', 'speedup': check_number(
                'speedup', float(metadata.get('speedup', 0.0)), 0.0, 1e6),
                'simulated': metadata.get('simulated') == 'true'}
        except (KeyError, ValueError):
            self.undecodable['about'] += 1

    def line(self, message: Message) -> Iterator[Line]:
        """The line of a message, if its type is recorded."""
        channel = self.channels[message.channel_id]
        schema = self.schemas.get(channel.schema_id)
        self.counted[channel.topic] += 1
        if schema is None or (schema.name not in _BUILDERS and schema.name != _ANNOUNCEMENT):
            return
        try:
            decode = self.decoders.decoder_for(channel.message_encoding, schema)
            if decode is None:
                raise ValueError(f'{channel.message_encoding}: expected cdr')
            body = (
                message_records.announcement_record(decode(message.data), self.origin)
                if schema.name == _ANNOUNCEMENT
                else _BUILDERS[schema.name](decode(message.data))
            )
        except Exception:  # the decoder raises anything for bytes of another type
            self.undecodable[channel.topic] += 1
            return
        if body['kind'] == 'origin':
            self.origin = Origin(*(body[name] for name in (
                'latitude', 'longitude', 'altitude_amsl')))
        yield {'wall': message.log_time * 1e-9, **body}
