# SPDX-License-Identifier: Apache-2.0
"""Diagnostics of both nodes as DiagnosticArray messages."""
from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from uav_task_alloc.nodes.conversions.messages import header


class DiagnosticLevel(IntEnum):
    """Levels of a DiagnosticStatus message."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class DiagnosticRow:
    """One DiagnosticStatus: what it is about, its level, a sentence and details."""

    name: str
    level: int  # DiagnosticLevel
    message: str
    values: Mapping[str, object] = field(default_factory=dict)
    hardware_id: str = ''


def from_diagnostics(rows: Iterable[DiagnosticRow], now: float) -> DiagnosticArray:
    """The message of some rows; `now` [s] is its stamp."""
    return DiagnosticArray(header=header(now), status=[
        DiagnosticStatus(level=bytes([row.level]), name=row.name, message=row.message,
                         hardware_id=row.hardware_id, values=[
                             KeyValue(key=key, value=str(value))
                             for key, value in row.values.items()])
        for row in rows])


def allocator_row(node_name: str, warnings: Sequence[str], values: Mapping[str, object],
                  stopped: bool) -> DiagnosticRow:
    """The row of an allocator.

    Args:
        node_name: fully qualified; other allocators find it by that.
        warnings: what an operator should know; empty: nothing.
        values: figures by name.
        stopped: whether the warnings are the reasons why it publishes nothing.
    """
    level = DiagnosticLevel.WARN if warnings else DiagnosticLevel.OK
    return DiagnosticRow(f'{node_name}: allocation', DiagnosticLevel.ERROR if stopped else level,
                         '; '.join(warnings) or 'running', values)


def bridge_row(name: str, level: int, message: str,
               values: Mapping[str, object] | None = None) -> DiagnosticRow:
    """A row of the bridge: of a UAV, a link, or a part of the bridge itself."""
    return DiagnosticRow(f'mavlink_bridge: {name}', level, message, values or {}, name)
