# SPDX-License-Identifier: Apache-2.0
"""Values of orders: what an operator orders, the log of it, and the holds that follow."""
from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from uav_task_alloc.errors import first_of


class OrderKind(Enum):
    """What an order is about; the value is its word in texts and in the journal."""

    PIN = 'pin'
    FORBID = 'forbid'
    SEQUENCE = 'order'
    PAUSE = 'pause'
    RETURN = 'return'


@dataclass(frozen=True, slots=True)
class Order:
    """One order of an operator."""

    kind: OrderKind  # what it is about
    uav: str  # id
    tasks: tuple[str, ...] = ()  # of PIN and FORBID one; of SEQUENCE in the order of flight
    operator: str = ''  # who gave it
    number: int = 0  # strictly rising; 0: not in force yet
    stamp: float = 0.0  # [s] when it was given
    keep_tasks: bool = True  # of PAUSE: its tasks wait for the UAV

    @property
    def id(self) -> str:
        """Its id for operators."""
        return f'o{self.number}'

    @property
    def content(self) -> tuple[object, ...]:
        """What it says, whoever gave it."""
        return self.kind, self.uav, self.tasks, self.keep_tasks

    @property
    def text(self) -> str:
        """What it says, in words."""
        tasks = first_of(self.tasks, separator=' ')
        return {OrderKind.PIN: f'pin {tasks} to {self.uav}',
                OrderKind.FORBID: f'forbid {tasks} to {self.uav}',
                OrderKind.SEQUENCE: f'order {self.uav}: {tasks}',
                OrderKind.PAUSE: f'pause {self.uav}' + (
                    '' if self.keep_tasks else ' without its tasks'),
                OrderKind.RETURN: f'return {self.uav}'}[self.kind]

    @property
    def name(self) -> str:
        """Its id, and who gave it."""
        return f'order {self.id} of {self.operator}'


@dataclass(frozen=True, slots=True)
class OrderLogEntry:
    """One line of the log of orders: who changed what, and when."""

    number: int  # strictly rising; that of the order which it begins
    stamp: float  # [s]
    operator: str  # '' where no operator did it
    action: str  # what was done
    before: str  # what held before
    after: str  # what holds since

    @property
    def text(self) -> str:
        """One line."""
        return f'{self.action}; before: {self.before}; after: {self.after}'


@dataclass(frozen=True, slots=True)
class OperatorHold:
    """Whether a UAV is to hold, as it is published."""

    uav: str  # id
    hold: bool  # or go on
    stamp: float  # [s] when that was decided
    reason: str  # for users


@dataclass(slots=True)
class OrderRows:
    """What the journal has of orders."""

    orders: list[Order] = field(default_factory=list)  # in force
    log: list[OrderLogEntry] = field(default_factory=list)  # in order
    holds: list[OperatorHold] = field(default_factory=list)  # one a UAV, as published last
