# SPDX-License-Identifier: Apache-2.0
"""What allocators report of themselves on `/diagnostics`, while they run."""
from __future__ import annotations

from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.record.clock_comparison import ClockLead
from uav_task_alloc.record.record_file import Line

ALLOCATOR_SILENT = 10.0  # [s] of real time; an allocator reports each second


class AllocatorReports:
    """The newest report of each allocator, by the name of its status.

    Arguments of methods:
        wall: [unix s].
        second: of real time, in those of `wall`.
    """

    def __init__(self) -> None:
        self.orders: dict[str, dict[str, str]] = {}  # texts by id
        self.lead = ClockLead()
        self._warnings: dict[str, dict[str, str]] = {}  # texts by UAV
        self._reserves: dict[str, float] = {}  # share of a battery
        self._last: dict[str, float] = {}  # [unix s] of the report

    def apply(self, line: Line, second: float) -> None:
        """Take the reports of a line of kind `uploads`, if it has any.

        Args:
            line: of a record.
            second: see the class.
        """
        warnings = line.get('uav_warnings', {})
        self._warnings.update(warnings)
        self._last.update(dict.fromkeys(warnings, line['wall']))
        self.orders.update(line.get('orders', {}))
        self._reserves.update(line.get('battery_reserves', {}))
        if 'stamp' in line:
            self.lead.add(line['wall'] - line['stamp'], second)

    def warnings(self, uav: str) -> list[str]:
        """Return what is wrong with a UAV.

        Args:
            uav: id.
        """
        return [each[uav] for each in self._warnings.values() if uav in each]

    @property
    def battery_reserve(self) -> float:
        """The greatest of all allocators [0..1]."""
        return max(self._reserves.values(), default=AllocatorParams.battery_reserve)

    def forget_silent(self, wall: float, second: float) -> bool:
        """Forget orders and warnings of allocators that have ended; whether there were any."""
        silent = self._silent(wall, second)
        orders = [self.orders.pop(name) for name in silent if name in self.orders]
        return any([*orders, *(self._warnings.pop(name) for name in silent
                               if name in self._warnings)])

    def have_ended(self, wall: float, second: float) -> bool:
        """Whether all that have reported are silent now; False where none has."""
        return bool(self._last) and self._silent(wall, second) == self._last.keys()

    def silent_since(self, wall: float, second: float) -> float | None:
        """Return since when no allocator reports.

        Args:
            wall, second: see the class.

        Returns:
            [unix s] of the last report; None while one does, or where none ever did.
        """
        return max(self._last.values()) if self.have_ended(wall, second) else None

    def _silent(self, wall: float, second: float) -> set[str]:
        return {name for name, at in self._last.items() if wall - at > ALLOCATOR_SILENT * second}
