# SPDX-License-Identifier: Apache-2.0
"""What nodes report on `/diagnostics`: health, counts of uploads, authority over UAVs."""
from __future__ import annotations

from collections.abc import Container

from uav_task_alloc.record.record_file import Line
from uav_task_alloc.record.reported import ReportedAuthority

_MOST = 100  # warnings
_SINCE_TOLERANCE = 3.0  # [s] of a start time: reports are in whole seconds and arrive late
_OUT_OF_DATE = 10.0  # [s] of real time that a report is older than another of its UAV


class BridgeReports:
    """The newest report of each node on each UAV, link or itself; several may report one UAV.

    Arguments of methods:
        line: of kind `uploads`.
        second: of real time, in those of the record.
        uav: id.
    """

    def __init__(self) -> None:
        self.authority: dict[str, ReportedAuthority] = {}  # by UAV
        self._counts: dict[str, tuple[int, int]] = {}  # by status: newest, of earlier runs
        self._last: dict[str, float] = {}  # by bridge: [unix s] of its newest report on a UAV
        # by UAV or other hardware id, then status: [unix s], level, text
        self._health: dict[str, dict[str, tuple[float, int, str]]] = {}

    def apply(self, line: Line, second: float) -> None:
        """Take the reports of a line."""
        for name, count in line['uploads'].items():
            last, earlier = self._counts.get(name, (0, 0))
            self._counts[name] = count, earlier + (last if count < last else 0)
            bridge, colon, _ = name.partition(':')
            if colon:  # as earlier versions do not write
                self._last[bridge] = line['wall']
        # in recordings of earlier versions a row has no UAV: its name is the UAV
        for name, (level, text, *uavs) in line.get('health', {}).items():
            uav = uavs[0] if uavs else name
            known = {other: row for other, row in self._health.get(uav, {}).items()
                     if line['wall'] - row[0] <= _OUT_OF_DATE * second}
            self._health[uav] = {**known, name: (line['wall'], level, text)}
        for uav, row in line.get('authority', {}).items():
            self.authority[uav] = ReportedAuthority(
                row['state'], row['why'], self._since(uav, row, line['wall'], second), row['back'])

    def _since(self, uav: str, row: Line, wall: float, second: float) -> float | None:
        """Since when authority is as a report says [unix s]; the same while it stays so."""
        if row['for'] is None:
            return None
        since, old = float(wall - second * row['for']), self.authority.get(uav)
        if old is None or old.since is None or old.state != row['state']:
            return since
        return old.since if abs(since - old.since) < _SINCE_TOLERANCE * second else since

    def warnings(self, uav: str) -> list[str]:
        """Return what is wrong with a UAV, the worst first.

        Args:
            uav: id.

        Returns:
            Texts; none where all is well.
        """
        rows = sorted(self._health.get(uav, {}).values(), key=lambda row: -row[1])
        return list(dict.fromkeys(text or 'a warning without a text'
                                  for _, level, text in rows if level))

    def other_warnings(self, uavs: Container[str], wall: float, second: float) -> list[str]:
        """Return what is wrong apart from UAVs: with nodes, links and other parts.

        Args:
            uavs: ids of the known UAVs.
            wall: present time [unix s]; reports that are out of date then are left out.
            second: see the class.

        Returns:
            Texts that begin with the name of the status, in the order of names.
        """
        found = {name: text or 'a warning without a text'
                 for hardware, rows in self._health.items() if hardware not in uavs
                 for name, (at, level, text) in rows.items()
                 if level and wall - at <= _OUT_OF_DATE * second}
        return [f'{name}: {text}' for name, text in sorted(found.items())[:_MOST]]

    def silent(self, wall: float, second: float) -> dict[str, float]:
        """Return the bridges that have reported on UAVs, and do not any more.

        Args:
            wall: present time [unix s].
            second: see the class.

        Returns:
            [unix s] of the last report, by the name of the node.
        """
        return {bridge: round(at, 1) for bridge, at in sorted(self._last.items())
                if wall - at > _OUT_OF_DATE * second}

    @property
    def uploads(self) -> int | None:
        """Uploads begun, also by bridges that were restarted; None: no bridge counts them."""
        return sum(map(sum, self._counts.values())) if self._counts else None
