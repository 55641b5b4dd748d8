# SPDX-License-Identifier: Apache-2.0
"""Keeps UAVs in flight apart: predicts the next 30 s, and decides who holds for whom; no I/O.

Who keeps its way is said by `MonitoredUav.claim`. Of two the one with the lesser claim holds; the
other one where that does not keep them apart. Nobody waits for a UAV that waits for it. Where
neither way helps, both stop as a last resort, which is said as UNRESOLVED; the first whose way is
free goes on.
"""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from uav_task_alloc.separation.prediction import FlightPredictions, PredictedLoss, Way
from uav_task_alloc.separation.rule import Separation

LONGEST_HOLD = 60.0  # [s] of a hold that is not renewed
_RENEWED_AFTER = 20.0  # [s]
_ACT = 12.0  # [s] before a loss within which somebody holds: it stops in about 7 s
_CLEAR = 20.0  # [s] for which the way of a UAV that holds has to be free
_ASK_AGAIN = 10.0  # [s] between two plans that are asked for because of one pair
_CALM = 2.0  # [s] without the prediction of a loss after which it is over
UavPair = tuple[str, str]  # ids in alphabetical order


class AlertAction(Enum):
    """What is done about two UAVs; the numbers are those of the message."""

    NONE = 0
    HOLD = 1
    RELEASE = 2
    UNRESOLVED = 3


@dataclass(frozen=True, slots=True)
class MonitoredUav:
    """A UAV in the air, or one that is about to take off."""

    way: Way  # what it does next
    claim: tuple[float, ...] = ()  # of two the one with the greater claim keeps its way
    may_hold: bool = True  # it obeys a hold, and none else is in force
    why_not: str = ''  # why it may not
    if_need_be: bool = False  # though it may not, it obeys one where nobody else can hold
    early: bool = False  # it holds as soon as a loss is predicted: later it cannot, or may not
    stays: str = ''  # why it does not move, whoever waits for it; '': it does


@dataclass(frozen=True, slots=True)
class SeparationAlert:
    """Two UAVs that would lose separation, and what is done about it.

    Attributes:
        uavs: ids, in alphabetical order.
        action: what is done.
    """

    uavs: UavPair
    horizontal: float  # [m] when they are nearest, as predicted
    vertical: float  # [m] then
    until: float  # [s] until separation is lost; 0: it is lost, or nothing is predicted
    action: AlertAction
    holder: str  # id; '': none
    reason: str  # for users
    stamp: float  # [s]

    @property
    def text(self) -> str:
        """One line: who, how near, what is done."""
        if self.action is AlertAction.RELEASE:
            return f'{self.holder} goes on: {self.reason}'
        if not self.horizontal < math.inf:
            return f'{" and ".join(self.uavs)}: {self.reason}'
        when = f'in {self.until:.0f} s' if self.until > 0.0 else 'now'
        return (f'{" and ".join(self.uavs)} would be {self.horizontal:.0f} m apart horizontally, '
                f'{self.vertical:.0f} m vertically {when}: {self.reason}')


@dataclass(frozen=True, slots=True)
class SeparationHold:
    """Whether a UAV is to hold, as it is published."""

    uav: str  # id
    hold: bool  # or go on
    stamp: float  # [s] when that was decided
    expires: float  # [s] the hold ends then
    reason: str  # for users


@dataclass(slots=True)
class _Hold:
    """A hold in force."""

    waits_for: set[str]  # ids
    renewed: float  # [s] stamp
    reason: str


@dataclass(slots=True)
class MonitorStep:
    """What a step has decided."""

    holds: list[SeparationHold] = field(default_factory=list)  # to publish
    alerts: list[SeparationAlert] = field(default_factory=list)  # to publish
    unresolved: list[UavPair] = field(default_factory=list)  # a plan may help, asked again


@dataclass(slots=True)
class _Alerted:
    """The alert of a pair that was published last."""

    alert: SeparationAlert
    seen: float  # [s] stamp of the last prediction


