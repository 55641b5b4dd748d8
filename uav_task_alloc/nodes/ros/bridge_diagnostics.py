# SPDX-License-Identifier: Apache-2.0
"""Diagnostics of the bridge: a row for each UAV, link, and part of the bridge that can fail."""
from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial

from uav_task_alloc.errors import counted
from uav_task_alloc.mavlink.gcs.ground_station import GroundStation
from uav_task_alloc.mavlink.gcs.vehicle_diagnostics import diagnostics_of
from uav_task_alloc.mavlink.transport.connections import Connections
from uav_task_alloc.mavlink.transport.heartbeat import Heartbeat
from uav_task_alloc.nodes.conversions.diagnostics import (
    DiagnosticLevel,
    DiagnosticRow,
    bridge_row,
)
from uav_task_alloc.nodes.conversions.message_limits import printable
from uav_task_alloc.nodes.ros.leveled_log import LeveledLog

_SEARCH_TIME = 10.0  # [s]
_VERBS = {'udpin': 'listens on', 'udpout': 'sends to', 'tcp': 'connects to'}
_OK, _WARN, _ERROR = DiagnosticLevel.OK, DiagnosticLevel.WARN, DiagnosticLevel.ERROR


class BridgeDiagnostics:
    """Reads the state of a bridge's parts; troubles that begin or end are logged as well.

    Args:
        node_name: fully qualified.
        ground_station: its vehicles and refusals.
        connections: their links and refusals.
        heartbeat: the thread that sends it.
        log: of the node.
    """

    def __init__(self, node_name: str, ground_station: GroundStation, connections: Connections,
                 heartbeat: Heartbeat, log: LeveledLog) -> None:
        self._row = partial(bridge_row, node_name)
        self._ground_station, self._connections = ground_station, connections
        self._heartbeat, self._log = heartbeat, log
        self._refusals = (ground_station.refusals, connections.refusals)
        self._refused = 0  # messages until the last call
        self.search_over = False  # a vehicle was found, or that there is none was logged
        self._search_since = math.inf  # [s] steady clock

    def log_start(self, systems: Sequence[int], now: float) -> None:
        """Log each connection.

        Args:
            systems: parameter `system_ids`; empty: all.
            now: steady clock [s].
        """
        of = f'systems {", ".join(map(str, systems))}' if systems else 'all MAVLink systems'
        for link in self._connections.links:
            self._log.write('info', f'{_VERBS.get(link.name.split(":")[0], "opens")} '
                                    f'{link.name} for {of}')
        self._search_since = now

    def log_search(self, now: float) -> None:
        """Log once that no vehicle was found for a while; `now` is the steady clock [s]."""
        if not self.search_over and now - self._search_since > _SEARCH_TIME:
            self.search_over = True
            names = ', '.join(link.name for link in self._connections.links)
            self._log.write('warning', f'no vehicle found for {_SEARCH_TIME:g} s: expected the '
                                       f'heartbeat of an autopilot on {names}')

    def log_refusals(self) -> None:
        """Log which messages of vehicles were dropped."""
        for refusals in self._refusals:
            while refusals.notes:
                note = refusals.notes.popleft()
                self._log.write(note.level, note.text)

    def vehicle_rows(self, now: float) -> list[DiagnosticRow]:
        """A row for each UAV; to be called with the lock of the ground station.

        Args:
            now: steady time [s].
        """
        rows = [(session.uav_id, diagnostics_of(session, now))
                 for session in self._ground_station.sessions.values()]
        return [self._row(uav_id, each.level, each.summary, asdict(each.facts))
                for uav_id, each in rows]

    def part_rows(self, conflict: str, unheard: Sequence[str] = (),
                  late_hold: str = '', shared_ids: str = '',
                  still_clock: str = '') -> Iterator[DiagnosticRow]:
        """A row for each link and other part.

        Args:
            conflict: why the origins of the nodes differ; '' where they agree.
            unheard: a sentence for each publisher that is not received.
            late_hold: what is wrong with a hold that expires too early; '' where none does.
            shared_ids: which UAVs another node reports, too; '' for none.
            still_clock: that simulated time stands still, which was logged; '' while it runs.
        """
        refusal = conflict and f'refuses to fly new lists: {conflict}'
        self._log.report_trouble('fleet_origin', refusal)
        if refusal:
            yield self._row('fleet_origin', _ERROR, refusal)
        if refused := self._log.refusal('threat_zones'):
            yield self._row('threat_zones', _WARN, f'refused: {refused}')
        if unheard:
            yield self._row('topics', _WARN, '; '.join(unheard))
        if late_hold:
            yield self._row('holds', _WARN, late_hold)
        if still_clock:
            yield self._row('clock', _WARN, still_clock)
        self._log.report_trouble('uav_ids', shared_ids, 'warning')
        if shared_ids:
            yield self._row('uav_ids', _WARN, shared_ids)
        yield from self._link_rows()
        if self._connections.signing is not None:
            trouble = self._connections.signing.trouble
            self._log.report_trouble('signing', trouble, 'warning')
            yield self._row('signing', _WARN if trouble else _OK, trouble or 'timestamp kept')
        self._log.report_trouble('tlog', self._connections.record_error, 'warning')
        if self._connections.record_error:
            yield self._row('tlog', _WARN, self._connections.record_error)
        yield self._heartbeat_row()
        yield self._messages_row()

    def _link_rows(self) -> Iterator[DiagnosticRow]:
        """A row for each link; one without vehicles is no line of the log, other bytes are."""
        for link, traffic in zip(self._connections.links, self._connections.traffic, strict=True):
            garbled = traffic.warning if traffic.is_garbled else ''
            self._log.report_trouble(link.name, link.trouble or garbled,
                                     'error' if link.trouble else 'warning')
            level = _ERROR if link.trouble else _WARN if traffic.warning else _OK
            yield self._row(link.name, level, link.trouble or traffic.warning or 'open')

    def _heartbeat_row(self) -> DiagnosticRow:
        beat = self._heartbeat
        return self._row('heartbeat', _ERROR if beat.trouble else _OK,
                         beat.trouble or f'{beat.sent} sent',
                         {'thread_restarts': beat.restarts})

    def _messages_row(self) -> DiagnosticRow:
        """Counts of refused messages; a warning where there are more than at the last call."""
        count, before = sum(refusals.count for refusals in self._refusals), self._refused
        self._refused = count
        return self._row(
            'messages', _WARN if count > before else _OK, f'{counted(count, "message")} refused', {
                'messages_refused': count, 'frames_refused': self._connections.errors(),
                'last_refused': '; '.join(printable(refusals.last) for refusals in self._refusals
                                          if refusals.last)})
