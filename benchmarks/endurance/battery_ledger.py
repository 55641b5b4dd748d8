# SPDX-License-Identifier: Apache-2.0
"""What battery_kills.py knows: tasks that were acknowledged, and the ground truth of fleet_sim."""
from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from uav_task_alloc_msgs import msg as m

from uav_task_alloc.model import Task
from uav_task_alloc.nodes.conversions.messages import from_stamp

AT_HOME, IN_THE_AIR, VISIT = 5.0, 1.0, 0.3  # [m]
KNOWN_AFTER = 10.0  # [s] from an acknowledgement until it must be in statuses
S = m.TaskStatus
ENDED = (S.COMPLETED, S.CANCELLED, S.FAILED)
Point = tuple[float, float, float]


class Ledger:
    """Acknowledged tasks, and what contradicts that; kept in a file from part to part."""

    def __init__(self) -> None:
        self.number = 0  # of the last task
        self.tasks: dict[str, Point] = {}  # acknowledged
        self.known_at: dict[str, float] = {}  # [s] of /clock
        self.ended: dict[str, int] = {}  # states
        self.lost: set[str] = set()
        self.reopened: set[str] = set()
        self._visits = Counter[str]()

    @classmethod
    def load(cls, path: Path) -> Ledger:
        ledger = cls()
        if path.exists():
            saved = json.loads(path.read_text())
            ledger.number, ledger.ended = saved['number'], saved['ended']
            ledger.tasks = {name: tuple(place) for name, place in saved['tasks'].items()}
        return ledger

    def save(self, path: Path) -> None:
        path.write_text(json.dumps({'number': self.number, 'tasks': self.tasks,
                                    'ended': self.ended}))

    def open(self) -> list[str]:
        return [name for name in self.tasks if name not in self.ended]

    def count(self, state: int) -> int:
        return sum(each == state for each in self.ended.values())

    def accept(self, task: Task, now: float) -> None:
        self.tasks[task.id] = task.position
        self.known_at[task.id] = now

    def statuses(self, msg: m.TaskStatusArray, now: float) -> None:
        """Take what has ended; find what is not there, or no longer ended."""
        known = {status.task_id: status.state for status in msg.statuses
                 if status.state != S.REJECTED}
        stamp = from_stamp(msg.header.stamp)
        self.lost |= {name for name in self.tasks if name not in known
                      and self.known_at.get(name, -math.inf) + KNOWN_AFTER < stamp}
        self.reopened |= {name for name, state in self.ended.items()
                          if known.get(name, state) != state}
        self.ended.update((name, state) for name, state in known.items()
                          if state in ENDED and name in self.tasks)

    def visited(self, point: Point) -> None:
        """Count the visit of a task whose item was reached."""
        self._visits.update(name for name, place in self.tasks.items()
                            if math.dist(place, point) < VISIT)

    def flown_twice(self) -> list[str]:
        """Tasks at which the item was reached more than once."""
        return sorted(name for name, count in self._visits.items() if count > 1)


class Truth:
    """Follows the log of fleet_sim: changes, landings away from home, empty batteries."""

    def __init__(self, path: Path, homes: dict[str, Point],
                 on_reached: Callable[[Point], None]) -> None:
        self._path, self._homes, self._on_reached = path, homes, on_reached
        self._offset, self._empty = 0, set[str]()
        self.figures = dict.fromkeys(('changes', 'emptied', 'away', 'died'), 0)
        self.changed: dict[str, float] = {}  # [s] of /clock: battery out, not available since
        self.least = 1.0  # battery in the air

    def read(self) -> None:
        """Read the lines that were written since the last call."""
        if not self._path.exists():
            return
        with self._path.open('rb') as file:
            file.seek(self._offset)
            data = file.read()
        whole = data[:data.rfind(b'\n') + 1]
        self._offset += len(whole)
        for line in whole.splitlines():
            self._apply(json.loads(line))

    def _apply(self, row: dict) -> None:
        uav, event = row['uav'], row.get('event')
        if event is None:
            self._sample(uav, row['z'], row['battery'])
        elif event == 'power_off':
            self.figures['changes'] += 1
            self.changed[uav] = row['clock']
        elif event == 'item_reached':
            self._on_reached((row['x'], row['y'], row['z']))
        elif event == 'disarmed':
            away = math.dist((row['x'], row['y'], row['z']), self._homes[uav]) > AT_HOME
            self.figures['away'] += away
        else:
            self.figures['died'] += event in ('died', 'crashed')

    def _sample(self, uav: str, height: float, battery: float) -> None:
        if height > IN_THE_AIR:
            self.least = min(self.least, battery)
            if battery <= 0.0 and uav not in self._empty:
                self.figures['emptied'] += 1
                self._empty.add(uav)
        else:
            self._empty.discard(uav)
