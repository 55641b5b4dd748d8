# SPDX-License-Identifier: Apache-2.0
"""Ends the actions of a way that was left before its end: trigger, video, speed and ROI."""
from __future__ import annotations

import math
from collections import deque

from uav_task_alloc.actions import Action
from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.gcs.command import Command, CommandResult
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.mission.items import TaskList
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.transport.codec import Message

_ATTEMPTS = 3  # one each second
_KEPT = 64  # tasks


class EndActions:
    """Commands the ends of actions that the mission on board does not contain any more.

    Args:
        peer: the vehicle.
        profile: of its autopilot.
        onboard: its mission.
    """

    def __init__(self, peer: Peer, profile: Profile, onboard: OnboardMission) -> None:
        self._peer, self._rules, self._onboard = peer, profile.rules, onboard
        self._actions: dict[str, tuple[Action, ...]] = {}  # by task
        self._listed: TaskList | None = None
        self._commands: deque[Command] = deque()

    def receive(self, message: Message) -> None:
        """Take a COMMAND_ACK of the vehicle."""
        if self._commands and self._peer.is_from_vehicle(message):
            self._commands[0].receive(message)

    def step(self, now: float, held: bool) -> list[Message]:
        """Return the messages to send.

        Args:
            now: steady time [s].
            held: whether the bridge controls the vehicle; else its actions are not ours.
        """
        self._note_list()
        left = self._onboard.progress.coverage.left
        for _ in range(len(left)):
            task = left.popleft()
            if self._onboard.tasks is None or task in self._onboard.progress.pending:
                left.append(task)
            elif held and self._is_left(task):
                self._end(task)
        if not held:
            self._commands.clear()
        while self._commands and self._commands[0].result is not CommandResult.OPEN:
            self._commands.popleft()
        return self._commands[0].step(now) if self._commands else []

    def _note_list(self) -> None:
        tasks = self._onboard.tasks
        if tasks is None or tasks is self._listed:
            return
        self._listed = tasks
        for stop in tasks.stops:
            if stop.task.actions:
                self._actions.pop(stop.task.id, None)
                self._actions[stop.task.id] = stop.task.actions
        for name in list(self._actions)[:-_KEPT]:
            del self._actions[name]

    def _is_left(self, task: str) -> bool:
        """Whether it was not flown to its end, and is not continued next."""
        stops = self._onboard.remaining().stops
        return task not in self._onboard.progress.completed and not (
            stops and stops[0].task.id == task)

    def _end(self, task: str) -> None:
        cruise = self._onboard.list.cruise()
        for action in reversed(self._actions.get(task, ())):
            row = self._rules.actions[action.name]
            if row.end is None or row.refusal or (row.needs_speed and not cruise > 0.0):
                continue
            command = row.end(cruise if math.isfinite(cruise) else 0.0)
            self._commands.append(Command(
                f'end of {action.name}', self._peer.command(
                    command.command, *command.params, 0.0, 0.0, command.z),
                lambda: False, attempts=_ATTEMPTS))
