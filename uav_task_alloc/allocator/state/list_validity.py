# SPDX-License-Identifier: Apache-2.0
"""Whether the list in force of a UAV can stay as it is, or has to be replaced."""
from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise

from uav_task_alloc.allocator.state.fleet import Fleet
from uav_task_alloc.allocator.state.ordered_tasks import OrderedTasks
from uav_task_alloc.allocator.state.published_lists import PublishedLists
from uav_task_alloc.allocator.state.safe_paths import GetSafePaths, SafePaths
from uav_task_alloc.allocator.state.tasks import TaskRegistry
from uav_task_alloc.model import Point, Task

ZonesWhenBuilt = Mapping[str, tuple[SafePaths, Point]]  # UAV -> paths, and its home [m]


class ListValidity:
    """Compares the lists in force with the present tasks, UAVs and zones.

    Args:
        tasks, fleet, lists, ordered: the present state.
        paths: returns those around the present zones.
        stranded: UAVs without a safe path home; their lists end without a return.
    """

    def __init__(self, tasks: TaskRegistry, fleet: Fleet, lists: PublishedLists,
                 paths: GetSafePaths, ordered: OrderedTasks, stranded: Collection[str]) -> None:
        self._tasks, self._fleet, self._lists, self._paths = tasks, fleet, lists, paths
        self._ordered, self._stranded = ordered, stranded
        self.zones_when_built: dict[str, tuple[SafePaths, Point]] = {}

    def is_current(self, uav_id: str, tasks: Sequence[Task], returns: bool,
                   backward: Collection[str] = ()) -> bool:
        """Return whether the list in force has these tasks and end, and fits the present zones.

        A list whose leg under way is cut, or whose UAV is inside a zone, does not.

        Args:
            uav_id: a known UAV.
            tasks: in the order of flight.
            returns: whether its list should end with a return home.
            backward: ids of the tasks whose paths are flown from the last point; under way that
                does not change.
        """
        return self._has_tasks(uav_id, tasks, backward) and (
            self._lists.get(uav_id).returns or not self._returns(uav_id, returns))

    def _returns(self, uav_id: str, returns: bool) -> bool:
        return returns and uav_id not in self._stranded

    def _has_tasks(self, uav_id: str, tasks: Sequence[Task], backward: Collection[str]) -> bool:
        """Whether the list in force has these tasks, and was built for the present zones."""
        stops, paths = self._lists.get(uav_id).stops, self._paths()
        record = self._fleet.records[uav_id]
        return (bool(stops) and self.zones_when_built.get(uav_id) == (paths, record.home)
                and not record.inside_zone
                and [stop.task for stop in stops] == tasks
                and all(stop.reversed == (stop.task.id in backward) for stop in stops[1:])
                and (stops[0].reversed == (stops[0].task.id in backward)
                     or self._fleet.active.get(uav_id) == stops[0].task.id)
                and paths.rest(record.report.position, stops[0].through,
                               stops[0].exit) is not None)

    def must_change(self, uav_id: str, returns: bool) -> bool:
        """Return whether the list in force cannot or may not be flown, or has no tasks.

        Args:
            uav_id: a UAV.
            returns: whether its list should end with a return home.
        """
        published = self._lists.get(uav_id)
        if not published.stops or self.why_change(uav_id):
            return True
        for stop in published.stops:
            known = self._tasks.records.get(stop.task.id)
            if known is None or not known.open or known.task != stop.task:
                return True
        return published.returns != self._returns(uav_id, returns)

    def why_change(self, uav_id: str) -> str:
        """Return why the list in force of a UAV may not wait for another one; '' if it may.

        That tasks of it have ended is no such reason.

        Args:
            uav_id: a UAV.
        """
        stops, record = self._lists.get(uav_id).stops, self._fleet.records.get(uav_id)
        if not stops:
            return ''
        if record is None or not self._fleet.usable(uav_id):
            return self._fleet.why_unusable(uav_id)
        if self._ordered.breaks(uav_id):
            return 'an order'
        for stop in stops:
            known = self._tasks.records.get(stop.task.id)
            if known is not None and known.open and not self._fleet.may_fly(
                    uav_id, known.task, known.failed_on):
                return f'it may not fly {stop.task.id} any more'
        paths, first = self._paths(), stops[0]
        clear = (paths.rest(record.report.position, first.through, first.exit) is not None
                 and all(paths.clear(before.exit, *stop.line)
                         for before, stop in pairwise(stops)))
        return '' if clear else 'a zone'

    def forget(self, uav_id: str) -> None:
        """Drop what is kept of a UAV."""
        self.zones_when_built.pop(uav_id, None)
