# SPDX-License-Identifier: Apache-2.0
"""Diagnostics of the allocator: what an operator should know, and its figures."""
from __future__ import annotations

import time

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.persistence.persistence import Persistence
from uav_task_alloc.allocator.status import health_values, health_warnings
from uav_task_alloc.nodes.conversions.diagnostics import allocator_row, from_diagnostics
from uav_task_alloc.nodes.conversions.messages import INPUT_ANNOUNCEMENTS, INPUT_EVENTS, LATCHED
from uav_task_alloc.nodes.ros.clock_watch import ClockOffsets, watch_clock
from uav_task_alloc.nodes.ros.leader_election import LeaderElection
from uav_task_alloc.nodes.ros.origin_check import OriginCheck
from uav_task_alloc.nodes.ros.solver_thread import SolverThread
from uav_task_alloc.nodes.ros.unheard_publishers import unheard_publishers

_INPUTS = {'task_announcements': INPUT_ANNOUNCEMENTS, 'threat_zones': LATCHED,
           'task_events': INPUT_EVENTS, 'fleet_origin': LATCHED}


class AllocatorDiagnostics:
    """Publishes one row on `/diagnostics` with each call.

    Args:
        node: of the allocator.
        core: its plans and its world.
        persistence: its journal.
        origins: of the nodes of the fleet.
        election: which allocator leads.
        solver: whose error is reported.

    Attributes:
        offsets: of the clocks of those who report.
        refused_zones: which zones of the last message were refused, and why; '' for none.
    """

    def __init__(self, node: Node, core: Allocator, persistence: Persistence,
                 origins: OriginCheck, election: LeaderElection, solver: SolverThread) -> None:
        self._node, self._core, self._persistence = node, core, persistence
        self._origins, self._election, self._solver = origins, election, solver
        self._clock = watch_clock(node, node.get_logger().warning)
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._logged_conflict = ''  # of origins
        self.offsets = ClockOffsets('reports')
        self.refused_zones = ''

    def publish(self, stamp: float) -> None:
        """Publish warnings and figures, and log where the origins of nodes begin to differ.

        Args:
            stamp: the published clock [s].
        """
        node, core = self._node, self._core
        conflict = self._origins.conflict()
        stopped = self._election.trouble() or (conflict and f'refuses to plan: {conflict}')
        if conflict != self._logged_conflict:
            self._logged_conflict = conflict
            node.get_logger().error(stopped if conflict else 'fleet_origin: all agree')
        values = health_values(core.world, core.schedule.busy, core.separation.texts(),
                               core.batteries.texts(stamp), core.waiting.texts())
        self._publisher.publish(from_diagnostics([allocator_row(
            node.get_fully_qualified_name(), [stopped] if stopped else self._warnings(stamp),
            {**values, **self._election.facts()}, bool(stopped))], stamp))

    def _warnings(self, stamp: float) -> list[str]:
        """What an operator should know."""
        now, sources = time.monotonic(), self._node.count_publishers('threat_zones')
        several = (f'threat_zones has {sources} publishers: expected one, as each message '
                   'replaces all zones') if sources > 1 else ''
        return [*health_warnings(self._core.world, self._persistence.error, self._solver.error,
                                 stamp),
                *filter(None, (self._clock.warning(now), self.offsets.warning(now),
                               self.refused_zones)),
                *unheard_publishers(self._node, _INPUTS), *filter(None, [several])]
