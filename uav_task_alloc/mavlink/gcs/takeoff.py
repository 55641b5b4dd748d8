# SPDX-License-Identifier: Apache-2.0
"""When a vehicle arms and takes off, and when one that was armed by us is disarmed again."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.mavlink.gcs.authority import Authority
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.return_path import zone_across_path
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry


class Takeoff:
    """Off the ground where the list has tasks, the bridge has the vehicle, and nothing waits."""

    def __init__(
        self,
        sender: CommandSender,
        telemetry: Telemetry,
        onboard: OnboardMission,
        authority: Authority,
        policy: Callable[[], Policy],
    ) -> None:
        self._sender, self._telemetry, self._onboard = sender, telemetry, onboard
        self._authority, self._policy = authority, policy

    def lift(self, now: float) -> NextMessages:
        """Armed by us: it takes off before anything else, or is disarmed."""
        if not self._sender.armed_here or self._telemetry.airborne or not self._authority.held:
            return None
        return self.rise(now) if self._wants_to_fly() else self._sender.disarm(now)

    def rise(self, now: float) -> NextMessages:
        """Arm, take off and climb; satisfied in the air."""
        telemetry, sender, policy = self._telemetry, self._sender, self._policy()
        if telemetry.airborne and not sender.climbing:
            return None
        if not self._authority.held:
            return sender.wait('~/hand_over: it has landed' if self._authority.landed else
                             'a pilot to arm and take off (takeoff is false)')
        if policy.grounded and not sender.climbing:
            return sender.wait(policy.grounded)
        home = telemetry.home or telemetry.position
        zone = zone_across_path(home, home, policy.zones)
        if zone is not None and not sender.climbing:
            return sender.wait(f'zone {zone.id} to leave its home')

        return sender.rise(policy.cruise_altitude, self._wants_to_fly, now)

    def _wants_to_fly(self) -> bool:
        return (self._authority.held and self._onboard.tasks is not None
                and not (self._policy().grounded and not self._telemetry.airborne)
                and bool(self._onboard.remaining().stops))
