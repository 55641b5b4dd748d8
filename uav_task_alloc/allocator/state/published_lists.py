# SPDX-License-Identifier: Apache-2.0
"""The book of lists: what each UAV was told last, and which task was in which revision."""
from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace

from uav_task_alloc.allocator.records import UavList


class PublishedLists:
    """Lists by UAV; a revision is never used twice, not even over a restart."""

    def __init__(self, lists: Iterable[UavList] = (), tasks: Iterable[str] = ()) -> None:
        """lists: those of the life before. tasks: ids of all that it knew in the end."""
        self.lists = {each.uav: each for each in lists}
        self.dirty: set[str] = set()  # not yet on disk
        self.strange = False  # a UAV had a list that is not of this book
        # revisions of the life before, and of another allocator: nobody knows what they had
        self._old = {each.uav: each.revision for each in self.lists.values()}
        self._learned: dict[str, int] = {}
        self._known = set(tasks)
        self._served: set[str] = set()  # UAVs that had tasks
        self._above = 0  # new UAVs begin above: a forgotten one may come back with its list
        self._carried: dict[tuple[str, str], tuple[int, int]] = {}

    def get(self, uav_id: str) -> UavList:
        """The list in force; one of revision 0 where none was ever published."""
        return self.lists.get(uav_id) or UavList(uav_id, 0)

    def publish(self, new: UavList, stamp: float, again: bool = False) -> UavList | None:
        """Put a list in force under the next revision; None: it says nothing new."""
        held = self.get(new.uav)
        if not again and (new is held or new.flies_as(held)):
            return None
        if not new.stops and held.revision == 0 and not again:
            return None
        made = replace(new, revision=(held.revision or self._above) + 1, stamp=stamp)
        self.lists[new.uav] = made
        self.dirty.add(new.uav)
        if made.stops:
            self._served.add(new.uav)
        for task_id in made.task_ids:
            first, _ = self._carried.get((new.uav, task_id), (made.revision, 0))
            self._carried[new.uav, task_id] = (first, made.revision)
        return made

    def learn(self, uav_id: str, revision: int) -> bool:
        """A UAV holds a list of an earlier life of the allocator: count on from there."""
        held = self.get(uav_id)
        if revision <= held.revision:
            return False
        self.strange = True
        self.lists[uav_id] = replace(held, revision=revision)
        self._learned[uav_id] = revision
        return True

    def carried(self, uav_id: str, task_id: str, revision: int) -> bool:
        """Whether that revision of the UAV's list had the task, as far as is remembered."""
        if revision == 0:
            return task_id in self.get(uav_id).task_ids
        if revision <= self._learned.get(uav_id, 0):
            return True
        if revision <= self._old.get(uav_id, 0) and task_id in self._known:
            return True
        first, last = self._carried.get((uav_id, task_id), (1, 0))
        return first <= revision <= last

    def owners(self) -> dict[str, str]:
        """Who has each listed task."""
        return {task_id: each.uav for each in self.lists.values() for task_id in each.task_ids}

    def aged(self, uav_id: str, stamp: float) -> UavList:
        """The list in force with its arrival times counted from `stamp`."""
        held = self.get(uav_id)
        age = max(0.0, stamp - held.stamp)
        stops = tuple(replace(stop, eta=max(0.0, stop.eta - age)) for stop in held.stops)
        return replace(held, stops=stops)

    def without_flown(self, uav_id: str, done: Callable[[str], bool],
                      stamp: float) -> UavList | None:
        """The list without the ended tasks at its front; None: there are none, or others too.

        An ended task further back changes legs: that list is the next plan's business.
        """
        stops = self.get(uav_id).stops
        if not stops or not done(stops[0].task.id):
            return None
        held = self.aged(uav_id, stamp)
        stops = held.stops
        while stops and done(stops[0].task.id):
            stops = stops[1:]
        if any(done(stop.task.id) for stop in stops):
            return None
        flown = sum(stop.leg.length for stop in held.stops[:len(held.stops) - len(stops)])
        return replace(held, stops=stops, distance=held.distance - flown if stops else 0.0)

    def forget_uav(self, uav_id: str) -> None:
        """Nobody flies by that id; where it comes back its revisions rise all the same."""
        held = self.lists.pop(uav_id, None)
        if held is None:
            return
        self.dirty.add(uav_id)
        if uav_id in self._served:
            self._served.remove(uav_id)
            self._above = max(self._above, held.revision)
            self._carried = {key: span for key, span in self._carried.items()
                             if key[0] != uav_id}
        self._old.pop(uav_id, None)
        self._learned.pop(uav_id, None)

    def forget(self, task_ids: Collection[str]) -> None:
        """These tasks are of the past; nobody will ask which revision had them."""
        self._carried = {key: span for key, span in self._carried.items()
                         if key[1] not in task_ids}
        self._known.difference_update(task_ids)
