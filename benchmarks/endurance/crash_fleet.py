# SPDX-License-Identifier: Apache-2.0
"""A fleet for crash.py without vehicles, and the ledger of what an allocator has acknowledged."""
from __future__ import annotations

import math
import random
import time
from collections import Counter
from collections.abc import Callable

from geometry_msgs.msg import Point
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.mavlink.gcs.event_retry import EventRetry
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.nodes.conversions.messages import from_stamp

HEIGHT = 50.0  # [m]
FLOWN_IN = (0.1, 0.5)  # [s] a task takes
FAILS = 0.03  # share of tasks
DELIVERED = 1.0  # [s] in which a published list is received
S, E = m.TaskStatus, m.TaskEvent
ENDED = (S.COMPLETED, S.CANCELLED, S.FAILED)


class Ledger:
    """What was acknowledged, and what contradicts it since."""

    def __init__(self) -> None:
        self.accepted: set[str] = set()  # by the service, or in a status
        self.ended: dict[str, tuple[int, float]] = {}  # state, stamp [s], as published
        # UAVs switched off: time [s] of the service's response, and the tasks listed until then
        self.off: dict[str, tuple[float, set[str]]] = {}
        self._listed: dict[str, set[str]] = {}
        self.flown: Counter[str] = Counter()
        self.revisions: dict[str, int] = {}
        self.faults: dict[str, list[str]] = {
            'lost': [], 'listed_again': [], 'reopened': [], 'begun_again': [],
            'revisions': [], 'off': []}
        self._must: tuple[set[str], dict[str, tuple[int, float]]] = (set(), {})

    def killed(self) -> None:
        """Note a kill: what is acknowledged by now must be restored."""
        self._must = set(self.accepted), dict(self.ended)

    def statuses(self, msg: m.TaskStatusArray) -> None:
        """Take the acknowledgements, and check for those from before the kill."""
        known = {s.task_id: s for s in msg.statuses if s.state != S.REJECTED}
        accepted, ended = self._must
        self.faults['lost'] += sorted(accepted - set(known))
        self.faults['reopened'] += [
            task_id for task_id, (state, _) in ended.items()
            if task_id in known and known[task_id].state != state]
        self.accepted |= set(known)
        self.ended.update((s.task_id, (s.state, from_stamp(s.stamp)))
                          for s in known.values() if s.state in ENDED)

    def rises(self, name: str, revision: int) -> None:
        """Check that a revision is not used twice."""
        if revision <= self.revisions.get(name, 0):
            self.faults['revisions'].append(f'{name}: {self.revisions[name]}, {revision}')
        self.revisions[name] = max(revision, self.revisions.get(name, 0))

    def listed(self, msg: m.TaskList) -> None:
        """Check that a list has no ended task, nor a new one for a UAV switched off."""
        self.rises(msg.uav_id, msg.revision)
        published = from_stamp(msg.header.stamp)
        ids = [planned.task.task_id for planned in msg.tasks]
        self.faults['listed_again'] += [
            t for t in ids if t in self.ended and self.ended[t][1] < published]
        self._listed[msg.uav_id] = set(ids)
        when, had = self.off.get(msg.uav_id, (math.inf, set()))
        if published <= when:
            had.update(ids)
        elif not had.issuperset(ids):
            self.faults['off'].append(msg.uav_id)

    def switched_off(self, uav_id: str) -> None:
        """Note that the service has switched a UAV off."""
        self.off[uav_id] = time.time(), set(self._listed.get(uav_id, ()))

    def done_twice(self) -> set[str]:
        """Tasks flown twice, or listed or started again after their end was published."""
        return {t for t, n in self.flown.items() if n > 1} | {
            *self.faults['listed_again'], *self.faults['reopened'], *self.faults['begun_again']}

    def starts(self, task_id: str) -> None:
        """Note that a UAV starts a task; it cannot know of a withdrawal during a crash."""
        state, when = self.ended.get(task_id, (S.CANCELLED, math.inf))
        if state == S.COMPLETED and when < time.time() - DELIVERED:
            self.faults['begun_again'].append(task_id)


class Flyer:
    """One UAV that flies its list and publishes events; as the bridge, it keeps what is flown."""

    def __init__(self, uav_id: str, place: tuple[float, float],
                 publish: Callable[[E], None], ledger: Ledger, rng: random.Random) -> None:
        self.uav_id, self.place, self.publish, self.ledger, self.rng = (
            uav_id, place, publish, ledger, rng)
        self.list = m.TaskList(uav_id=uav_id)
        self.flown: set[str] = set()
        self.failed: set[str] = set()  # refused since, as by the bridge
        self.active, self._until, self._retry = '', 0.0, EventRetry()

    def assign(self, msg: m.TaskList, now: float) -> None:
        self.list, ids = msg, [planned.task.task_id for planned in msg.tasks]
        self._retry.set_ended([
            TaskProgress(task_id, 'COMPLETED' if task_id in self.flown else 'FAILED', msg.revision)
            for task_id in ids if task_id in self.flown | self.failed], now)
        if self.active not in ids:
            self.active = ''

    def step(self, now: float) -> None:
        tasks = [p.task for p in self.list.tasks]
        for retry in self._retry.step(now):
            self.event(getattr(E, retry.event), retry.task)
        left = [task for task in tasks if task.task_id not in self.flown | self.failed]
        if not self.active and left:
            self.active, self._until = left[0].task_id, now + self.rng.uniform(*FLOWN_IN)
            self.ledger.starts(self.active)
            self.event(E.STARTED, self.active)
        elif self.active and now >= self._until:
            self._arrive(next(task for task in left if task.task_id == self.active))

    def _arrive(self, task: m.Task) -> None:
        self.place, self.active = (task.position.x, task.position.y), ''
        if self.rng.random() < FAILS:
            self.failed.add(task.task_id)
            self.event(E.FAILED, task.task_id, 'random failure')
            self.list = m.TaskList(uav_id=self.uav_id, revision=self.list.revision)
            return
        self.flown.add(task.task_id)
        self.ledger.flown[task.task_id] += 1
        self.event(E.COMPLETED, task.task_id)

    def event(self, kind: int, task_id: str, reason: str = '') -> None:
        self.publish(E(event=kind, task_id=task_id, uav_id=self.uav_id, reason=reason,
                       revision=self.list.revision))

    def state(self) -> m.UavState:
        return m.UavState(
            uav_id=self.uav_id, position=Point(x=self.place[0], y=self.place[1], z=HEIGHT),
            home=Point(x=math.nan), battery=0.9, range_remaining=math.nan, cruise_speed=15.0,
            available=True, active_task_id=self.active, list_revision=self.list.revision)
