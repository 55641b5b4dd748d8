# SPDX-License-Identifier: Apache-2.0
"""When a vehicle arms and takes off, and when one that was armed by us is disarmed again."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.authority import Authority
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.return_path import zone_in_the_way
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry


class Takeoff:
    """Off the ground where the list has tasks, the bridge has the vehicle, and nothing waits."""

    def __init__(
        self,
        helm: CommandSender,
        telemetry: Telemetry,
        board: OnboardMission,
        authority: Authority,
        policy: Callable[[], Policy],
    ) -> None:
        self._helm, self._telemetry, self._board = helm, telemetry, board
        self._authority, self._policy = authority, policy

    def lift(self, now: float) -> NextMessages:
        """Armed by us: it takes off before anything else, or is disarmed."""
        if not self._helm.armed_here or self._telemetry.airborne or not self._authority.held:
            return None
        return self.rise(now) if self._wants_to_fly() else self._helm.disarm(now)

    def rise(self, now: float) -> NextMessages:
        """Arm, take off and climb; satisfied in the air."""
        telemetry, helm, policy = self._telemetry, self._helm, self._policy()
        if telemetry.airborne and not helm.climbing:
            return None
        if not self._authority.held:
            return helm.wait('~/hand_over: it has landed' if self._authority.landed else
                             'a pilot to arm and take off (takeoff is false)')
        if policy.grounded and not helm.climbing:
            return helm.wait(policy.grounded)
        home = telemetry.home or telemetry.position
        zone = zone_in_the_way(home, home, policy.zones)
        if zone is not None and not helm.climbing:
            return helm.wait(f'zone {zone.id} to leave its home')

        return helm.rise(policy.cruise_altitude, self._wants_to_fly, now)

    def _wants_to_fly(self) -> bool:
        return (self._authority.held and self._board.tasks is not None
                and not (self._policy().grounded and not self._telemetry.airborne)
                and bool(self._board.remaining().stops))
