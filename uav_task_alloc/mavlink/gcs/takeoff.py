# SPDX-License-Identifier: Apache-2.0
"""Arms a vehicle and has it take off, or disarms one that we armed and that must not fly."""
from __future__ import annotations

from collections.abc import Callable

from uav_task_alloc.geometry.zones_on_path import zone_across_path
from uav_task_alloc.mavlink.gcs.authority import Authority
from uav_task_alloc.mavlink.gcs.command_sender import CommandSender, NextMessages
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.two_vehicles import TWO_VEHICLES
from uav_task_alloc.zone_codec import OUTSIDE_AREA


class Takeoff:
    """Takes off where the list has tasks, authority is HELD, and nothing forbids it.

    Args:
        sender: of the commands to the vehicle.
        telemetry: of the vehicle.
        onboard: its mission and list.
        authority: over the vehicle.
        policy: returns the present parameters.
        held_by: who holds it, and why; '': nobody.
        fence_missing: what its fence lacks for a take-off; '': nothing.
    """

    def __init__(
        self,
        sender: CommandSender,
        telemetry: Telemetry,
        onboard: OnboardMission,
        authority: Authority,
        policy: Callable[[], Policy],
        held_by: Callable[[], str] = lambda: '',
        fence_missing: Callable[[], str] = lambda: '',
    ) -> None:
        self._sender, self._telemetry, self._onboard = sender, telemetry, onboard
        self._authority, self._policy = authority, policy
        self._held_by, self._fence_missing = held_by, fence_missing

    def continue_takeoff(self, now: float) -> NextMessages:
        """Let a vehicle that we armed take off before anything else is sent, or disarm it."""
        if self._sender.climbs_by_mission:
            self._sender.armed_here = False
        if self._sender.armed_here and self._sender.left_ground and self._authority.held:
            if self._sender.started_mission:
                self._sender.armed_here = False  # a hold has ended the climb by its mission
            else:
                self._sender.took_off(now)  # neither an ACK nor telemetry showed it in time
        if not self._sender.armed_here or self._telemetry.airborne or not self._authority.held:
            return None
        return self.take_off(now) if self._wants_to_fly() else self._sender.disarm(now)

    def take_off(self, now: float) -> NextMessages:
        """Arm, take off and climb; None: it is airborne and does not climb."""
        telemetry, sender, policy = self._telemetry, self._sender, self._policy()
        if telemetry.airborne and not sender.climbing:
            return None
        if not self._authority.held:
            return sender.wait('~/hand_over: it has landed' if self._authority.landed else
                               'a pilot to arm and take off (takeoff is false)')
        if not sender.climbing:
            mixed = TWO_VEHICLES if telemetry.two_vehicles.found(now) else ''
            why = mixed or policy.grounded or self._fence_missing()
            if why:
                return sender.wait(why)
            if departure := self._departure():
                return sender.wait_for(departure)
            if zone := self._zone_over_start():
                return sender.wait(zone)
        climbed, out = sender.climbing, sender.take_off(
            policy.cruise_altitude, self._wants_to_fly, now)
        if climbed and out is None and self._held_by():
            return []  # the hold, which has waited for the end of the climb, comes first
        return out

    def _wants_to_fly(self) -> bool:
        stays = (self._held_by() or self._policy().grounded or self._fence_missing()
                 or self._departure() or self._zone_over_start())
        return (self._authority.held and self._onboard.tasks is not None
                and not (stays and not self._telemetry.airborne)
                and bool(self._onboard.remaining().stops))

    def _departure(self) -> str:
        """What a vehicle on the ground waits for, no fault; '': its departure is due."""
        policy = self._policy()
        return policy.settling or self._onboard.list.waits.grounded(policy.clock)

    def _zone_over_start(self) -> str:
        """The zone over its home, or where it stands, that it waits for; '': there is none."""
        here, zones = self._telemetry.position, self._policy().no_fly_zones
        for place, name in ((self._telemetry.home or here, 'the home'), (here, 'its place')):
            zone = zone_across_path(place, place, zones)
            if zone is not None and zone.id.startswith(OUTSIDE_AREA):
                return f'another fence_area: {name} is outside of it'
            if zone is not None:
                return f'zone {zone.id} to be removed: it covers {name}'
        return ''
