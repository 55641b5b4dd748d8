# SPDX-License-Identifier: Apache-2.0
"""Who has the aircraft: one table, event by state, and the machine that follows it; no I/O.

Nothing is sent to a vehicle but through `Authority.allows`. docs/mavlink.md is drawn from `TABLE`.
"""
from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple


class AuthorityState(Enum):
    """Who has the aircraft; numbers as in UavState.authority."""

    UNKNOWN = 0
    NONE = 1
    HELD = 2
    SUSPENDED = 3
    LOST = 4


class SendAction(Enum):
    """What the bridge may send to a vehicle."""

    READ = 'read the mission, ask message rates'
    UPLOAD = 'upload a mission'
    COMMAND = 'set a mode or the current item, arm, take off'


class Suspension(Enum):
    """What suspends authority, each until the event that ends it."""

    LINK = 'the link is stale, or its address is new'
    AVOID = 'the vehicle avoids traffic'
    FAILSAFE = 'a failsafe is active'
    FOREIGN = 'somebody else changed the mission'
    DOUBT = 'the mode has changed, and REACHED may explain it'
    RESTART = 'the bridge was restarted'


class AuthorityEvent(Enum):
    """What happens to a vehicle as far as authority is concerned; the value names the row."""

    GRANTED = '`takeoff` true, on the ground, past boot'
    WITHDRAWN_IN_AIR = '`takeoff` becomes false in the air'
    WITHDRAWN = '`takeoff` becomes false on the ground'
    OWN = 'our own mode change and its consequence'
    OWN_LANDING = 'landing after our RETURN, LAND or the RETURN item; NONE unless `relaunch` is ' \
        'automatic'
    MISSION_ENDED = 'MISSION -> HOLD (PX4) with REACHED of the last item seen, or our upload ' \
        'called infeasible'
    UNEXPLAINED = 'MISSION -> HOLD or RETURN (PX4) at the last item, REACHED not seen for up ' \
        'to 5 s'
    EXPLAINED = 'REACHED explains it after all'
    TAKEN = 'any other MISSION -> HOLD; to STICK; to OWN'
    AVOIDING = 'AVOID_ADSB'
    AVOIDED = 'AVOID_ADSB -> MISSION'
    STICK_TO_HOLD = 'STICK -> HOLD in flight, at rest, system ACTIVE, unchanged for 6 s'
    TO_MISSION = 'any -> MISSION in flight, not by us, no failsafe'
    FAILSAFE_MODE = 'RC, GCS, battery, EKF failsafe or fence breach that changes the mode'
    FAILSAFE_STAYS = 'the same while the mode stays (system CRITICAL)'
    FAILSAFE_OVER = 'the same is cleared'
    SWAP_TAKEN = 'failsafe or pilot in the middle of our swap; the transfer ends'
    ARMED_BY_OTHER = 'arm or disarm not by us, DISARM_DELAY'
    KILLED = 'emergency stop, kill, flight termination; LOST until `~/hand_over` on the ground, ' \
        'disarmed'
    LINK_STALE = 'link stale'
    LINK_BACK = 'link back, mode unchanged'
    LINK_CHANGED = 'link back, mode changed'
    NEW_ADDRESS = 'new address, until the mode is confirmed'
    REBOOTED = 'reboot of the vehicle, never armed since the grant'
    REBOOTED_FLOWN = 'reboot of the vehicle, armed since the grant'
    RESTART_AGREES = 'restart of the bridge, its file agrees (own swap under way: < 60 s, at rest)'
    RESTART_DIFFERS = 'restart of the bridge, its file does not agree'
    RESTART_OURS = 'restart without a file: airborne in MISSION with our mission'
    RESTART_AIRBORNE = 'restart without a file: otherwise airborne'
    FOREIGN = 'FOREIGN mission with `when_foreign: yield`'
    FOREIGN_OVER = 'our mission is on board again'
    HAND_OVER = '`~/hand_over` (refused: stale, failsafe, low battery, FOREIGN, on the ground ' \
        'without `takeoff`)'


