# SPDX-License-Identifier: Apache-2.0
"""What one vehicle has on board against what it should have: the list, the mission, its state."""
from __future__ import annotations

import random
import re
from collections import deque
from dataclasses import dataclass, replace
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.errors import MissionError
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.change import Change, Kind, change
from uav_task_alloc.mavlink.codec import Message, plan_id
from uav_task_alloc.mavlink.peer import NO_SPACE, Peer
from uav_task_alloc.mavlink.policy import Note, TaskProgress
from uav_task_alloc.mavlink.profiles import Profile
from uav_task_alloc.mavlink.progress import ProgressTable
from uav_task_alloc.mavlink.recall import Recall, checksum
from uav_task_alloc.mavlink.telemetry import Telemetry
from uav_task_alloc.mavlink.transfer import Accepted, Failed, Held, Mission, Verified
from uav_task_alloc.mavlink.upload import OVERTAKEN, Upload
from uav_task_alloc.mission import (
    Item,
    TaskList,
    alike,
    all_alike,
    home_item,
    mission_items,
)
from uav_task_alloc.model import Task

SETTLE = 3.0  # [s] in which messages sent before the last change may still come
LATE = 6.0  # [s] around the end of a mission in which its last REACHED comes
AMBIGUOUS = 32  # REACHED between the last item sent and the answer
SPACE = re.compile(r'Only (\d+) items are supported')
CHECK = 60.0  # [s] between readbacks of a mission that nobody should have changed


class MissionState(Enum):
    """What is known of the mission on board; numbers as in UavState."""

    UNKNOWN = 0
    UPLOADING = 1
    VERIFIED = 2
    MIXED = 3
    FOREIGN = 4


@dataclass(frozen=True, slots=True)
class TaskFailed:
    """A task that this vehicle does not take."""

    task: str
    reason: str
    revision: int  # of the list that it was asked for in


