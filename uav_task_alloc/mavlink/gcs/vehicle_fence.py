# SPDX-License-Identifier: Apache-2.0
"""Keeps the fence on board of one vehicle true to the zones: when it is transferred, and reported.

A mission comes first: no transfer of a fence begins while one of the mission runs, and it is
cancelled for one. Only a plan that passes where the fence on board forbids it waits for the fence.
"""
from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.errors import counted, first_of
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.geometry.zones_on_path import zones_across_path
from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.fence.choice import Fence
from uav_task_alloc.mavlink.fence.fence_parameters import FenceParameters
from uav_task_alloc.mavlink.fence.onboard_fence import FenceState, ItemKey, OnboardFence
from uav_task_alloc.mavlink.fence.rally import rally_alike
from uav_task_alloc.mavlink.fence.shapes import vertical_extent
from uav_task_alloc.mavlink.gcs.authority import Authority, SendAction
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.gcs.policy import Policy
from uav_task_alloc.mavlink.gcs.rally_transfer import RALLY_BUDGET, RallyTransfer
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.wanted_fence import WantedFence
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import ThreatZone

_SETTLED = 2.0  # [s] in the air without a change of the wanted fence: the new list comes first
_MOST_FAILURES = 3  # transfers until a plan no longer waits for the fence


@dataclass(slots=True)
class FenceMemory:
    """What the bridge has uploaded to a vehicle, over its restarts."""

    own: Iterable[ItemKey] = ()  # items that may be on board
    save: Callable[[frozenset[ItemKey]], None] = lambda own: None