@dataclass(frozen=True, slots=True)
class AuthorityRow:
    """What one event makes of each state; None: the state stays."""

    held: AuthorityState | None
    suspended: AuthorityState | None
    lost: AuthorityState | None
    none: AuthorityState | None
    note: str = ''  # what else it means, for the drawn table

    def next_state(self, state: AuthorityState) -> AuthorityState | None:
        return {
            AuthorityState.HELD: self.held,
            AuthorityState.SUSPENDED: self.suspended,
            AuthorityState.LOST: self.lost,
            AuthorityState.NONE: self.none,
        }[state]


_N, _H, _S, _L = (
    AuthorityState.NONE,
    AuthorityState.HELD,
    AuthorityState.SUSPENDED,
    AuthorityState.LOST,
)
E = AuthorityEvent
AUTHORITY_TABLE: dict[AuthorityEvent, AuthorityRow] = {
    E.GRANTED: AuthorityRow(
        _H, None, None, _H, 'toggling the parameter gives nothing back that was lost'
    ),
    E.WITHDRAWN_IN_AIR: AuthorityRow(_H, None, None, None, 'HELD until the landing'),
    E.WITHDRAWN: AuthorityRow(_N, None, None, None, 'a pending arming is dropped'),
    E.OWN: AuthorityRow(_H, _L, None, None),
    E.OWN_LANDING: AuthorityRow(_N, _L, None, None),
    E.MISSION_ENDED: AuthorityRow(_H, _L, None, None),
    E.UNEXPLAINED: AuthorityRow(_S, _L, None, None),
    E.EXPLAINED: AuthorityRow(_H, _H, None, None),
    E.TAKEN: AuthorityRow(_L, _L, _L, _L),
    E.AVOIDING: AuthorityRow(_S, _S, None, None),
    E.AVOIDED: AuthorityRow(_H, _H, None, None),
    E.STICK_TO_HOLD: AuthorityRow(None, _L, _H, _H, 'a hand-over'),
    E.TO_MISSION: AuthorityRow(_H, _H, _H, _H, 'hold first unless our list is VERIFIED'),
    E.FAILSAFE_MODE: AuthorityRow(_L, _L, None, None),
    E.FAILSAFE_STAYS: AuthorityRow(_S, _S, None, None),
    E.FAILSAFE_OVER: AuthorityRow(_H, _H, None, None),
    E.SWAP_TAKEN: AuthorityRow(_L, _L, None, None),
    E.ARMED_BY_OTHER: AuthorityRow(_L, _L, None, None),
    E.KILLED: AuthorityRow(_L, _L, _L, _L),
    E.LINK_STALE: AuthorityRow(_S, _S, None, None),
    E.LINK_BACK: AuthorityRow(_H, _H, None, None),
    E.LINK_CHANGED: AuthorityRow(_L, _L, None, None),
    E.NEW_ADDRESS: AuthorityRow(_S, _S, None, None),
    E.REBOOTED: AuthorityRow(_H, None, None, None),
    E.REBOOTED_FLOWN: AuthorityRow(_L, _L, None, None),
    E.RESTART_AGREES: AuthorityRow(_H, _H, None, None, 'SUSPENDED as the link'),
    E.RESTART_DIFFERS: AuthorityRow(_L, _L, None, None),
    E.RESTART_OURS: AuthorityRow(_H, None, _H, _H),
    E.RESTART_AIRBORNE: AuthorityRow(_L, _L, _L, _L),
    E.FOREIGN: AuthorityRow(_S, _S, None, None),
    E.FOREIGN_OVER: AuthorityRow(_H, _H, None, None),
    E.HAND_OVER: AuthorityRow(_H, None, _H, _H, 'hold first; refused while SUSPENDED'),
}
PERMISSIONS = {
    AuthorityState.NONE: (
        'never granted, or landed',
        frozenset({SendAction.READ, SendAction.UPLOAD}),
    ),
    AuthorityState.HELD: ('the bridge has it', frozenset(SendAction)),
    AuthorityState.SUSPENDED: (
        'for a while; a pending command is dropped',
        frozenset[SendAction](),
    ),
    AuthorityState.LOST: (
        'somebody else has it; not available, so its tasks move on',
        frozenset({SendAction.READ}),
    ),
}
_SUSPENDS = {E.AVOIDING: Suspension.AVOID, E.FAILSAFE_STAYS: Suspension.FAILSAFE,
             E.LINK_STALE: Suspension.LINK, E.NEW_ADDRESS: Suspension.LINK,
             E.FOREIGN: Suspension.FOREIGN, E.UNEXPLAINED: Suspension.DOUBT}
