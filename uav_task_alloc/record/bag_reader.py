# SPDX-License-Identifier: Apache-2.0
"""Reader of an MCAP file as the lines of a record, up to the first damage."""
from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Callable, Container, Iterator
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
_ORIGIN, _LIST = _PACKAGE + 'FleetOrigin', _PACKAGE + 'TaskList'
_ANNOUNCEMENT = _PACKAGE + 'TaskAnnouncement'
_AREA, _AREA_TOPIC = 'geometry_msgs/msg/PolygonStamped', '/fence_area'
_DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
# [s] back that are a step of the recorder's clock; less are messages of several topics that were
# written in another order than received
_STEP_BACK = 2.0
_MAX_RECORD_SIZE = 2**30  # [bytes]; a larger size is damage
# by type, so that the names of the topics do not matter
_BUILDERS: dict[str, Callable[[Any], message_records.RecordBody]] = {
    _PACKAGE + 'ThreatZoneArray': message_records.zones_record,
    _PACKAGE + 'TaskStatusArray': message_records.statuses_record,
    _PACKAGE + 'Allocation': message_records.allocation_record,
    _LIST: message_records.task_list_record,
    _PACKAGE + 'UavState': message_records.state_record,
    _PACKAGE + 'SeparationAlert': message_records.separation_record,
    _PACKAGE + 'PlanProposal': message_records.proposal_record,
    _ORIGIN: message_records.origin_record,
    _AREA: message_records.fence_area_record,
    _DIAGNOSTICS: diagnostic_records.uploads_record}
_TYPES = frozenset({*_BUILDERS, _ANNOUNCEMENT})


class BagReader:
    """The lines of one fleet in an MCAP file; iterate once.

    Afterwards `damage` is a text on the damage that ended the iteration, or '', `undecodable`
    has the number of undecodable messages by topic, and `unplaced` the ids of tasks in degrees
    that are left out, as there is no origin.

    Args:
        path: of the MCAP file.
        namespace: of the fleet; None: the only one.
        types: of the messages that are read.

    Arguments of methods:
        file: open, binary.
        message: as stored, with its channel.

    Raises:
        OSError: while iterating; the file cannot be read.
        InvalidValue: while iterating; it is no MCAP file, or has several fleets.
    """

    def __init__(self, path: Path, namespace: str | None = None,
                 types: Container[str] = _TYPES) -> None:
        self.path, self.types = path, types
        self.namespace = None if namespace is None else f'/{namespace.strip("/")}'
        self.namespaces: dict[str, str] = {}  # by the last part of topics
        self.damage = ''
        self.undecodable: Counter[str] = Counter()  # messages by topic
        self.counted: Counter[str] = Counter()  # messages by topic
        self.unplaced: set[str] = set()
        self.origin: Origin | None = None
        self.origin_sought = False
        self.newest, self.offset = -math.inf, 0.0  # [s]
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.decoders = DecoderFactory()

    def __iter__(self) -> Iterator[Line]:
        with self.path.open('rb') as file:
            try:
                yield from self.records(file)
            except InvalidValue:
                raise
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
        if (schema is None or schema.name not in self.types
                or not self.is_of_fleet(channel.topic, schema.name)):
            return
        try:
            decode = self.decoders.decoder_for(channel.message_encoding, schema)
            if decode is None:
                raise ValueError(f'{channel.message_encoding}: expected cdr')
            msg = decode(message.data)
            if schema.name == _DIAGNOSTICS and self.namespace is not None:
                msg.status = diagnostic_records.of_namespace(msg, self.namespace)
            body = (self.announcement if schema.name == _ANNOUNCEMENT
                    else _BUILDERS[schema.name])(msg)
        except Exception:  # the decoder raises anything for bytes of another type
            self.undecodable[channel.topic] += 1
            return
        if body['kind'] == 'origin':
            self.origin = Origin(*(body[name] for name in (
                'latitude', 'longitude', 'altitude_amsl')))
        wall = self.time(message.log_time * 1e-9)
        yield {'wall': wall, **message_records.shifted(body, self.offset)}

    def time(self, logged: float) -> float:
        """The time of a line [unix s]: it goes on where the clock of the recorder went back.

        Args:
            logged: `log_time` of its message [s].
        """
        if logged + self.offset < self.newest - _STEP_BACK:
            self.offset = self.newest - logged
        self.newest = max(self.newest, logged + self.offset)
        return logged + self.offset

    def announcement(self, msg: Any) -> message_records.RecordBody:
        """The record of a TaskAnnouncement, by the first origin of the file where none is known.

        Args:
            msg: TaskAnnouncement.
        """
        in_degrees = {task.task_id for task in msg.tasks if task.frame == message_records.WGS84}
        if in_degrees and self.origin is None and not self.origin_sought:
            self.origin_sought = True
            ahead = BagReader(self.path, self.namespace, {_ORIGIN})
            next((line for line in ahead if line['kind'] == 'origin'), None)
            self.origin = ahead.origin
        if self.origin is None:
            self.unplaced |= in_degrees
        return message_records.announcement_record(msg, self.origin)

    def is_of_fleet(self, topic: str, type_name: str) -> bool:
        """Whether a topic is of the fleet that is read.

        Args:
            topic: its full name.
            type_name: of its messages.

        Raises:
            InvalidValue: it is of another fleet than those before, and none was chosen.
        """
        if type_name == _DIAGNOSTICS:
            return True
        if type_name == _AREA and not topic.endswith(_AREA_TOPIC):
            return False
        *above, name = topic.split('/')
        namespace = '/'.join(above[:-1] if type_name == _LIST else above) or '/'  # <uav_id>/
        if self.namespace is not None:
            return namespace == self.namespace
        other = self.namespaces.setdefault(name, namespace)
        if other != namespace:
            raise InvalidValue('file', str(self.path), f'one fleet, found {name} of {other} and '
                               f'of {namespace}; choose one with --namespace')
        return True
