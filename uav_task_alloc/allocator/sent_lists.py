# SPDX-License-Identifier: Apache-2.0
"""The lists that a UAV may have on board: that in force, and those sent before it."""
from __future__ import annotations

from uav_task_alloc.allocator.list_records import UavList
from uav_task_alloc.allocator.state.world import World

_MOST_SENT = 50  # lists of a UAV that are kept


class SentLists:
    """Keeps the list that each UAV reports to be on board, and those that may follow it.

    Args:
        world: of the allocator.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._sent: dict[str, dict[int, UavList]] = {}  # by id and revision

    def update(self) -> None:
        """Add the lists in force; forget those before the reported ones, and UAVs that left."""
        records = self._world.uav_records()
        for uav_id in self._sent.keys() - records.keys():
            del self._sent[uav_id]
        for uav_id, record in records.items():
            kept, current = self._sent.setdefault(uav_id, {}), self._world.list_of(uav_id)
            kept[current.revision] = current
            reported = record.report.list_revision
            for revision in [*kept]:
                if revision < reported or (
                        len(kept) > _MOST_SENT and revision not in (reported, current.revision)):
                    del kept[revision]

    def sent(self, uav_id: str, revision: int) -> UavList | None:
        """Return a list of a UAV.

        Args:
            uav_id: of the UAV.
            revision: of the list.

        Returns:
            None: it is not kept.
        """
        return self._sent.get(uav_id, {}).get(revision)