_ENDS = {E.AVOIDED: Suspension.AVOID, E.FAILSAFE_OVER: Suspension.FAILSAFE,
         E.LINK_BACK: Suspension.LINK, E.FOREIGN_OVER: Suspension.FOREIGN,
         E.EXPLAINED: Suspension.DOUBT, E.RESTART_AGREES: Suspension.RESTART}
_GIVES_BACK = {
    Suspension.LINK: 'the link, with the mode unchanged',
    Suspension.AVOID: 'the vehicle, back in MISSION mode',
    Suspension.FAILSAFE: 'the end of the failsafe',
    Suspension.FOREIGN: 'our mission on board, or when_foreign: reassert',
    Suspension.DOUBT: 'what explains the change of mode',
    Suspension.RESTART: 'a heartbeat with the mode unchanged'}
_UNLOCKS = (E.HAND_OVER,)  # gives back what a kill took; nothing else does


class HoldStage(Enum):
    """Whether the vehicle is held before anything else is done with it."""

    NO = 'no'
    UNLESS_VERIFIED = 'unless our list is verified on board'
    FIRST = 'first'


class TaskMark(NamedTuple):
    """What a restarted bridge cannot see of a task: that it was flown, or passed over."""

    task: str
    x: float  # [m] ENU of the task
    y: float
    z: float
    at: float  # steady time [s]
    flown: bool  # False: somebody has set the current item beyond it


@dataclass(frozen=True, slots=True)
class AuthorityRecord:
    """What a restarted bridge has to know; times are steady [s]."""

    state: AuthorityState = AuthorityState.NONE
    why: str = 'never granted'
    since: float = 0.0
    killed: bool = False
    landed: bool = False  # NONE after a landing of ours: `takeoff` alone grants nothing
    until_landing: bool = False  # `takeoff` became false in the air
    flown: bool = False  # armed since the grant
    mode: int | None = None  # HEARTBEAT.custom_mode seen last
    armed: bool = False
    commanded: tuple[int, ...] = ()  # custom modes sent and not seen yet
    arming: bool = False
    swap_at: float | None = None  # since when it is held for an upload
    climb: float | None = None  # [m] above home, of a take-off under way
    marks: tuple[TaskMark, ...] = ()  # of the last tasks
    mission: int | None = None  # checksum of the items on board
    current: int | None = None  # the item of it that was flown, home not counted


