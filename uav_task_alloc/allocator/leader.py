# SPDX-License-Identifier: Apache-2.0
"""Leader election among the allocators of one fleet: one publishes, the others are passive.

No clock, no I/O: `now` is [s] of a steady clock. Each allocator publishes its instance and role
every second. A passive one stays so until it is restarted: the tasks that the leader accepted are
in the leader's journal, not in its own.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from enum import Enum

from uav_task_alloc.errors import InvalidValue

DISCOVERY = 1.5  # [s] from the start until other nodes are discovered
RESTART_DISCOVERY = 0.3  # [s] the same after a restart, when UAVs wait for their lists
STATUS_WAIT = 3.0  # [s] for the status of another publisher of `allocation`; one comes a second
LEADER_TIMEOUT = 5.0  # [s] after the last status of a leader, which may have ended
_MAX_TEXT = 200  # characters of an instance id, and of a node name


class Role(Enum):
    """Role of an allocator in its fleet."""

    STARTING = 'starting'  # it waits for others, and publishes nothing yet
    RESTARTING = 'restarting'  # it publishes, with the lists of its previous run, and waits
    LEADING = 'leading'
    PASSIVE = 'passive'  # another one leads; no inputs or outputs until a restart


_RANKS = {Role.PASSIVE: 0, Role.STARTING: 1, Role.RESTARTING: 2, Role.LEADING: 3}


@dataclass(frozen=True, slots=True, order=True)
class AllocatorInstance:
    """One run of an allocator; the smallest leads: the earliest start, then the smallest id."""

    started: int  # [ns] of the computer's clock, not of simulated time
    id: str  # random, of the run
    node: str = field(compare=False)  # full name, for texts

    @property
    def text(self) -> str:
        """Node, id and start, for the log."""
        start = datetime.fromtimestamp(self.started * 1e-9, timezone.utc)
        return (f'{self.node} (instance {self.id}, started '
                f'{start.isoformat(timespec="seconds")})')


class Leader:
    """Decides the role of `me` from the status of the others.

    `reason`: why it is passive. `silent_others`: it leads though others publish without a status.

    Args:
        me: this run.
        now: [s].
        restarted: it has the lists of a previous run.

    Arguments of methods:
        other: instance of another allocator.
        role: that it reports.
        reason: text for an operator.
        now: [s] steady clock.
    """

    def __init__(self, me: AllocatorInstance, now: float, restarted: bool = False) -> None:
        self.me, self.role, self.reason = me, Role.STARTING, ''
        self.silent_others = False
        self._waits = True  # for the status of others
        self._earliest = now + (RESTART_DISCOVERY if restarted else DISCOVERY)
        self._discovered, self._latest = now + DISCOVERY, now + STATUS_WAIT
        self._leader_seen = now  # [s] last status of the leader, once passive

    @property
    def reported(self) -> Role:
        """Its role for the others: it leads once it has waited for their status."""
        return Role.RESTARTING if self.role is Role.LEADING and self._waits else self.role

    def update(self, other: AllocatorInstance, role: Role, now: float) -> None:
        """Apply the status of another allocator of this fleet."""
        if other.id == self.me.id or role is Role.PASSIVE:
            return
        if self.role is Role.PASSIVE:
            self._leader_seen = self._leader_seen if role is Role.STARTING else now
        elif self._yields(other, role):
            self.refuse(f'another allocator leads this fleet: {other.text}', now)

    def _yields(self, other: AllocatorInstance, role: Role) -> bool:
        """Whether the other one leads: the present leader, else the smaller instance.

        Clocks of computers may differ: a leader never yields to one that has just started.
        """
        mine, others = _RANKS[self.reported], _RANKS[role]
        return others > mine if others != mine else other < self.me

    def refuse(self, reason: str, now: float) -> None:
        """Become passive for a reason."""
        self.role, self.reason, self._leader_seen = Role.PASSIVE, reason, now

    def tick(self, others: int, now: float, foreign: bool = False) -> None:
        """Become the leader if there is no other one.

        Args:
            others: number of other publishers of `allocation`.
            now: [s].
            foreign: a UAV has a list that this allocator did not publish, so that there may be
                another allocator.
        """
        if self.role is Role.LEADING and foreign and now < self._discovered:
            self.role = Role.STARTING
        alone = others <= 0 or now >= self._latest
        if self.role is Role.STARTING and alone and now >= (
                self._discovered if foreign else self._earliest):
            self.role, self.silent_others = Role.LEADING, others > 0
        if self.role is Role.LEADING and self._waits and alone and now >= self._discovered:
            self._waits, self.silent_others = False, others > 0

    def error(self, now: float) -> str:
        """Return why it is passive, for an operator; '' if it is not."""
        if self.role is not Role.PASSIVE:
            return ''
        silence = now - self._leader_seen
        end = f'; no status of it for {silence:.0f} s' if silence >= LEADER_TIMEOUT else ''
        return f'passive: {self.reason}; this one publishes nothing until it is restarted{end}'


def status_values(me: AllocatorInstance, role: Role, topic: str) -> dict[str, object]:
    """Return what the other allocators of the fleet have to know, for a row of /diagnostics.

    Args:
        me: this instance.
        role: leading or passive.
        topic: full name of `allocation`.

    Returns:
        Values by key; `started` in ns.
    """
    return {'allocation topic': topic, 'instance': me.id, 'started': me.started,
            'role': role.value}


def parse_status(node: str, values: Mapping[str, str],
                 topic: str) -> tuple[AllocatorInstance, Role] | None:
    """Parse the `status_values` of an allocator.

    Args:
        node: its full name.
        values: of its status.
        topic: full name of the own `allocation`.

    Returns:
        Its instance and role; None for the status of another node, or of another fleet.

    Raises:
        InvalidValue: a value is not one that an allocator sends.
    """
    if values.get('allocation topic') != topic:
        return None
    id, started = values.get('instance', ''), values.get('started', '')
    if not id or len(id) > _MAX_TEXT:
        raise InvalidValue('instance', id, f'1 to {_MAX_TEXT} characters')
    if not (started.isascii() and started.isdecimal() and len(started) <= 20):
        raise InvalidValue('started', started, 'a time [ns]')
    try:
        role = Role(values.get('role', ''))
    except ValueError:
        raise InvalidValue('role', values.get('role', ''),
                           f'one of {", ".join(role.value for role in Role)}') from None
    return AllocatorInstance(int(started), id, node[:_MAX_TEXT]), role
