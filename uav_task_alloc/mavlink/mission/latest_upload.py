# SPDX-License-Identifier: Apache-2.0
"""The latest upload of a vehicle's mission: does it run, and may its mission be on board?

A transfer that ends without an answer leaves that open until the mission is read back.
"""
from __future__ import annotations

from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff
from uav_task_alloc.mavlink.mission.items import TaskList


class LatestUpload:
    """What was sent, with its list, and what is known of it.

    Attributes:
        running: what is being uploaded, until it is verified or has failed; None: nothing is.
        taken: the vehicle has taken all items of the running upload.
        started_at: [s] of the latest.
        item_time: [s] that an item takes, smoothed over the uploads.

    Arguments of methods:
        diff: the mission that is sent.
        now: steady time [s].
    """

    def __init__(self) -> None:
        self.running: tuple[MissionDiff, TaskList] | None = None
        self.taken = False
        self.started_at = self.item_time = 0.0
        self._unconfirmed: tuple[MissionDiff, TaskList] | None = None  # sent; perhaps on board

    @property
    def is_open(self) -> bool:
        """Whether a running or ended upload is not known to be taken by the vehicle."""
        return self.unknown is not None

    @property
    def is_unconfirmed(self) -> bool:
        """Whether one has ended of which it is not known whether it was taken."""
        return self._unconfirmed is not None

    @property
    def unknown(self) -> MissionDiff | None:
        """What would be on board by an upload that is not known to be taken; None: none."""
        sent = self._unconfirmed or (None if self.taken else self.running)
        return sent and sent[0]

    @property
    def appends(self) -> bool:
        """Whether it leaves the items that are on board."""
        sent = self._unconfirmed or self.running
        return sent is not None and sent[0].kind is DiffKind.APPEND

    def is_outdated(self, tasks: TaskList | None) -> bool:
        """Whether it runs for another list than the present one.

        Args:
            tasks: the present list; None: there is none.
        """
        return (self.running is not None and tasks is not None
                and self.running[1].revision != tasks.revision)

    def begin(self, diff: MissionDiff, tasks: TaskList, now: float) -> None:
        """Note that an upload begins.

        Args:
            diff, now: see above.
            tasks: the list that it is for.
        """
        self.running, self.taken, self.started_at = (diff, tasks), False, now

    def note_taken(self, diff: MissionDiff, now: float) -> None:
        """Note that the vehicle has taken all items."""
        self.taken = True
        self.item_time = (self.item_time + (now - self.started_at) / len(diff.items)) / 2.0

    def end(self) -> None:
        """Note that the running one has ended, and what it has put on board is known."""
        self.running, self.taken = None, False

    def leave(self, may_be_stored: bool) -> MissionDiff | None:
        """End the running one without its verification.

        Args:
            may_be_stored: the vehicle may have all items, and has not refused them.

        Returns:
            What was sent, where the vehicle has taken it or cannot have; None: that is not known
            until the mission is read back.
        """
        sent, taken = self.running, self.taken
        self.end()
        if may_be_stored and not taken:
            self._unconfirmed = sent
            return None
        return sent and sent[0]

    def take_unconfirmed(self) -> tuple[MissionDiff, TaskList] | None:
        """Return what was left unconfirmed, once, as the mission was read back; None: nothing."""
        sent, self._unconfirmed = self._unconfirmed, None
        return sent

    def forget(self) -> None:
        """Forget what was sent: the vehicle was restarted."""
        self.end()
        self._unconfirmed = None
