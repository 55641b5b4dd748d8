# SPDX-License-Identifier: Apache-2.0
"""The fence that one vehicle is to carry: chosen again as zones, list and flight change."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.fence.choice import Fence, FlightSpace, choose_fence
from uav_task_alloc.mavlink.fence.fence_parameters import FenceParameters
from uav_task_alloc.mavlink.fence.onboard_fence import FenceState, OnboardFence
from uav_task_alloc.mavlink.fence.shapes import fence_items, shapes_of_items
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.mission.items import Item
from uav_task_alloc.model import Point

_PERIOD = 1.0  # [s] between choices


class WantedFence:
    """Chooses what the transfer is to bring on board.

    Args:
        origin: of the ENU frame.
        telemetry: of the vehicle.
        onboard: its mission and list.
        policy: returns the present parameters.
        parameters: of the vehicle.
        transfer: its fence on board; `wanted` is set here.

    Attributes:
        fence: the choice.
        changed_at: steady time [s] of its last change.
    """

    def __init__(self, origin: Origin, telemetry: Telemetry, onboard: OnboardMission,
                 policy: Callable[[], Policy], parameters: FenceParameters,
                 transfer: OnboardFence) -> None:
        self._origin, self._telemetry, self._onboard = origin, telemetry, onboard
        self._policy, self._parameters, self._transfer = policy, parameters, transfer
        self.fence = Fence()
        self._chosen_for: object = None
        self._choose_at = self.changed_at = -1e9  # [s]
        self._entered_for: tuple[FlightSpace, tuple[tuple[Item, ...], ...]] | None = None
        self._is_entered = False  # the answer of `is_entered` for that

    def choose(self, now: float, at_once: bool = False) -> None:
        """Choose again where what the choice depends on has changed.

        Args:
            now: steady time [s].
            at_once: also within _PERIOD of the last choice.
        """
        policy, telemetry, transfer = self._policy(), self._telemetry, self._transfer
        if (now < self._choose_at and not at_once) or not (
                telemetry.has_position and policy.zones_known):
            return
        key = self._key(policy)
        if key == self._chosen_for and (not self.fence.waiting or now < self._choose_at):
            return
        self._choose_at = now + _PERIOD
        space = self._space()
        self._chosen_for = key
        carried = self.fence.shapes if self._is_verified else ()
        self.fence = choose_fence(policy.zones, policy.fence_area, space, transfer.budget,
                                  self._origin, carried)
        wanted = fence_items(self.fence.shapes, self._origin)
        if wanted != transfer.wanted:
            transfer.wanted, self.changed_at = wanted, now

    def is_entered(self) -> bool:
        """Whether the list passes where the fence on board forbids it, and is to be changed."""
        transfer = self._transfer
        if self._is_verified or transfer.wanted is None or (
                transfer.held is not None and not transfer.is_own):
            return False
        key = replace(self._space(), position=None), transfer.possible
        if key != self._entered_for:  # else as at the messages before
            self._entered_for = key
            self._is_entered = any(key[0].enters(shape) for items in key[1]
                                   for shape in shapes_of_items(items, self._origin))
        return self._is_entered

    @property
    def _is_verified(self) -> bool:
        return self._transfer.state is FenceState.VERIFIED

    def _key(self, policy: Policy) -> object:
        telemetry, onboard = self._telemetry, self._onboard
        return (policy.zones, policy.fence_area, policy.cruise_altitude, telemetry.home,
                telemetry.airborne, onboard.tasks, len(onboard.progress.completed),
                onboard.progress.items, onboard.progress.current, self._transfer.budget,
                self._parameters.return_height, self._parameters.plans_around, self._returns,
                self._is_verified)

    def _space(self) -> FlightSpace:
        """Where the vehicle flies: its list, the mission on board, home, and the heights."""
        telemetry, policy = self._telemetry, self._policy()
        home = telemetry.home or telemetry.position
        start = telemetry.position if telemetry.airborne else home
        planned = self._planned()
        onboard = self._onboard.progress
        flown = [item.position for item in onboard.items[onboard.current or 0:]
                 if item.position is not None] if telemetry.airborne else []
        rise = home[2] + max(policy.cruise_altitude, self._parameters.return_height)
        heights = [p[2] for p in (*planned, *flown)] or [rise]
        # a vehicle that flies around its fence does not return straight
        ends = (home,) if self._returns and not self._parameters.plans_around else ()
        return FlightSpace(
            ((start, *planned, *ends), (start, *flown), (home,)), min(heights),
            max(*heights, rise), telemetry.position if telemetry.airborne else None)

    @property
    def _returns(self) -> bool:
        """Whether its list ends with a return."""
        return self._onboard.tasks is not None and self._onboard.remaining().returns

    def _planned(self) -> list[Point]:
        """The points of the list that are still to be flown."""
        onboard = self._onboard
        if onboard.tasks is None:
            return []
        tasks = onboard.remaining()
        points = [p for stop in tasks.stops for p in (*stop.via, *stop.way)]
        return points + list(tasks.tail)
