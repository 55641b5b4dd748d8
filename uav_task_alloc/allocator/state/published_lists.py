# SPDX-License-Identifier: Apache-2.0
"""The task list published last for each UAV, and which revisions contained which task."""
from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.state.flight_pace import UavFlight
from uav_task_alloc.allocator.state.stop_times import timed_stops
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Leg, Point
from uav_task_alloc.piece_ids import split_piece

_MOST_FOREIGN = 2**30  # revision of another allocator: this one goes on from it to 2**31 - 1


class PublishedLists:
    """Lists by UAV; a revision is never used twice, not even across a restart.

    Args:
        lists: of the previous run.
        tasks: ids of all tasks that it knew.
    """

    def __init__(self, lists: Iterable[UavList] = (), tasks: Iterable[str] = ()) -> None:
        self.lists = {each.uav: each for each in lists}
        self.unsaved: set[str] = set()  # not yet on disk
        self.to_resend = {*self.lists}  # UAVs whose lists are to be published again
        self.foreign = False  # a UAV had a list that this allocator did not publish
        # revisions of the previous run, and of another allocator: their tasks are unknown
        self._previous = {each.uav: each.revision for each in self.lists.values()}
        self._foreign_revisions: dict[str, int] = {}
        self._on_board: dict[str, int] = {}  # UAV -> revision that it reports
        self._known_tasks = set(tasks)
        self._had_tasks: set[str] = set()  # UAVs
        # new UAVs begin above this revision: a forgotten one may return with its list
        self._revision_floor = 0
        # (UAV, task) -> first and last revision that contained the task
        self._contained: dict[tuple[str, str], tuple[int, int]] = {}
        # by UAV the list in force, its flight, and the list with times by that
        self._restamped: dict[str, tuple[UavList, UavFlight, UavList]] = {}

    def get(self, uav_id: str) -> UavList:
        """Return the list in force; one of revision 0 where none was ever published.

        Args:
            uav_id: of a UAV, known or not.
        """
        return self.lists.get(uav_id) or UavList(uav_id, 0)

    def publish(self, new: UavList, stamp: float, resend: bool = False) -> UavList | None:
        """Put a list in force under the next revision.

        Args:
            new: the list.
            stamp: [s].
            resend: also if it equals the list in force.

        Returns:
            The list with its revision; None where nothing changed.
        """
        published = self.get(new.uav)
        if not resend and (new is published or new.same_route(published)):
            return None
        if self.is_void(new) and not resend:
            return None
        revised = replace(new, revision=(published.revision or self._revision_floor) + 1,
                          stamp=stamp)
        self.lists[new.uav] = revised
        self.unsaved.add(new.uav)
        self.to_resend.discard(new.uav)
        if revised.stops:
            self._had_tasks.add(new.uav)
        for task_id in revised.task_ids:
            first, _ = self._contained.get((new.uav, task_id), (revised.revision, 0))
            self._contained[new.uav, task_id] = (first, revised.revision)
        return revised

    def check_revision(self, uav_id: str, revision: int) -> None:
        """Check the revision that a UAV reports.

        Args:
            uav_id: of a UAV, known or not.
            revision: of the list on board.

        Raises:
            InvalidValue: it is above that of its list, and too great to go on from.
        """
        most = max(self.get(uav_id).revision, _MOST_FOREIGN)
        if revision > most:
            raise InvalidValue(f'uav {uav_id}: list_revision', revision, f'at most {most}')

    def clock_jumped(self, by: float) -> None:
        """Shift the times of all lists with the published clock; those with waits are sent again.

        Args:
            by: [s] of the jump.
        """
        for uav_id, each in self.lists.items():
            self.lists[uav_id] = shifted_list(each, by)
            self.unsaved.add(uav_id)
            if any(stop.begin_after for stop in each.stops):
                self.to_resend.add(uav_id)

    def is_void(self, new: UavList) -> bool:
        """Return whether a list asks nothing of a UAV that has had none.

        Args:
            new: that may be published.
        """
        return not (new.stops or new.end_via) and self.get(new.uav).revision == 0

    def raise_revision(self, uav_id: str, revision: int) -> None:
        """Continue from the revision that a UAV holds, and resend its list if that is above it.

        Such a list is of a previous run, or of another allocator.
        """
        published = self.get(uav_id)
        self._on_board[uav_id] = revision
        if revision <= published.revision:
            return
        self.foreign = True
        self.to_resend.add(uav_id)
        self.lists[uav_id] = replace(published, revision=revision)
        self._foreign_revisions[uav_id] = revision

    def contained(self, uav_id: str, task_id: str, revision: int) -> bool:
        """Return whether that revision of a UAV's list contained a task, as far as is known.

        Another allocator may have given the number of a piece to another way. The bridge compares
        the ways when it takes a list, and then repeats the event of a piece that was flown.
        """
        if revision == 0:
            return task_id in self.get(uav_id).task_ids
        first, last = self._contained.get((uav_id, task_id), (1, 0))
        if revision <= self._foreign_revisions.get(uav_id, 0):
            return not split_piece(task_id)[1] or (
                last > 0 and self._on_board.get(uav_id, 0) >= first)
        if revision <= self._previous.get(uav_id, 0) and task_id in self._known_tasks:
            return True
        return first <= revision <= last

    def owners(self) -> dict[str, str]:
        """Return the UAV of each listed task."""
        return {task_id: each.uav for each in self.lists.values() for task_id in each.task_ids}

    def restamped(self, uav_id: str, stamp: float, flight: UavFlight | None) -> UavList:
        """Return the list in force with its arrival times counted from `stamp`.

        Args:
            uav_id: of the list.
            stamp: [s].
            flight: of the UAV now; None: unknown, and it flies as planned.
        """
        published = self.get(uav_id)
        if flight is None:
            return replace(published, stamp=stamp, stops=_later(
                published.stops, min(0.0, published.stamp - stamp)))
        known = self._restamped.get(uav_id)  # it is asked for several times in a step
        if known is not None and known[0] is published and known[1] == flight:
            return known[2] if known[2].stamp == stamp else replace(known[2], stamp=stamp)
        timed = replace(published, stops=timed_stops(published.stops, flight), stamp=stamp)
        self._restamped[uav_id] = published, flight, timed
        return timed

    def without_ended(self, uav_id: str, ended: Callable[[str], bool], stamp: float,
                      flight: UavFlight | None) -> UavList:
        """Return the list without its ended tasks; other arguments as of `restamped`.

        Where one was after an open task, its places stay as detour points: only along them the
        way is known to be clear of zones.

        Args:
            ended: whether a task has ended, by its id.
        """
        published, start = self.get(uav_id), None
        stops, over, metres = list[ListStop](), list[ListStop](), published.distance
        for stop in published.stops:
            if not ended(stop.task.id):
                stops.append(replace(stop, leg=Leg(
                    (*_places(over), *stop.leg.via), stop.leg.length + _length(over))))
                over.clear()
            elif stops:
                over.append(stop)
            else:  # at its front
                metres, start = metres - stop.length, stop.exit
        end_via = published.end_via
        if published.returns or end_via:
            end_via = *_places(over), *end_via
        else:
            metres -= _length(over)
        timed = timed_stops(stops, flight, start) if flight else _later(
            stops, min(0.0, published.stamp - stamp))
        return replace(published, stops=timed, stamp=stamp, end_via=end_via,
                       distance=metres if timed else 0.0)

    def forget_uav(self, uav_id: str) -> None:
        """Remove a UAV; if it reports again its revisions still increase."""
        self._on_board.pop(uav_id, None)
        self._restamped.pop(uav_id, None)
        self.to_resend.discard(uav_id)
        published = self.lists.pop(uav_id, None)
        if published is None:
            return
        self.unsaved.add(uav_id)
        if uav_id in self._had_tasks:
            self._had_tasks.remove(uav_id)
            self._revision_floor = max(self._revision_floor, published.revision)
            self._contained = {key: span for key, span in self._contained.items()
                               if key[0] != uav_id}
        self._previous.pop(uav_id, None)
        self._foreign_revisions.pop(uav_id, None)

    def forget_tasks(self, task_ids: Collection[str]) -> None:
        """Remove tasks that ended long ago: no event of them is accepted any more."""
        self._contained = {key: span for key, span in self._contained.items()
                           if key[1] not in task_ids}
        self._known_tasks.difference_update(task_ids)


def shifted_list(each: UavList, by: float) -> UavList:
    """Return a list with times of a published clock that has jumped.

    Args:
        each: list.
        by: [s] of the jump.

    Returns:
        The list with its stamp and its waits moved by as much; none is before the clock began.
    """
    return replace(each, stamp=each.stamp + by, stops=tuple(
        replace(stop, begin_after=max(0.0, stop.begin_after + by)) if stop.begin_after else stop
        for stop in each.stops))


def _places(stops: Iterable[ListStop]) -> Iterator[Point]:
    """All points of stops, in the order of flight."""
    return chain.from_iterable(stop.line for stop in stops)


def _length(stops: Iterable[ListStop]) -> float:
    return sum(stop.length for stop in stops)


def _later(stops: Sequence[ListStop], seconds: float) -> tuple[ListStop, ...]:
    return tuple(replace(stop, eta=max(0.0, stop.eta + seconds)) for stop in stops)