class Authority:
    """The state of one vehicle; `apply` follows `TABLE`."""

    def __init__(self, now: float, record: AuthorityRecord | None = None) -> None:
        record = record or AuthorityRecord(since=now)
        self.state, self.why, self.since = record.state, record.why, record.since
        self.killed, self.landed = record.killed, record.landed
        self.until_landing = record.until_landing
        self.hold = HoldStage.NO
        self.suspensions: dict[Suspension, str] = {}
        if self.state in (
            AuthorityState.HELD,
            AuthorityState.SUSPENDED,
        ):  # until the vehicle is seen to agree
            self.state = AuthorityState.SUSPENDED
            self.suspensions[Suspension.RESTART] = 'the bridge was restarted'
        self.undecided = False  # a restarted bridge that does not know yet whether it flies

    def allows(self, action: SendAction) -> bool:
        """Whether this may be sent now."""
        if self.undecided or set(self.suspensions) == {Suspension.FOREIGN}:
            return action is SendAction.READ  # else nobody would see a foreign mission end
        return self.state in PERMISSIONS and action in PERMISSIONS[self.state][1]

    @property
    def held(self) -> bool:
        return self.state is AuthorityState.HELD and not self.undecided

    def suspended_by(self, suspension: Suspension) -> bool:
        return suspension in self.suspensions

    def apply(self, event: AuthorityEvent, now: float, why: str = '') -> bool:
        """Follow the table.

        Args:
            event: what happened.
            now: steady time [s].
            why: in words, for people; empty: the row of the table.

        Returns:
            Whether the state or its cause has changed.
        """
        target = AUTHORITY_TABLE[event].next_state(self.state)
        if target is None or (
            self.killed and target is AuthorityState.HELD and event not in _UNLOCKS
        ):
            return False
        why = why or event.value
        if event in _SUSPENDS:
            self.suspensions[_SUSPENDS[event]] = why
        elif self.state is AuthorityState.SUSPENDED and target is AuthorityState.HELD:
            target = self._resumes(event)
        if event is E.KILLED and not self.killed:
            self.killed = True
            self._enter(target, event, now, why)
            self.why = why
            return True
        return self._enter(target, event, now, why)

    def _resumes(self, event: AuthorityEvent) -> AuthorityState:
        if event in _ENDS:
            self.suspensions.pop(_ENDS[event], None)
        elif event is E.TO_MISSION:
            self.suspensions = {cause: why for cause, why in self.suspensions.items()
                                if cause is Suspension.FOREIGN}
        else:
            self.suspensions.clear()
        return AuthorityState.SUSPENDED if self.suspensions else AuthorityState.HELD

    def _enter(self, target: AuthorityState, event: AuthorityEvent, now: float, why: str) -> bool:
        before = self.state
        if target is not AuthorityState.SUSPENDED:
            self.suspensions.clear()
        if target is AuthorityState.HELD and event in (E.HAND_OVER, E.STICK_TO_HOLD):
            self.hold = HoldStage.FIRST
        elif target is AuthorityState.HELD and event is E.TO_MISSION:
            self.hold = HoldStage.UNLESS_VERIFIED
        elif target is not AuthorityState.HELD:
            self.hold = HoldStage.NO if target is not AuthorityState.SUSPENDED else self.hold
        if target is AuthorityState.HELD:
            self.killed = False
        if event is E.WITHDRAWN_IN_AIR:
            self.until_landing = True
        elif not {before, target} <= {AuthorityState.HELD, AuthorityState.SUSPENDED}:
            self.until_landing = False
        self.landed = target is AuthorityState.NONE and (event is E.OWN_LANDING or self.landed)
        self.state = target
        if target is before and target in (
            AuthorityState.HELD,
            AuthorityState.LOST,
            AuthorityState.NONE,
        ):
            return False
        self.why = '; '.join(self.suspensions.values()) or why
        self.since = now if target is not before else self.since
        return True

    @property
    def given_back_by(self) -> str:
        """What would give the aircraft to the bridge, in words; '' where it has it."""
        if self.state is AuthorityState.LOST:
            if self.killed:
                return '~/hand_over, on the ground and disarmed'
            return ('MISSION mode set in flight, a change from a stick mode to HOLD at rest for '
                    '6 s, or ~/hand_over')
        if self.state is AuthorityState.NONE:
            return '~/hand_over' if self.landed else (
                'takeoff: true on the ground, MISSION mode set in flight, or ~/hand_over')
        return ' and '.join(_GIVES_BACK[cause] for cause in self.suspensions)


def table_text() -> str:
    """The two tables as Markdown, for docs/mavlink.md."""
    lines = ['| state | what it means | what the bridge may send |', '|---|---|---|']
    for state, (meaning, actions) in PERMISSIONS.items():
        sent = '; '.join(a.value for a in SendAction if a in actions) or 'nothing'
        lines.append(f'| {state.name} | {meaning} | {sent} |')
    lines += ['', '| event | HELD | SUSPENDED | LOST | NONE | |', '|---|---|---|---|---|---|']
    for event, row in AUTHORITY_TABLE.items():
        cells = (row.held, row.suspended, row.lost, row.none)
        names = ' | '.join('same' if cell is None else cell.name for cell in cells)
        lines.append(f'| {event.value} | {names} | {row.note} |')
    return '\n'.join(lines) + '\n'
