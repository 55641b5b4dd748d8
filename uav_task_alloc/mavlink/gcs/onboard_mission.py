# SPDX-License-Identifier: Apache-2.0
"""The onboard mission of one vehicle compared with its task list: transfers and mission state."""
from __future__ import annotations

import random
from collections import deque

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.mavlink.autopilots import Profile
from uav_task_alloc.mavlink.gcs.mission_changes import MissionChanges
from uav_task_alloc.mavlink.gcs.resume import Resume
from uav_task_alloc.mavlink.gcs.telemetry import Telemetry
from uav_task_alloc.mavlink.gcs.upload_failures import UploadFailures
from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff
from uav_task_alloc.mavlink.mission.flown_meanwhile import first_task, resumed_at
from uav_task_alloc.mavlink.mission.item_to_set import ItemToSet
from uav_task_alloc.mavlink.mission.items import Item, TaskList, all_alike, home_item
from uav_task_alloc.mavlink.mission.latest_upload import LatestUpload
from uav_task_alloc.mavlink.mission.outcomes import Accepted, Downloaded, Failed, Mission, Verified
from uav_task_alloc.mavlink.mission.peer import Peer
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.mavlink.mission.reports_during_upload import ReportsDuringUpload
from uav_task_alloc.mavlink.mission.upload import SUPERSEDED, Upload
from uav_task_alloc.mavlink.mission.verified_mission import MissionState, VerifiedMission
from uav_task_alloc.mavlink.mission.wanted_mission import WantedMission
from uav_task_alloc.mavlink.transport.codec import Message, plan_id
from uav_task_alloc.mavlink.transport.notes import OperatorNote

LATE_REACHED = 6.0  # [s] around the end of a mission in which its last REACHED comes