class VehicleFence:
    """The fence of one vehicle.

    Args:
        peer: the vehicle.
        profile: of its autopilot.
        origin: of the ENU frame.
        telemetry: of the vehicle.
        onboard: its mission and list.
        authority: over the vehicle.
        policy: returns the present parameters.
        rng: for back-off jitter.
        memory: of earlier uploads.

    Arguments of methods:
        now: steady time [s].
    """

    def __init__(self, peer: Peer, profile: Profile, origin: Origin, telemetry: Telemetry,
                 onboard: OnboardMission, authority: Authority, policy: Callable[[], Policy],
                 rng: random.Random, memory: FenceMemory) -> None:
        self._telemetry, self._onboard = telemetry, onboard
        self._authority, self._policy = authority, policy
        fence_peer = replace(peer, mission_type=d.MAV_MISSION_TYPE_FENCE)
        self._own: dict[str, frozenset[ItemKey]] = {}  # items of the bridge, by store
        self.transfer = OnboardFence(fence_peer, telemetry.idle_after, rng,
                                     profile.rules.fence_points, memory.own,
                                     lambda own: self._save('fence', own, memory))
        self.rally = RallyTransfer(OnboardFence(
            replace(peer, mission_type=d.MAV_MISSION_TYPE_RALLY), telemetry.idle_after, rng,
            RALLY_BUDGET, memory.own, lambda own: self._save('rally', own, memory), rally_alike))
        self.parameters = FenceParameters(peer, profile)
        onboard.list.read_speed = self.parameters.cruise_speed
        way_home = onboard.list.way_home
        way_home.zones = self._zones_to_avoid
        way_home.return_height = self.parameters.known_return_height
        self.notes: deque[OperatorNote] = deque()
        self._wanted = WantedFence(origin, telemetry, onboard, policy, self.parameters,
                                   self.transfer)
        self._reported = ''
        self._was_verified = False

    def _save(self, store: str, own: frozenset[ItemKey], memory: FenceMemory) -> None:
        self._own[store] = own
        memory.save(frozenset().union(*self._own.values()))

    def _zones_to_avoid(self) -> tuple[ThreatZone, ...]:
        """The zones in force; none where the vehicle itself flies around all of them."""
        policy = self._policy()
        if policy.fences == 'off':
            self._was_verified = False
            return policy.no_fly_zones
        state = self.transfer.state
        if state is FenceState.VERIFIED:
            self._was_verified = True
        elif state not in (FenceState.UNKNOWN, FenceState.UPLOADING):  # not by a readback
            self._was_verified = False
        around = self._was_verified and self.parameters.plans_around and not self.left_out
        return () if around else policy.no_fly_zones

    @property
    def fence(self) -> Fence:
        """The fence that it is to carry."""
        return self._wanted.fence

    @property
    def active(self) -> bool:
        """Whether fences are carried at all."""
        return self._policy().fences != 'off'

    @property
    def state(self) -> FenceState:
        """The state of the fence on board."""
        return self.transfer.state if self.active else FenceState.OFF

    @property
    def verified(self) -> bool:
        """Whether the wanted fence is on board and enforced as far as it can be known."""
        return self.state is FenceState.VERIFIED

    def restart(self) -> None:
        """Start over after a restart of the vehicle."""
        self._was_verified = False
        self.transfer.reset()
        self.rally.transfer.reset()
        self.parameters.reset()

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of the vehicle; returns messages to send."""
        policy = self._policy()
        out = self.rally.transfer.receive(message, now) if policy.rally else []
        self.parameters.receive(message)
        if policy.fences == 'off':
            return out
        return out + self.transfer.receive(message, now)

    def step(self, now: float) -> list[Message]:
        """Choose the fence, and go on with its transfer; returns messages to send."""
        policy = self._policy()
        if policy.fences == 'off' and not policy.rally:
            return (self.transfer.cancel() + self.rally.transfer.cancel()
                    + self._read_return_height(now))
        if self._telemetry.link.stale(now) or not self._telemetry.past_boot:
            return []
        if self._onboard.upload.busy:
            return self.transfer.cancel() + self.rally.transfer.cancel()
        out: list[Message] = []
        if self.active and not self.rally.transfer.busy:
            self._wanted.choose(now)
            out = self._transfer(now)
            self._report()
        if self._policy().rally and not self.transfer.busy:
            out += self._transfer_rally(now)
        return out if self.active else out + self._read_return_height(now)

    def _read_return_height(self, now: float) -> list[Message]:
        """Read how high it returns, for `UavState`, also without fences."""
        if self.parameters.is_idle(now, fences=False):
            return []
        idle = not (self._telemetry.link.stale(now) or self._onboard.upload.busy)
        if not (idle and self._telemetry.past_boot and self._authority.allows(SendAction.READ)):
            return []
        return self.parameters.step(now, fences=False)

    def _transfer_rally(self, now: float) -> list[Message]:
        policy, telemetry = self._policy(), self._telemetry
        if policy.zones_known and telemetry.home is not None:
            self.rally.choose(policy.rally, policy.zones, self._onboard.tasks, telemetry.home,
                              policy.fence_area if self.active else None)
        if not self._authority.allows(SendAction.READ):
            return []
        text = self.rally.text
        if not self._may_upload and self.rally.transfer.state is FenceState.UPLOADING:
            return self.rally.transfer.cancel()
        out = self.rally.step(now, self._may_upload)
        if self.rally.text != text and not self.rally.transfer.busy:
            self.notes.append(OperatorNote('info', f'rally points {self.rally.text}'))
        return out

    def _transfer(self, now: float) -> list[Message]:
        if not self._authority.allows(SendAction.READ):
            return []
        out = self.parameters.step(now)
        if not self._may_upload and self.state is FenceState.UPLOADING:
            return self.transfer.cancel()
        if self.transfer.busy:
            return out + self.transfer.step(now)
        settled = not self._telemetry.airborne or (
            now - self._wanted.changed_at >= _SETTLED) or self._wanted.is_entered()
        return out + self.transfer.begin(
            now, settled and self._may_upload and self._policy().zones_known)

    @property
    def _may_upload(self) -> bool:
        """Whether it may be changed now: not in a flight that the bridge was not granted."""
        return self._authority.allows(SendAction.UPLOAD) and (
            self._authority.held or not self._telemetry.airborne)

    def clear_way(self, now: float) -> list[Message] | None:
        """A rule: wait where the list passes through a fence on board that is being changed."""
        if not self.active:
            return None
        self._wanted.choose(now, at_once=True)
        if not self._wanted.is_entered() or self.transfer.failures >= _MOST_FAILURES or (
                not self._may_upload):
            return None
        return []

    def missing(self) -> str:
        """What is missing for a take-off with `fences: require`; '': nothing."""
        policy = self._policy()
        if policy.fences != 'require':
            return ''
        if not policy.zones_known:
            return 'the zones (fences: require)'
        if self.fence.no_space or self.fence.waiting:
            return f'its fence: {self.left_out}'
        if self.fence.breached:
            return f'a list that its fence allows: {_joined_reasons(self.fence.breached)}'
        if not self.verified:
            return f'its fence: {self.text}'
        if self.fence.shapes and not self.parameters.enabled:
            return f'its fence to be enabled: {self.parameters.text}'
        return ''

    def needs_operator(self) -> str:
        """What is `missing` where only an operator provides it; '': nothing."""
        is_off = self.verified and self.fence.shapes and self.parameters.enabled is False
        needs = is_off or self.state in (FenceState.UNSUPPORTED, FenceState.FOREIGN)
        return self.missing() if needs else ''

    @property
    def text(self) -> str:
        """State of the fence for operators."""
        state, transfer = self.state, self.transfer
        if state is FenceState.OFF:
            return 'OFF'
        text = state.name
        if state is FenceState.VERIFIED:
            text += (f', {counted(len(self.fence.shapes), "zone")} in '
                     f'{counted(self.fence.points, "point")}')
        if state is FenceState.FOREIGN:
            text += (f', {counted(len(transfer.held or ()), "point")} of another station, left '
                     'alone: clear the fence there to have the zones on board')
        if transfer.reason:
            text += f' ({transfer.reason})'
        return text

    @property
    def rally_text(self) -> str:
        """State of the rally points for operators."""
        return self.rally.text if self._policy().rally else 'none are given'

    @property
    def left_out(self) -> str:
        """The zones that are not on board and why; '': all are."""
        parts = [f'{zone}: no space on board' for zone in self.fence.no_space]
        parts += map(_joined_reasons, filter(None, (self.fence.waiting, self.fence.free_side)))
        return '; '.join(parts)

    @property
    def _breach(self) -> str:
        return f'the fence on board will be breached: {_joined_reasons(self.fence.breached)}'

    @property
    def warning(self) -> str:
        """What an operator should know before a flight; '': nothing."""
        parts = [f'fence {self.text}'] if self.active and not self.verified else []
        if self.active and self.parameters.enabled is False and self.fence.shapes:
            parts.append(f'fence {self.parameters.text}')
        if self.active and (self.fence.no_space or self.fence.waiting):
            parts.append(f'fence without {self.left_out}')
        if self.active and self.fence.breached:
            parts.append(self._breach)
        if blocked := self._onboard.list.way_home.blocked:
            parts.append(blocked)
        if self.way_home:
            parts.append(f"a failsafe's straight way home crosses {self.way_home}")
        return '; '.join(parts)

    @property
    def way_home(self) -> str:
        """The zones that a failsafe would cross, flying straight home from here; '': none."""
        telemetry = self._telemetry
        if not telemetry.airborne or not telemetry.has_position or telemetry.home is None:
            return ''
        if self.verified and self.parameters.plans_around:
            return ''
        height = max(telemetry.position[2], telemetry.home[2] + self.parameters.return_height)
        crossed = [zone.id for zone in zones_across_path(telemetry.position, telemetry.home, (
            zone for zone in self._policy().no_fly_zones
            if vertical_extent(zone)[0] < height < vertical_extent(zone)[1]))]
        return f'zone{"s" * (len(crossed) > 1)} {first_of(crossed)}' if crossed else ''

    def _report(self) -> None:
        """Log the state when it changes."""
        if self.transfer.busy or self.transfer.wanted is None:
            return
        text = f'fence {self.text}'
        if self.verified and self.fence.shapes:
            text += f'; {self.parameters.text}'
        if self.left_out:
            text += f'; not on board: {self.left_out}'
        if self.fence.breached:
            text += f'; {self._breach}'
        if text != self._reported:
            self._reported = text
            self.notes.append(OperatorNote('warning' if self.warning else 'info', text))


def _joined_reasons(reasons: Mapping[str, str]) -> str:
    return '; '.join(f'{zone}: {reason}' for zone, reason in reasons.items())
