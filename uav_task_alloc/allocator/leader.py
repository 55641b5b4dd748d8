# SPDX-License-Identifier: Apache-2.0
"""Which of several allocators of one fleet leads: one publishes, the others say that they do not.

No clock, no I/O: `now` is [s] of a steady clock. Each allocator tells all others its instance and
role every second. One that has stepped down stays passive until it is restarted: the tasks that
the leader accepted are in the leader's journal, not in this one's.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from enum import Enum

from uav_task_alloc.errors import InvalidValue

LISTEN = 1.5  # [s] from the start until other nodes are discovered
SETTLE = 0.3  # [s] the same after a restart, which must not keep the UAVs waiting
WAIT = 3.0  # [s] for a word of another publisher of `allocation`; allocators speak every second
GONE = 5.0  # [s] after the last word of a leader it may be gone
_LONGEST = 200  # characters of what another allocator tells of itself


class Role(Enum):
    """What an allocator does for its fleet."""

    STARTING = 'starting'  # it looks for others, and publishes nothing yet
    LEADING = 'leading'
    PASSIVE = 'passive'  # another one leads; it publishes and hears nothing until a restart


@dataclass(frozen=True, slots=True, order=True)
class AllocatorInstance:
    """One run of an allocator; the lesser leads: the earlier start, then the lesser id."""

    started: int  # [ns] of the computer's clock, not of simulated time
    id: str
    node: str = field(compare=False)

    @property
    def text(self) -> str:
        """Node, id and start, for people."""
        start = datetime.fromtimestamp(self.started * 1e-9, timezone.utc)
        return (f'{self.node} (instance {self.id}, started '
                f'{start.isoformat(timespec="seconds")})')


class Leader:
    """Decides the role of `me` from what the others say. `reason`: why it is passive."""

    def __init__(self, me: AllocatorInstance, now: float, restarted: bool = False) -> None:
        """restarted: it has the lists of an earlier life."""
        self.me, self.role, self.reason = me, Role.STARTING, ''
        self.silent_others = False  # it leads though others publish that say nothing
        self._settled = now + (SETTLE if restarted else LISTEN)
        self._listened, self._until = now + LISTEN, now + WAIT
        self._heard = now  # [s] last word of a leader, once passive

    def hear(self, other: AllocatorInstance, role: Role, now: float) -> None:
        """Another allocator of this fleet says who it is, and what it does."""
        if other.id == self.me.id or role is Role.PASSIVE:
            return
        if self.role is Role.PASSIVE:
            self._heard = now if role is Role.LEADING else self._heard
        elif self._yields(other, role):
            self.refuse(f'another allocator leads this fleet: {other.text}', now)

    def _yields(self, other: AllocatorInstance, role: Role) -> bool:
        """Whoever leads already stays; among equals the earlier start leads."""
        if self.role is not role:
            return role is Role.LEADING
        return other < self.me

    def refuse(self, reason: str, now: float) -> None:
        """It is passive from now on."""
        self.role, self.reason, self._heard = Role.PASSIVE, reason, now

    def tick(self, others: int, now: float, strange: bool = False) -> None:
        """It leads when nobody else does.

        others: number of other publishers of `allocation`. strange: a UAV has a list that this
        allocator did not publish, so there may be another one.
        """
        if self.role is Role.LEADING and strange and now < self._listened:
            self.role = Role.STARTING
        if self.role is not Role.STARTING or now < (self._listened if strange else self._settled):
            return
        if others <= 0 or now >= self._until:
            self.role, self.silent_others = Role.LEADING, others > 0

    def trouble(self, now: float) -> str:
        """What an operator has to know; '' while it leads."""
        if self.role is not Role.PASSIVE:
            return ''
        gone = now - self._heard
        end = f'; that one was not heard for {gone:.0f} s' if gone >= GONE else ''
        return f'passive: {self.reason}; this one publishes nothing until it is restarted{end}'


def told(me: AllocatorInstance, role: Role, topic: str) -> dict[str, object]:
    """What the others have to know, as words. topic: the full name of `allocation`."""
    return {'allocation topic': topic, 'instance': me.id, 'started': me.started,
            'role': role.value}


def heard(
    node: str, values: Mapping[str, str], topic: str
) -> tuple[AllocatorInstance, Role] | None:
    """The reverse of `told`; None where it is of no allocator, or of another fleet.

    Raises InvalidValue, as the words may be anybody's.
    """
    if values.get('allocation topic') != topic:
        return None
    id, started = values.get('instance', ''), values.get('started', '')
    if not id or len(id) > _LONGEST:
        raise InvalidValue('instance', id, f'1 to {_LONGEST} characters')
    if not (started.isascii() and started.isdecimal() and len(started) <= 20):
        raise InvalidValue('started', started, 'a time [ns]')
    try:
        role = Role(values.get('role', ''))
    except ValueError:
        raise InvalidValue('role', values.get('role', ''),
                           f'one of {", ".join(role.value for role in Role)}') from None
    return AllocatorInstance(int(started), id, node[:_LONGEST]), role
