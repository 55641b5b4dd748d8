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

    name: str  # starts with the node's name
    level: int  # DiagnosticLevel
    message: str  # on one line
    values: Mapping[str, object] = field(default_factory=dict)  # details by key
    hardware_id: str = ''  # UAV, link or part; '': the node


def from_diagnostics(rows: Iterable[DiagnosticRow], now: float) -> DiagnosticArray:
    """Return some rows as a message.

    Args:
        rows: one a DiagnosticStatus.
        now: [s] for the stamp.

    Returns:
        For the topic `/diagnostics`.
    """
    return DiagnosticArray(header=header(now), status=[
        DiagnosticStatus(level=bytes([row.level]), name=row.name, message=row.message,
                         hardware_id=row.hardware_id, values=[
                             KeyValue(key=key, value=str(value))
                             for key, value in row.values.items()])
        for row in rows])


def allocator_row(node_name: str, warnings: Sequence[str], values: Mapping[str, object],
                  stopped: bool) -> DiagnosticRow:
    """Return the row of an allocator.

    Args:
        node_name: fully qualified; other allocators find it by that.
        warnings: what an operator should know; empty: nothing.
        values: figures by name.
        stopped: whether the warnings are the reasons why it publishes nothing.

    Returns:
        Level ERROR where it is stopped, WARN where there are warnings, else OK.
    """
    level = DiagnosticLevel.WARN if warnings else DiagnosticLevel.OK
    return DiagnosticRow(f'{node_name}: allocation', DiagnosticLevel.ERROR if stopped else level,
                         '; '.join(warnings) or 'running', values)


def bridge_row(node_name: str, name: str, level: int, message: str,
               values: Mapping[str, object] | None = None) -> DiagnosticRow:
    """Return a row of the bridge: of a UAV, a link, or a part of the bridge itself.

    Args:
        node_name: fully qualified: `/diagnostics` is of all fleets.
        name: of the UAV, link or part.
        level: DiagnosticLevel.
        message: on one line.
        values: details by key.

    Returns:
        Named `NODE: NAME`.
    """
    return DiagnosticRow(f'{node_name}: {name}', level, message, values or {}, name)
