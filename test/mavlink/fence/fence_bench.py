# SPDX-License-Identifier: Apache-2.0
"""Flights with fences: zones for the bridge, and what the simulated vehicle has in its store."""
import random
from dataclasses import replace

from flight_bench import FlightBench
from mission_bench import ORIGIN
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.fence.onboard_fence import FenceState
from uav_task_alloc.mavlink.gcs.fence_store import FenceFileStore
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation
from uav_task_alloc.model import ThreatZone

FENCE = d.MAV_MISSION_TYPE_FENCE
TOWER = ThreatZone.cylinder('tower', (250.0, 300.0), 30.0, margin=10.0)
FIELD = ThreatZone.polygon('field', [(600, 0), (800, 0), (800, 200), (700, 100), (600, 200)],
                           margin=20.0)
ENABLED = {'ardupilot': (('FENCE_ENABLE', 1.0),), 'px4': ()}


class FenceBench(FlightBench):
    """One vehicle that carries fences."""

    def __init__(self, *kinds, zones=(TOWER, FIELD), fences='warn', config=None, folder=None,
                 **kwargs):
        self.folder = folder
        config = {'parameters': ENABLED[kinds[0]], **(config or {})}
        self.both_busy = False  # a transfer of a mission and one of a fence, at any time
        super().__init__(*kinds, configs=dict.fromkeys((1, 2), config), fences=fences,
                         zones=tuple(zones), zones_known=True, **kwargs)

    def start(self):
        super().start()
        if self.folder is not None:
            self.ground_station = GroundStation(
                GcsConfig(origin=ORIGIN, policy=self.policy), random.Random(self.seed), self.store,
                None, FenceFileStore(self.folder, self.notes.append))

    def set_zones(self, *zones):
        self.policy = replace(self.policy, zones=zones)
        for session in self.ground_station.sessions.values():
            session.executor.policy = self.policy

    @property
    def fence(self):
        return self.executor().fence

    @property
    def vehicle(self):
        return self.vehicles[1]

    @property
    def held(self):
        return self.vehicle.mission.stores.get(FENCE, [])

    def state_is(self, state):
        return lambda: self.fence.state is state

    def settle(self, state=FenceState.VERIFIED, limit=120.0):
        assert self.run(lambda: self.ground_station.sessions and self.fence.state is state,
                        limit), (self.fence.state, self.fence.text)
        return self

    def _move(self):
        super()._move()
        for session in self.ground_station.sessions.values():
            executor = session.executor
            self.both_busy |= executor.onboard.upload.busy and executor.fence.transfer.busy

    def sent(self, kind, mission_type=FENCE):
        return [m for m in self.line.sent(kind) if m.mission_type == mission_type]

    def store_by_another(self, *items):
        """Put items into the fence store, as another station does."""
        self.held[:] = items
        self.vehicle.fence.update()