class Board:
    """The mission of one vehicle; seq counts without home, which ArduPilot keeps at 0."""

    def __init__(self, peer: Peer, profile: Profile, origin: Origin, telemetry: Telemetry,
                 rng: random.Random) -> None:
        self.upload = Upload(peer, idle_after=profile.idle_after, rng=rng)
        self.upload.overtaken = self._overtaken
        self.progress = ProgressTable(telemetry.frames, repeats=profile.atomic)
        self.recall = Recall(profile, origin, telemetry, self.progress)
        self.own = int(profile.rules.home_first)
        self.tasks: TaskList | None = None
        self.held: tuple[Item, ...] | None = None  # None: to be read
        self.revision = 0  # of the last list verified on board
        self.failed: deque[TaskFailed] = deque()
        self.notes: deque[Note] = deque()
        self.trouble = False  # the last transfer failed; somebody decides when to try again
        self.verified_at = 0.0  # [s]
        self.read_once = False  # since the vehicle was first heard or restarted
        self.must_jump: int | None = None  # the item to fly now, where the upload did not say it
        self.is_foreign = False  # somebody else has changed what we had verified
        self._profile, self._origin, self._telemetry = profile, origin, telemetry
        self._refused: dict[str, tuple[Task, str]] = {}  # as it was, and why
        self._horizon: int | None = None  # stops; None: all
        self._done_then: frozenset[str] = frozenset()  # as the upload began
        self._fits = False  # the horizon is on board: there may be space for more
        self._space: int | None = None  # items that the vehicle says it has space for
        self._checksum: tuple[tuple[Item, ...], int] | None = None
        self._infeasible: tuple[float, list[str], str, TaskList] | None = None  # to be told at [s]
        self._ambiguous: list[tuple[int, float]] = []  # REACHED of this epoch, or of the next
        self._state = MissionState.UNKNOWN
        self._uploading: tuple[Change, TaskList] | None = None  # and the list it is for
        self._begun = False  # the epoch of this upload
        # [s] of the vehicle's clock: all items were sent, which it may fly since
        self._sent_since: float | None = None
        self.item_time = 0.0  # [s] that an item took in the uploads so far, roughly
        self._began_at = 0.0  # [s]
        self.plan_id = self._heard_plan = 0  # PX4's id of the mission verified, last heard
        self._recalled: tuple[TaskList, int] | None = None
        self._wanted: tuple[object, tuple[Item, ...]] | None = None

    @property
    def state(self) -> MissionState:
        return MissionState.UPLOADING if self._uploading is not None else self._state

    @property
    def stored(self) -> MissionState:
        """What is known of what is on board, whether or not a transfer runs."""
        return self._state

    def upload_progress(self, now: float) -> str:
        """How far the upload is and how long it still takes, in words; '' where there is none."""
        sent, read, count = self.upload.progress
        if count == 0:
            return ''
        text = f'read back {read}' if read else f'sent {sent}'
        text += f' of {count} items'
        done, passed = sent + read, now - self._began_at
        if done == 0 or passed <= 0.0:
            return text
        return f'{text}, about {passed * (2 * count - done) / done:.0f} s left'

    @property
    def open(self) -> bool:
        """A transfer runs, and the vehicle has not taken all of it."""
        return self._uploading is not None and not self._begun

    @property
    def outdated(self) -> bool:
        """The transfer is for an older list."""
        return (self._uploading is not None and self.tasks is not None
                and self._uploading[1].revision != self.tasks.revision)

    def assign(self, tasks: TaskList) -> None:
        """The latest list; a task that was refused is tried again where it has changed."""
        self.tasks = tasks
        self._horizon = None
        asked = [stop.task for stop in tasks.stops]
        self.progress.asked_for(asked)
        for task in asked:
            if self._refused.get(task.id, (task, ''))[0] != task:
                del self._refused[task.id]

    def told_before(self) -> list[TaskProgress]:
        """How those tasks of the list ended that it should not have any more."""
        assert self.tasks is not None
        ids, revision = [stop.task.id for stop in self.tasks.stops], self.tasks.revision
        return [TaskProgress(i, 'COMPLETED', revision)
                for i in ids if i in self.progress.completed] + [
            TaskProgress(i, 'FAILED', revision, self._refused[i][1])
            for i in ids if i in self._refused and i not in self.progress.completed]

    def remaining(self) -> TaskList:
        """The list less what is flown or refused, up to the horizon."""
        assert self.tasks is not None
        tasks = self.tasks.without({
            *self.progress.completed, *self.progress.pending, *self._refused})
        return tasks if self._horizon is None else tasks.first(self._horizon)

    def wanted(self) -> tuple[Item, ...]:
        """The items to fly from here; a task that cannot be one is refused."""
        key = (self.tasks, len(self.progress.completed), self.progress.pending,
               len(self._refused), self._horizon)
        if self._wanted is not None and self._wanted[0] == key:
            return self._wanted[1]
        remaining = self.remaining()
        try:
            items = mission_items(remaining, self._profile.rules, self._origin)
        except MissionError as error:
            self._refuse(error.task, str(error), remaining)
            return self.wanted()
        self._wanted = key, items
        return items

    def change(self) -> Change:
        """What has to change on board."""
        assert self.held is not None
        wanted, current = self.wanted(), self.progress.current
        done = {*self.progress.completed, *self.progress.pending}
        found = change(self.held, current, wanted, done=done)
        if self._horizon is not None and found.kind is not Kind.KEEP:
            if self._enough():
                return Change(Kind.KEEP, self.held, current or 0)
            if self._fits:
                self._fits, self._horizon = False, 2 * self._horizon
                return self.change()
        room = self._profile.rules.capacity - self.own
        if found.kind is Kind.APPEND and (self._profile.atomic or len(found.items) > room):
            return change(self.held, current, wanted, append=False)
        return found

    def adopt(self, found: Change, now: float, tasks: TaskList | None = None) -> None:
        """The list is on board already; not where `tasks` was meant, and another came since."""
        assert self.tasks is not None
        if tasks is not None and tasks != self.tasks:
            return
        if self.revision != self.tasks.revision or self._state is not MissionState.VERIFIED:
            self._verify(found.items, self.tasks.revision, now)
            self.progress.retag(found.items)

    def begin_upload(self, found: Change, now: float) -> list[Message]:
        """Bring it on board."""
        assert self.tasks is not None
        self._uploading, self._begun, self.trouble = (found, self.tasks), False, False
        self._began_at, self._space, self._sent_since = now, None, None
        self._done_then = self._done()
        home = () if not self.own else (home_item(
            self._telemetry.home, self._origin, self._profile.rules),)
        return self.upload.replace(Mission(
            home + found.items, found.start + self.own, self._profile.atomic, self.own), now)

    def _done(self) -> frozenset[str]:
        return self.progress.pending.union(self.progress.completed)

    def _starts_behind(self) -> bool:
        """An atomic swap under way would fly its first task, which was flown meanwhile, again."""
        if self._uploading is None or self._begun or not self._profile.atomic:
            return False
        found = self._uploading[0]
        first = next((item for item in found.items[found.start:] if item.completes), None)
        return first is not None and first.task in self.progress.completed

    def beyond_flown(self) -> int | None:
        """The item to go on at while a swap is read back, where it begins with a flown task."""
        progress, item = self.progress, self.progress.active
        if self._uploading is None or not self._begun or not self._profile.atomic or (
                item is None or item.task not in progress.completed):
            return None
        return next((n for n, other in enumerate(progress.items[:progress.last_flown + 1])
                     if n > (progress.current or 0) and other.task not in progress.completed),
                    None)

    def _overtaken(self) -> bool:
        """Before another try: what is uploaded has been flown in part, or is of an old list."""
        return bool(self._ambiguous) or self.outdated or self._done() != self._done_then

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the mission service."""
        if message.get_type() in ('MISSION_ACK', 'MISSION_COUNT'):
            self._heard_plan = plan_id(message)
        out = self.upload.receive(message, now)
        if not self.upload.sent_all:
            self._sent_since = None if self.upload.busy else self._sent_since
        elif self._sent_since is None:
            self._sent_since = self.progress.path.newest
        self._settle(now)
        return out

    def step(self, now: float) -> list[Message]:
        out = self.upload.step(now)
        if self._starts_behind() and not self.upload.sent_all:
            out += self.upload.cancel(now)
        self._settle(now)
        return out

    def reached(self, seq: int, now: float) -> None:
        """MISSION_ITEM_REACHED; once all items are sent it may be of either mission."""
        if self.open and self.upload.sent_all:
            if len(self._ambiguous) < AMBIGUOUS:
                self._ambiguous.append((seq, now))
            self.progress.note_end(seq, now)
        else:
            self.progress.reached(seq, now)

    def tells(self, message: Message) -> bool:
        """A MISSION_CURRENT is of the mission that is known, not of one that is sent now."""
        return not self.open or (self.plan_id != 0 and plan_id(message) == self.plan_id)

    def note_space(self, text: str) -> None:
        """STATUSTEXT: for how many items the vehicle has space."""
        found = SPACE.search(text)
        if found:
            self._space = int(found[1])

    def abort(self) -> list[Message]:
        """Somebody else has the vehicle: the transfer ends where it is."""
        if self.upload.busy:
            self.upload.reset()
        if self._uploading is not None:
            self._credit(self._uploading[0])
            self._uploading, self.held = None, None
            self._state = MissionState.UNKNOWN if self._profile.atomic else MissionState.MIXED
        return []

    def verified(self) -> bool:
        """The list is on board, and nothing is to be changed."""
        return (self.state is MissionState.VERIFIED and self.held is not None
                and self.tasks is not None and bool(self.wanted())
                and self.change().kind is Kind.KEEP)

    def ours(self) -> bool:
        """What was read back holds a task of the list: nobody else has put it there."""
        if not self.held or self.tasks is None or not self.tasks.stops:
            return False
        items = [item for item in self.wanted() if item.completes]
        return any(alike(item, held) for item in items for held in self.held)

    def place(self) -> tuple[int | None, int | None]:
        """Checksum of the mission on board, and the item that is flown; None: not known."""
        if self.held is None or self.progress.current is None:
            return None, None
        if self._checksum is None or self._checksum[0] is not self.held:
            self._checksum = self.held, checksum(self.held)
        pending = self.progress.pending
        return self._checksum[1], next((n for n, item in enumerate(
            self.progress.items[:self.progress.current]) if item.task in pending),
            self.progress.current) if pending else self.progress.current

    def foreign(self) -> bool:
        """Somebody else has changed what was verified."""
        return self.is_foreign

    def ended(self, now: float) -> bool:
        """REACHED of the last item has just come."""
        return self.progress.ended_lately(now, LATE)

    def rejected(self, now: float) -> bool:
        """The vehicle says that it has no valid mission, just after it took ours (PX4)."""
        telemetry = self._telemetry
        return (telemetry.mission_state == d.MISSION_STATE_NO_MISSION
                and now - telemetry.current_at < LATE
                and (self._begun or now - self.verified_at < LATE))

    def returning(self) -> bool:
        """The RETURN item is next, or is being flown."""
        progress = self.progress
        return progress.returns and progress.current is not None and (
            progress.current > progress.last_flown)

    def may_end(self) -> bool:
        """The last item with a place is being flown, or is passed."""
        return self.progress.may_end(self._telemetry.heard_at)

    def restarted(self) -> None:
        """The vehicle forgot its transfer, and perhaps its mission."""
        self.upload.reset()
        self.is_foreign, self._infeasible = False, None
        self._ambiguous.clear()
        self.progress.invalidate()
        self.held, self._uploading, self._state = None, None, MissionState.UNKNOWN
        self.read_once = False
        self.recall.reset()

    def watch(self, message: Message, now: float) -> None:
        """Has somebody else changed the mission? What MISSION_CURRENT says is doubt, not proof."""
        if self.held is None or now - self.verified_at < SETTLE:
            return
        ours, plan = self.plan_id, plan_id(message)
        changed = (plan != ours if plan and ours else message.total not in (
            0, 65535, len(self.held), len(self.held) + self.own))
        gone = message.mission_state == d.MISSION_STATE_NO_MISSION and self.held
        if changed or gone or now - self.verified_at > CHECK:
            self.held = None  # read what is on board before anything else

    def catch_up(self, now: float) -> None:
        """Complete what the vehicle has flown before anybody listened."""
        memory = self.recall.memory(now)
        if memory and self.tasks and (self.tasks, len(memory)) != self._recalled:
            self._recalled = self.tasks, len(memory)
            self.progress.caught_up(self.recall.flown(self.open_tasks(), now))

    def open_tasks(self) -> tuple[Task, ...]:
        """Those of the list that are still to be flown, and can be."""
        return tuple(stop.task for stop in self.remaining().stops) if self.wanted() else ()

    def infeasible(self, reason: str) -> None:
        """The vehicle stores the mission, and will not fly it."""
        assert self.tasks is not None
        for task in {item.task: None for item in self.wanted() if item.completes}:
            self._refuse(task, f'infeasible: {reason}', self.tasks)

    def _settle(self, now: float) -> None:
        if self._infeasible is not None and now >= self._infeasible[0]:
            _, stops, reason, asked = self._infeasible
            self._infeasible = None
            for task in stops:
                self._refuse(task, reason, asked)
        while self.upload.events:
            event = self.upload.events.popleft()
            if isinstance(event, Held):
                self._was_read(event, now)
            elif self._uploading is not None:
                found, tasks = self._uploading
                if isinstance(event, Accepted):
                    self._begin(found, now)
                elif isinstance(event, Verified):
                    self._begin(found, now)
                    self._uploading = None
                    self._verify(found.items, tasks.revision, now)
                else:
                    self._uploading = None
                    self._was_refused(event, found, tasks, now)

    def _begin(self, found: Change, now: float) -> None:
        if self._begun:
            return
        self._begun = True
        of_new = self._sort_reached(found)
        self.item_time = (self.item_time + (now - self._began_at) / len(found.items)) / 2.0
        self.recall.stash()
        if found.kind is Kind.APPEND:
            self.progress.extend(found.items)
        else:
            self.progress.begin(found.items, found.start, now, since=self._sent_since)
            if not self._profile.atomic:
                self.must_jump = found.start
        for seq, when in of_new:
            self.progress.reached(seq, when, proven=True)

    def _sort_reached(self, found: Change) -> list[tuple[int, float]]:
        """Credit what was reached to the mission at whose item the vehicle was seen."""
        of_new, old = [], self.progress.items
        for seq, when in self._ambiguous:
            before = old[seq] if 0 <= seq < len(old) else None
            after = found.items[seq] if 0 <= seq < len(found.items) else None
            at_new = after is not None and self.progress.was_at(after)
            if before is not None and (self.progress.was_at(before) or (
                    after is not None and alike(before, after))):
                self.progress.reached(seq, when)
            elif at_new:
                of_new.append((seq, when))
        self._ambiguous.clear()
        return of_new

    def _credit(self, found: Change) -> None:
        """The transfer has failed, and nobody knows which mission was flown: ask where it was."""
        for seq, _ in self._sort_reached(found):
            self.progress.credit(found.items[seq])

    def _verify(self, items: tuple[Item, ...], revision: int, now: float) -> None:
        self.held, self.revision, self.verified_at = items, revision, now
        self._state, self.read_once = MissionState.VERIFIED, True
        self.is_foreign, self._fits = False, self._horizon is not None
        self.plan_id = self._heard_plan

    def _was_read(self, event: Held, now: float) -> None:
        if event.items is None:
            self.trouble = True
            return
        held, known = event.items[self.own:], self.progress.items
        if known and all_alike(known, held):
            self.held, self.verified_at = known, now
            if self._state is MissionState.UNKNOWN:
                self._state = MissionState.VERIFIED
            return
        self.held, self.verified_at, self.plan_id = held, now, self._heard_plan
        if self._state is MissionState.VERIFIED or (self.tasks is None and held):
            self._state = MissionState.FOREIGN
            self.is_foreign = self.is_foreign or self.read_once
            self.read_once = False
        elif self.is_foreign and self.tasks is not None and self.wanted() and change(
                held, None, self.wanted(), done=self.progress.completed).kind is not Kind.SWAP:
            self.is_foreign, self._state = False, MissionState.UNKNOWN
        self.recall.stash()
        current = self._telemetry.current
        self.progress.begin(held, None if current is None or not held
                            else max(0, current - self.own), now, read=True)

    def _was_refused(self, event: Failed, found: Change, tasks: TaskList, now: float) -> None:
        self.held, self.trouble = None, event.reason != OVERTAKEN
        self._state = MissionState.UNKNOWN if self._profile.atomic else MissionState.MIXED
        self._credit(found)
        if not self.trouble:
            return
        self.notes.append(Note('error', f'mission upload failed: {event.reason}'))
        stops = [item.task for item in found.items if item.completes]
        if event.result == NO_SPACE:
            self._shrink(len(stops))
        elif event.result is not None:
            seq = min(max((event.seq or 0) - self.own, 0), len(found.items) - 1)
            task = next((i.task for i in found.items[seq:] if i.task), stops[0] if stops else '')
            self._refuse(task, event.reason, tasks)
            self.trouble = not task
        elif 'infeasible' in event.reason:  # or it was just restarted, as its clock will tell
            self._infeasible = now + LATE, stops, event.reason, tasks

    def _shrink(self, stops: int) -> None:
        """Fly fewer tasks at a time; where not even one fits the store is not open yet."""
        if stops <= 1 or self._space == 0:
            self._horizon = None
            self.notes.append(Note('warning', 'no space on board for any task yet: '
                                   'trying again'))
            return
        self._horizon, self._fits, self.trouble = stops // 2, False, False
        self.notes.append(Note('warning', 'no space on board: flying the first '
                               f'{self._horizon} tasks of {stops}, the others follow'))

    def _refuse(self, task: str, reason: str, tasks: TaskList) -> None:
        """Not to be flown as it is in that list; what has changed since is yet to be tried."""
        asked, latest = tasks.find(task), self.tasks.find(task) if self.tasks else None
        if asked is not None and latest in (None, asked):
            self._refused[task] = asked, reason
            self.failed.append(TaskFailed(task, reason, tasks.revision))

    def _enough(self) -> bool:
        """While half a horizon of the latest list is still on board, nothing is uploaded."""
        assert self.tasks is not None
        assert self.held is not None
        everything = replace(self.tasks.without({*self.progress.completed, *self._refused}),
                             returns=False, end_via=())
        wanted = mission_items(everything, self._profile.rules, self._origin)
        rest = self.held[self.progress.current or 0:]
        stops = sum(item.completes for item in rest)
        return stops >= max(1, (self._horizon or 0) // 2) and all_alike(wanted[:len(rest)], rest)