class SeparationMonitor:
    """Decides which UAVs hold, step by step; time and states are arguments."""

    def __init__(self) -> None:
        self._holds: dict[str, _Hold] = {}
        self._alerts: dict[UavPair, _Alerted] = {}
        self._asked: dict[UavPair, float] = {}  # [s] stamp of the last plan asked for
        self._step = MonitorStep()
        self._stamp = 0.0

    @property
    def holding(self) -> Mapping[str, str]:
        """Why each UAV holds, by id."""
        return {uav_id: hold.reason for uav_id, hold in self._holds.items()}

    @property
    def waits(self) -> Mapping[str, frozenset[str]]:
        """Ids of the UAVs that each one that holds waits for, by its id."""
        return {uav_id: frozenset(hold.waits_for) for uav_id, hold in self._holds.items()}

    @property
    def stuck(self) -> frozenset[str]:
        """Ids of UAVs that hold for one that holds for them: only other lists let them go on."""
        return frozenset(name for name, hold in self._holds.items() if any(
            name in self._holds[other].waits_for for other in hold.waits_for & {*self._holds}))

    @property
    def alerts(self) -> Mapping[UavPair, SeparationAlert]:
        """What is predicted now, by pair."""
        return {pair: each.alert for pair, each in self._alerts.items()}

    def step(self, stamp: float, uavs: Mapping[str, MonitoredUav], rule: Separation
             ) -> MonitorStep:
        """Predict, and decide; call it about twice a second.

        Args:
            stamp: published clock [s].
            uavs: all that are in the air or about to take off, by id.
            rule: that is kept; off: all holds end.

        Returns:
            What changed since the step before.
        """
        self._stamp, self._step = stamp, MonitorStep()
        if not rule.on:
            uavs = {}
        for uav_id in [name for name in self._holds
                       if name not in uavs or not (
                           uavs[name].may_hold or uavs[name].if_need_be)]:
            self._release(uav_id, uavs[uav_id].why_not if uav_id in uavs else 'it is not in '
                          'flight any more')
        predicted = FlightPredictions({name: each.way for name, each in uavs.items()}, rule,
                                frozenset(self._holds))
        self._release_free(uavs, predicted)
        losses = predicted.losses()
        for pair, loss in sorted(losses.items(), key=lambda row: (row[1].begins, row[0])):
            self._decide(pair, loss, uavs, predicted)
        lost = predicted.lost_now()
        for pair, loss in lost.items():
            if pair not in losses and not any(name in self._holds for name in pair):
                self._publish(pair, loss, AlertAction.NONE, '', 'they do not come nearer')
        self._end_alerts(stamp, {*losses, *lost})
        self._renew()
        return self._step

    # who goes on

    def _release_free(self, uavs: Mapping[str, MonitoredUav],
                      predicted: FlightPredictions) -> None:
        """Let those go on whose way is free, those with the greater claim first."""
        for uav_id in sorted(self._holds, key=lambda name: (uavs[name].claim, name),
                             reverse=True):
            blocked = predicted.losses_of(uav_id, holds=False, wide=True)
            ahead = {other for other, loss in blocked.items()
                     if loss.begins < _CLEAR or uavs[uav_id].early or uavs[other].early}
            if not ahead:
                self._release(uav_id, 'its way is free')
                predicted.set_holding(uav_id, False)
            else:
                self._holds[uav_id].waits_for = ahead

    def _release(self, uav_id: str, why: str) -> None:
        hold = self._holds.pop(uav_id)
        self._step.holds.append(SeparationHold(uav_id, False, self._stamp, self._stamp, why))
        for pair, each in self._alerts.items():
            if each.alert.holder == uav_id and each.alert.action is not AlertAction.NONE:
                other = pair[0] if pair[1] == uav_id else pair[1]
                reason = f'{why} ({hold.reason})' if other not in hold.reason else why
                self._publish(pair, PredictedLoss(0.0, math.inf, math.inf), AlertAction.RELEASE,
                              uav_id, reason)

    # who holds

    def _decide(self, pair: UavPair, loss: PredictedLoss, uavs: Mapping[str, MonitoredUav],
                predicted: FlightPredictions) -> None:
        """Decide who of a pair holds, if it is time."""
        holders = [name for name in pair if name in self._holds]
        early = any(uavs[name].early and uavs[name].may_hold for name in pair)
        if loss.begins > _ACT and not holders and not early:
            self._publish(pair, loss, AlertAction.NONE, '', 'there is time')
            return
        current = predicted.loss(*pair)  # holds of this step count
        if current is None:
            return
        lesser, greater = sorted(pair, key=lambda name: (uavs[name].claim, name))
        for uav_id, other, need in ((lesser, greater, False), (greater, lesser, False),
                                    (lesser, greater, True), (greater, lesser, True)):
            if need and loss.begins > _ACT:
                continue
            if self._may_hold(uav_id, other, uavs, need) and predicted.helps(uav_id, other):
                self._hold(uav_id, other, pair, current, predicted, uavs[other].stays)
                return
        self._last_resort(pair, current, uavs, predicted, lesser)

    def _may_hold(self, uav_id: str, other: str, uavs: Mapping[str, MonitoredUav],
                  need: bool) -> bool:
        return ((uavs[uav_id].if_need_be if need else uavs[uav_id].may_hold)
                and uav_id not in self._holds
                and not self._waits(other, uav_id))

    def _waits(self, uav_id: str, for_uav: str, seen: frozenset[str] = frozenset()) -> bool:
        """Whether a UAV waits for another one, or for one that does."""
        if uav_id == for_uav:
            return True
        if uav_id in seen or uav_id not in self._holds:
            return False
        return any(self._waits(other, for_uav, seen | {uav_id})
                   for other in self._holds[uav_id].waits_for)

    def _hold(self, uav_id: str, other: str, pair: UavPair, loss: PredictedLoss,
              predicted: FlightPredictions, stays: str) -> None:
        reason = ', which '.join(filter(None, (f'{uav_id} holds for {other}', stays)))
        self._begin(uav_id, other, reason)
        predicted.set_holding(uav_id, True)
        self._publish(pair, loss, AlertAction.HOLD, uav_id, reason)

    def _begin(self, uav_id: str, other: str, reason: str) -> None:
        self._holds[uav_id] = _Hold({other}, self._stamp, reason)
        self._step.holds.append(SeparationHold(
            uav_id, True, self._stamp, self._stamp + LONGEST_HOLD, reason))

    def _last_resort(self, pair: UavPair, loss: PredictedLoss, uavs: Mapping[str, MonitoredUav],
                     predicted: FlightPredictions, lesser: str) -> None:
        """Stop whoever can be stopped where a loss is near; say that it is not resolved."""
        known = self._alerts.get(pair)
        stops = [name for name in pair if uavs[name].may_hold]
        nearer = [name for name in stops if name not in self._holds
                  and loss.begins <= _ACT and predicted.delays(pair, stops)]
        for name in nearer:
            other = pair[0] if pair[1] == name else pair[1]
            self._begin(name, other, f'{name} stops: no way past {other} is free')
            predicted.set_holding(name, True)
        why = ', '.join(uavs[name].why_not for name in pair if uavs[name].why_not)
        stopped = [name for name in stops if name in self._holds]
        text = f'{" and ".join(stopped)} stop' if len(stopped) == 2 else (
            f'{stopped[0]} stops' if stopped else 'nobody can be stopped' if not stops else
            'and to stop makes it no better')
        holder = lesser if lesser in self._holds else next(
            (name for name in pair if name in self._holds), '')
        self._publish(pair, loss, AlertAction.UNRESOLVED, holder,
                      'no hold keeps them apart, ' + text + (f' ({why})' if why else ''))
        if known is None or known.alert.action is not AlertAction.UNRESOLVED or not (
                0.0 <= self._stamp - self._asked.get(pair, -math.inf) < _ASK_AGAIN):
            self._asked[pair] = self._stamp
            self._step.unresolved.append(pair)

    # what is published

    def _publish(self, pair: UavPair, loss: PredictedLoss, action: AlertAction, holder: str,
                 reason: str) -> None:
        """Publish an alert unless one with the same action and holder is in force."""
        alert = SeparationAlert(pair, loss.horizontal, loss.vertical, loss.begins, action,
                                holder, reason, self._stamp)
        known = self._alerts.get(pair)
        if known is None or (known.alert.action, known.alert.holder) != (action, holder):
            self._step.alerts.append(alert)
        self._alerts[pair] = _Alerted(alert, self._stamp)

    def _end_alerts(self, stamp: float, losses: Iterable[UavPair]) -> None:
        """Drop the alerts of pairs that are apart again."""
        current = set(losses)
        for pair, each in list(self._alerts.items()):
            held = each.alert.action is AlertAction.HOLD and each.alert.holder in self._holds
            if pair in current or held:
                each.seen = stamp
            elif not 0.0 <= stamp - each.seen < _CALM:
                del self._alerts[pair]
                self._asked.pop(pair, None)
                if each.alert.action is not AlertAction.RELEASE:
                    self._step.alerts.append(SeparationAlert(
                        pair, math.inf, math.inf, 0.0, AlertAction.NONE, '',
                        'they stay apart', stamp))

    def _renew(self) -> None:
        """Renew the holds in force before they expire."""
        for uav_id, hold in self._holds.items():
            if not 0.0 <= self._stamp - hold.renewed < _RENEWED_AFTER:
                hold.renewed = self._stamp
                self._step.holds.append(SeparationHold(
                    uav_id, True, self._stamp, self._stamp + LONGEST_HOLD, hold.reason))
