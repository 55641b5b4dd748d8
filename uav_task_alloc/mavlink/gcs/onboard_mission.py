# SPDX-License-Identifier: Apache-2.0
"""What one vehicle has on board against what it should have: the list, the mission, its state."""
from __future__ import annotations

import random
from collections import deque

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.gcs.resume import Resume
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.upload_failures import UploadFailures
from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff, diff_missions
from uav_task_alloc.mavlink.mission.items import Item, TaskList, all_alike, home_item
from uav_task_alloc.mavlink.mission.outcomes import Accepted, Failed, Downloaded, Mission, Verified
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.mavlink.mission.reached_during_upload import ReachedDuringUpload
from uav_task_alloc.mavlink.mission.upload import SUPERSEDED, Upload
from uav_task_alloc.mavlink.mission.verified_mission import MissionState, VerifiedMission
from uav_task_alloc.mavlink.mission.wanted_mission import TaskFailed, WantedMission
from uav_task_alloc.mavlink.transport.codec import Message
from uav_task_alloc.mavlink.transport.notes import OperatorNote
from uav_task_alloc.model import Task

LATE = 6.0  # [s] around the end of a mission in which its last REACHED comes


class OnboardMission:
    """The mission of one vehicle; seq counts without home, which ArduPilot keeps at 0."""

    def __init__(self, peer: Peer, profile: Profile, origin: Origin, telemetry: Telemetry,
                 rng: random.Random) -> None:
        self.upload = Upload(peer, idle_after=profile.idle_after, rng=rng)
        self.upload.is_superseded = self._overtaken
        self.progress = ProgressTable(telemetry.frames, repeats=profile.atomic)
        self.resume = Resume(profile, origin, telemetry, self.progress)
        self.own = int(profile.rules.home_first)
        self.list = WantedMission(profile, origin, self.progress)
        self.revision = 0  # of the last list verified on board
        self.notes: deque[OperatorNote] = deque()
        self.trouble = False  # the last transfer failed; somebody decides when to try again
        self.must_jump: int | None = None  # the item to fly now, where the upload did not say it
        self._profile, self._origin, self._telemetry = profile, origin, telemetry
        self._done_then: frozenset[str] = frozenset()  # as the upload began
        self._ambiguous = ReachedDuringUpload(self.progress)  # of this epoch, or of the next
        self._mission = VerifiedMission(self.own, profile.atomic)
        self._failures = UploadFailures(self.list, self.own, self.notes)
        self._uploading: tuple[MissionDiff, TaskList] | None = None  # and the list it is for
        self._begun = False  # the epoch of this upload
        self._unsure: tuple[MissionDiff, TaskList] | None = (
            None  # sent, and not seen to be on board
        )
        # [s] of the vehicle's clock: all items were sent, which it may fly since
        self._sent_since: float | None = None
        self.item_time = 0.0  # [s] that an item took in the uploads so far, roughly
        self._began_at = 0.0  # [s]
        self._recalled: tuple[TaskList, int] | None = None

    @property
    def held(self) -> tuple[Item, ...] | None:
        """The items on board, without home; None: to be read."""
        return self._mission.items

    @property
    def verified_at(self) -> float:
        """When they were read last [s]."""
        return self._mission.verified_at

    @property
    def is_foreign(self) -> bool:
        """Somebody else has changed what we had verified."""
        return self._mission.is_foreign

    @property
    def state(self) -> MissionState:
        return MissionState.UPLOADING if self._uploading is not None else self._mission.state

    @property
    def stored(self) -> MissionState:
        """What is known of what is on board, whether or not a transfer runs."""
        return self._mission.state

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
        """A transfer runs, or ran, and nobody knows yet whether the vehicle has taken it."""
        return self._unsure is not None or (self._uploading is not None and not self._begun)

    @property
    def outdated(self) -> bool:
        """The transfer is for an older list."""
        return (self._uploading is not None and self.tasks is not None
                and self._uploading[1].revision != self.tasks.revision)

    @property
    def taken(self) -> bool:
        """The vehicle has taken all of a transfer, once or of that which runs."""
        return self._begun

    @property
    def tasks(self) -> TaskList | None:
        """The latest list."""
        return self.list.tasks

    @property
    def failed(self) -> deque[TaskFailed]:
        """Tasks that the vehicle does not take, to be told."""
        return self.list.failed

    def remaining(self) -> TaskList:
        """The list less what is flown or refused, up to the horizon."""
        return self.list.remaining()

    def wanted(self) -> tuple[Item, ...]:
        """The items to fly from here."""
        return self.list.items()

    def open_tasks(self) -> tuple[Task, ...]:
        """Those of the list that are still to be flown, and can be."""
        return self.list.open_tasks()

    def change(self) -> MissionDiff:
        """What has to change on board."""
        assert self.held is not None
        wanted, current = self.wanted(), self.progress.current
        done = {*self.progress.completed, *self.progress.pending}
        found = diff_missions(self.held, current, wanted, done=done)
        if self.list.horizon.stops is not None and found.kind is not DiffKind.KEEP:
            if self.list.has_enough(self.held):
                return MissionDiff(DiffKind.KEEP, self.held, current or 0)
            if self.list.horizon.grow():
                return self.change()
        room = self._profile.rules.capacity - self.own
        if found.kind is DiffKind.APPEND and (self._profile.atomic or len(found.items) > room):
            return diff_missions(self.held, current, wanted, append=False)
        return found

    def adopt(self, found: MissionDiff, now: float, tasks: TaskList | None = None) -> None:
        """The list is on board already; not where `tasks` was meant, and another came since."""
        assert self.tasks is not None
        if tasks is not None and tasks != self.tasks:
            return
        if self.revision != self.tasks.revision or self.stored is not MissionState.VERIFIED:
            self._verify(found.items, self.tasks.revision, now)
            self.progress.retag(found.items)

    def begin_upload(self, found: MissionDiff, now: float) -> list[Message]:
        """Bring it on board."""
        assert self.tasks is not None
        self._uploading, self._begun, self.trouble = (found, self.tasks), False, False
        self._began_at, self._sent_since = now, None
        self.list.horizon.begin()
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
            self._mission.note_mission_id(message)
        out = self.upload.receive(message, now)
        if not self.upload.may_be_stored:
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
        if self._unsure is not None or (self.open and self.upload.may_be_stored):
            self._ambiguous.add(seq, now)
        else:
            self.progress.note_reached(seq, now)

    def is_of_known_mission(self, message: Message) -> bool:
        """A MISSION_CURRENT is of the mission that is known, not of one that is sent now."""
        return not self.open or self._mission.has_mission_id(message)

    def abort(self) -> list[Message]:
        """Somebody else has the vehicle: the transfer ends where it is."""
        if self.upload.busy:
            self.upload.reset()
        if self._uploading is not None:
            self._ambiguous.credit(self._uploading[0])
            self._uploading = None
            self._mission.interrupt()
        return []

    def verified(self) -> bool:
        """The list is on board, and nothing is to be changed."""
        return (self.state is MissionState.VERIFIED and self.held is not None
                and self.tasks is not None and bool(self.wanted())
                and self.change().kind is DiffKind.KEEP)

    def restarted(self) -> None:
        """The vehicle forgot its transfer, and perhaps its mission."""
        self.upload.reset()
        self._failures.clear()
        self._ambiguous.clear()
        self.progress.invalidate()
        self._mission.reset()
        self._uploading = self._unsure = None
        self.resume.reset()

    def watch(self, message: Message, now: float) -> None:
        """Has somebody else changed the mission? What MISSION_CURRENT says is doubt, not proof."""
        self._mission.check_current(message, now)

    def catch_up(self, now: float) -> None:
        """Complete what the vehicle has flown before anybody listened."""
        memory = self.resume.memory(now)
        if memory and self.tasks and (self.tasks, len(memory)) != self._recalled:
            self._recalled = self.tasks, len(memory)
            self.progress.complete_offline(self.resume.flown(self.open_tasks(), now))

    def _settle(self, now: float) -> None:
        self._failures.step(now)
        while self.upload.events:
            event = self.upload.events.popleft()
            if isinstance(event, Downloaded):
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

    def _begin(self, found: MissionDiff, now: float) -> None:
        if self._begun:
            return
        self._begun = True
        of_new = self._ambiguous.assign_epochs(found)
        self.item_time = (self.item_time + (now - self._began_at) / len(found.items)) / 2.0
        self.resume.stash()
        if found.kind is DiffKind.APPEND:
            self.progress.extend(found.items)
        else:
            self.progress.begin(found.items, found.start, now, since=self._sent_since)
            if not self._profile.atomic:
                self.must_jump = found.start
        for seq, when in of_new:
            self.progress.note_reached(seq, when, proven=True)
        self._ambiguous.continue_repetition()

    def _verify(self, items: tuple[Item, ...], revision: int, now: float) -> None:
        self._mission.verify(items, now)
        self.revision = revision
        self.list.horizon.verified()

    def _was_read(self, event: Downloaded, now: float) -> None:
        if event.items is None:
            self.trouble = True
            return
        held, known = event.items[self.own:], self.progress.items
        if self._unsure is not None:
            found, tasks = self._unsure
            self._unsure = None
            if all_alike(found.items, held):
                self._begin(found, now)
                self._verify(found.items, tasks.revision, now)
                return
            self._ambiguous.credit(found)
        if not self._mission.note_readback(
                held, known, self.tasks is not None, lambda: self._goes_on(held), now):
            return
        self.resume.stash()
        current = self._telemetry.current
        self.progress.begin(held, None if current is None or not held
                            else max(0, current - self.own), now, read=True)

    def _goes_on(self, held: tuple[Item, ...]) -> bool:
        """The list can go on with a mission, without a swap."""
        wanted = self.wanted()
        return bool(wanted) and diff_missions(
            held, None, wanted, done=self.progress.completed).kind is not DiffKind.REPLACE

    def _was_refused(self, event: Failed, found: MissionDiff, tasks: TaskList, now: float) -> None:
        self._mission.interrupt()
        self.trouble = event.reason != SUPERSEDED
        if event.result is None and self._sent_since is not None and not self._begun:
            self._unsure = found, tasks
        else:
            self._ambiguous.credit(found)
        if self.trouble:
            self.trouble = self._failures.take(event, found, tasks, now)