class OnboardMission:
    """The mission of one vehicle; seq counts without home, which ArduPilot stores at 0.

    Args:
        peer: the vehicle.
        profile: of its autopilot.
        origin: of the local ENU frame.
        telemetry: of the vehicle.
        rng: for back-off jitter.
    """

    def __init__(self, peer: Peer, profile: Profile, origin: Origin, telemetry: Telemetry,
                 rng: random.Random) -> None:
        self.upload = Upload(peer, idle_after=telemetry.idle_after, rng=rng,
                             error_when_closed=not profile.atomic)
        self.upload.is_superseded, self.upload.on_difference = self._overtaken, self._correct
        self.progress = ProgressTable(telemetry.frames, profile.atomic, profile.rules.loiters)
        self.resume = Resume(profile, origin, telemetry, self.progress)
        self.own = int(profile.rules.home_first)
        self.list = WantedMission(profile, origin, self.progress, lambda: telemetry.airborne,
                                  lambda: telemetry.home or self.mission.landing_place(origin))
        self.resume.cruise = lambda: self.list.cruise()
        self.revision = 0  # of the last list verified on board
        self.notes: deque[OperatorNote] = deque()
        self.transfer_failed = False  # the last one; the caller schedules the next attempt
        # PX4 ignores a command to set the current item while its mission is read
        self.upload.may_read = lambda: not profile.atomic or not (
            self.upload.events or self.next_item() is not None)
        self.item_to_set = ItemToSet(self.progress, profile.atomic)
        self.latest_upload = LatestUpload()
        self._profile, self._origin, self._telemetry = profile, origin, telemetry
        self._at_start: object = None  # of the upload: tasks done, detour points left out
        self._reports = ReportsDuringUpload(self.progress, origin, profile.atomic)
        self.mission = VerifiedMission(self.own, profile.atomic)
        self._changes = MissionChanges(self.list, self.progress, telemetry, profile)
        self._failures = UploadFailures(self.list, self.own, self.notes)
        self._completed_for: tuple[TaskList, int] | None = None
        self._perhaps_foreign = False  # read after a restart, and not the recorded mission

    @property
    def held(self) -> tuple[Item, ...] | None:
        """The items on board, without home; None: unknown, to be read."""
        return self.mission.items

    @property
    def state(self) -> MissionState:
        """UPLOADING during a transfer, else `stored`."""
        return MissionState.UPLOADING if self.latest_upload.running else self.mission.state

    @property
    def stored(self) -> MissionState:
        """State of the stored mission, independent of a running transfer."""
        return self.mission.state

    @property
    def tasks(self) -> TaskList | None:
        """The latest list."""
        return self.list.tasks

    def remaining(self) -> TaskList:
        """The list without flown and refused tasks, up to the horizon."""
        return self.list.remaining()

    def wanted(self) -> tuple[Item, ...]:
        """The mission items still to be flown."""
        return self.list.items()

    def diff(self) -> MissionDiff:
        """What to change on board so that the list is flown; requires a known mission."""
        assert self.held is not None
        return self._changes.needed(self.held)

    def adopt(self, diff: MissionDiff, now: float, tasks: TaskList | None = None) -> None:
        """Mark the list as verified, as the onboard mission already flies it.

        Args:
            diff: the items on board.
            now: steady time [s].
            tasks: the list that `diff` was computed for; nothing is done if it was replaced.
        """
        assert self.tasks is not None
        if tasks is not None and tasks != self.tasks:
            return
        if self.revision != self.tasks.revision or self.stored is not MissionState.VERIFIED:
            self._verify(diff.items, self.tasks.revision, now)
            self.progress.retag(diff.items)

    def begin_upload(self, diff: MissionDiff, now: float) -> list[Message]:
        """Start the upload of `diff` for the present list."""
        assert self.tasks is not None
        self.latest_upload.begin(diff, self.tasks, now)
        self.transfer_failed, self._reports.sent_since = False, None
        self.list.horizon.begin()
        self._at_start = self.progress.done, self.list.left_out
        home = (home_item(self._telemetry.home, self._origin, self._profile.rules),) * self.own
        return self.upload.replace(Mission(
            home + diff.items, diff.start + self.own, self._profile.atomic, self.own), now)

    def next_item(self) -> int | None:
        """Seq to set during a transfer: past what PX4 has flown meanwhile; None: it flies on."""
        latest = self.latest_upload
        if latest.running is None or not self._profile.atomic or (
                self._may_be_of_new and not latest.taken):
            return None
        return self.item_to_set.while_uploading()

    def _overtaken(self) -> bool:
        """Whether, before another attempt, the upload is partly flown or of an older list."""
        outdated = self.latest_upload.is_outdated(self.tasks)
        return self._reports.has_reached or outdated or self._at_start != (
            self.progress.done, self.list.left_out)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of the mission protocol; returns the messages to send."""
        if (kind := message.get_type()) in ('MISSION_ACK', 'MISSION_COUNT'):
            self.mission.note_mission_id(message)
        elif kind == 'MISSION_CURRENT' and self._profile.atomic:
            self.progress.end_before_restart.note_current(
                message, now, self._telemetry.ends_by_mission)
        out = self.upload.receive(message, now)
        if not self.upload.may_be_stored:
            if self.upload.busy and not self.latest_upload.is_unconfirmed:
                self._reports.sent_since = None
        elif self._reports.sent_since is None:
            self._reports.note_sent(self._telemetry.frame)
        self._settle(now)
        return out + self.upload.begin_readback(now)

    def step(self, now: float) -> list[Message]:
        """Advance time; returns the messages to send."""
        out = self.upload.step(now)
        latest = self.latest_upload
        self._reports.step(latest.unknown, now)
        if latest.running is not None and not latest.taken and self._profile.atomic and (
                first_task(latest.running[0]) in self.progress.completed) and (
                not self.upload.sent_all):  # it would start at a task flown meanwhile
            out += self.upload.cancel(now)
        self._settle(now)
        return out

    def reached(self, seq: int, now: float, frame: int | None = None) -> None:
        """Process MISSION_ITEM_REACHED; after all items are sent it may be of either mission."""
        if not self.resume.located:
            self.resume.note_reached(seq, now, self._telemetry.frame)
        kept = self.latest_upload.appends and seq < len(self.progress.items)
        if self._may_be_of_new and not kept:
            self._reports.add_reached(seq, now, self._telemetry.frame)
        else:
            self._reports.note_passed(seq, now, self._telemetry.frame, is_current=False)
            self.progress.note_reached(seq, now, frame=frame)

    @property
    def _may_be_of_new(self) -> bool:
        """Whether a report may be of the mission of an upload."""
        latest = self.latest_upload
        return latest.is_unconfirmed or (latest.is_open and self.upload.may_be_stored)

    def is_of_known_mission(self, message: Message, now: float, flying: bool) -> bool:
        """Whether a MISSION_CURRENT refers to the known mission; else it is kept.

        Args:
            message: a MISSION_CURRENT.
            now: steady time [s].
            flying: whether the vehicle is in mission mode.
        """
        seq, frame = max(0, message.seq - self.own), self._telemetry.frame
        latest = self.latest_upload
        if not latest.is_open or latest.appends or not (flying or self._profile.atomic):
            self._reports.note_passed(seq, now, frame, is_current=True, flying=flying,
                                      of_taken=self.mission.is_taken(message))
            return True  # ArduPilot's current item stays that of the old mission until it flies
        if self.mission.has_mission_id(message):
            self._reports.release(self._telemetry.frame)
            return True
        if not self._may_be_of_new:
            return self._profile.atomic  # PX4 flies the old mission until it has all items
        self._reports.add_current(seq, now, frame, flying, plan_id(message))
        return False

    def abort(self) -> list[Message]:
        """Abort the transfer: another party controls the vehicle."""
        if self.upload.busy:
            self.upload.reset()
        if self.latest_upload.running is not None:
            self._leave_upload()
        return []

    def _leave_upload(self, refused: bool = False) -> None:
        """End the transfer without its verification."""
        sent = self.latest_upload.leave(self._reports.sent_since is not None and not refused)
        if sent is not None:
            self._reports.credit(sent)
        self.mission.interrupt()

    def verified(self) -> bool:
        """Whether the list is verified on board and nothing has to change."""
        return (self.state is MissionState.VERIFIED and self.held is not None
                and self.tasks is not None and bool(self.wanted())
                and self.diff().kind is DiffKind.KEEP)

    def restarted(self) -> None:
        """Reset after a restart of the vehicle: transfer lost, mission unknown."""
        until = self._reports.end(self.latest_upload.unknown)
        self.upload.reset()
        self._failures.clear()
        self.progress.invalidate(until)
        self.mission.reset()
        self.latest_upload.forget()
        self.resume.reset()

    def watch(self, message: Message, now: float) -> None:
        """Check a MISSION_CURRENT for changes by another party; a doubt leads to a readback."""
        self.mission.check_current(message, now)

    def check_replaced(self) -> None:
        """Find a mission that another station has put on board in flight while no bridge ran."""
        if not self._perhaps_foreign or not (self._telemetry.airborne or self._telemetry.grounded):
            return
        self._perhaps_foreign = False
        if self._telemetry.airborne and self.held and not (
                self.tasks is not None and self._changes.can_continue(self.held)):
            self.mission.note_foreign()

    def complete_flown(self, now: float) -> None:
        """Complete the tasks that the vehicle has flown while the bridge was down."""
        flown = self.resume.flown.count(now)
        if flown and self.tasks and (self.tasks, flown) != self._completed_for:
            self._completed_for = self.tasks, flown
            self.progress.complete_offline(self.resume.flown.tasks_among(
                self.list.open_tasks(), now))

    def _settle(self, now: float) -> None:
        self._failures.step(now)
        while self.upload.events:
            event = self.upload.events.popleft()
            if isinstance(event, Downloaded):
                self._on_read(event, now)
            elif self.latest_upload.running is not None:
                diff, tasks = self.latest_upload.running
                if isinstance(event, Accepted):
                    self._begin_epoch(diff, now)
                elif isinstance(event, Verified):
                    self._begin_epoch(diff, now)
                    self.latest_upload.end()
                    self._verify(diff.items, tasks.revision, now)
                else:
                    self._on_failure(event, diff, tasks, now)

    def _begin_epoch(self, diff: MissionDiff, now: float) -> None:
        if self.latest_upload.taken:
            return
        self.latest_upload.note_taken(diff, now)
        self._telemetry.note_new_mission()
        of_new = self._reports.begin_new(diff)
        self.resume.flown.keep()
        resumed = resumed_at(self.progress.items, self.progress.current, diff)
        if diff.kind is DiffKind.APPEND:
            self.progress.extend(diff.items)
        else:
            self.progress.begin(diff.items, diff.start, now, since=self._reports.sent_since)
        self._reports.replay(of_new, self.mission.reported_id)
        self.item_to_set.choose(diff, resumed, self.upload.sent_before, now)

    def _correct(self, held: tuple[Item, ...], now: float) -> bool:
        """Count reports for the items that PX4 has taken, where they are others than were sent."""
        if not self._profile.atomic or not self.resume.located or not self._reports.correct(
                self.resume.read_again(held, self.tasks)[0], now):
            return False
        self.latest_upload.taken, self.item_to_set.seq = False, None
        self.mission.altered = True
        return True

    def _verify(self, items: tuple[Item, ...], revision: int, now: float) -> None:
        self.mission.verify(items, now)
        self._reports.confirm()
        self.revision = revision
        self.list.horizon.verified()

    def _on_read(self, event: Downloaded, now: float) -> None:
        if event.items is None:
            self.transfer_failed = True
            return
        held, known = event.items[self.own:], self.progress.items
        if (unconfirmed := self.latest_upload.take_unconfirmed()) is not None:
            diff, tasks = unconfirmed
            if all_alike(diff.items, held):
                self._begin_epoch(diff, now)
                self._verify(diff.items, tasks.revision, now)
                return
            self._reports.credit(diff)
        if not self.mission.note_readback(
                held, known, self.tasks is not None,
                lambda: self._changes.can_continue(held), now):
            self._reports.confirm()
            return
        self._perhaps_foreign = self.resume.replaced(held)
        self.resume.flown.keep()
        if self._correct(held, now):
            return
        items, since = self.resume.read_again(held, self.tasks)
        seq = self._telemetry.mission.current
        self.progress.begin(items, None if seq is None or not held else max(0, seq - self.own),
                            now, read=True, since=since)

    def _on_failure(self, event: Failed, diff: MissionDiff, tasks: TaskList, now: float) -> None:
        self.transfer_failed = event.reason != SUPERSEDED
        self._leave_upload(refused=event.result is not None)
        if self.transfer_failed:
            self.transfer_failed = self._failures.take(event, diff, tasks, now)
