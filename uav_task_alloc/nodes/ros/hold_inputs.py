# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to the holds of a bridge's UAVs, and the end of those that expire."""
from __future__ import annotations

import math
import time
from collections.abc import Callable

from rclpy.node import Node
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.nodes.conversions.messages import HOLDS
from uav_task_alloc.nodes.conversions.orders import (
    SEPARATION_HOLD,
    hold_expiry,
    to_hold_request,
)
from uav_task_alloc.nodes.ros.leveled_log import LeveledLog
from uav_task_alloc.nodes.ros.topic_names import HOLD, check_topic
from uav_task_alloc.record.message_records import from_stamp

_LATE = 35.0  # [s] from which a hold of a minute, renewed after 20 s, may end in between
_WARNED = 60.0  # [s] steady time that a warning lasts, and between two lines in the log


class LateHolds:
    """Holds to keep UAVs separate that come too late by the published clock to be flown.

    Machines whose clocks differ by a minute have no such holds.

    Args:
        log: writes a warning.
    """

    def __init__(self, log: Callable[[str], object]) -> None:
        self._log = log
        self._text, self._at, self._logged = '', -math.inf, -math.inf  # [s] steady time

    def add(self, uav_id: str, msg: m.UavHold, now: float, steady: float) -> None:
        """Compare a hold with the published clock.

        Args:
            uav_id: of the topic it came on.
            msg: valid; one that ends, or is of an operator, is not late.
            now: the published clock [s].
            steady: [s].
        """
        if not msg.hold or msg.source != m.UavHold.SEPARATION:
            return
        stamp, expires = from_stamp(msg.header.stamp), from_stamp(msg.expires) or math.inf
        if expires <= now:
            text = f'expired {now - expires:.0f} s before it came, and is ignored'
        elif stamp > 0.0 and now - stamp >= _LATE:
            text = (f'is stamped {now - stamp:.0f} s before the clock of this node, and may end '
                    'before it is renewed')
        else:
            return
        self._at = steady
        self._text = (f'{uav_id}/hold: a hold to keep UAVs separate {text}: expected machines '
                      'whose clocks agree')
        if steady - self._logged >= _WARNED:
            self._logged = steady
            self._log(self._text)

    def warning(self, steady: float) -> str:
        """Return what is wrong with the last late hold.

        Args:
            steady: [s].

        Returns:
            '' where none has come for a minute.
        """
        return self._text if steady - self._at < _WARNED else ''


class HoldInputs:
    """The topics `<uav_id>/hold`.

    Args:
        node: which subscribes.
        log: of refused messages.
        stamp: the published clock [s].
        apply: called with (uav_id, request).
        clock: [s] by which holds to keep UAVs separate end; None: the published one.
    """

    def __init__(self, node: Node, log: LeveledLog, stamp: Callable[[], float],
                 apply: Callable[[str, HoldRequest], None],
                 clock: Callable[[], float] | None = None) -> None:
        self._node, self._log, self._stamp, self._apply = node, log, stamp, apply
        self._clocks = {'separation': clock or stamp}  # of others: the published one
        self._known: set[str] = set()  # UAVs
        # [s] of the clock of its source when a hold ends, by UAV and source
        self._expires: dict[tuple[str, str], float] = {}
        self.late = LateHolds(lambda text: log.write('warning', text))

    def subscribe(self, uav_id: str) -> None:
        """Subscribe to the holds of a UAV, once; an id that is too long for a topic is logged.

        Args:
            uav_id: a ROS name.
        """
        if uav_id in self._known:
            return
        self._known.add(uav_id)
        try:
            topic = check_topic(self._node, HOLD, uav_id)
        except InvalidValue as error:
            self._log.write('error', f'it cannot be held: {error}')
            return

        def on_message(msg: m.UavHold) -> None:
            self._on_hold(uav_id, msg)

        self._node.create_subscription(m.UavHold, topic, on_message, HOLDS)

    def _on_hold(self, uav_id: str, msg: m.UavHold) -> None:
        """Take a hold; an invalid one is logged and changes nothing."""
        try:
            request = to_hold_request(msg, uav_id)
        except InvalidValue as error:
            self._log.write('warning', f'{uav_id}/hold: {error}: ignored')
            return
        now = self._stamp()
        self.late.add(uav_id, msg, now, time.monotonic())
        expires = hold_expiry(msg, now)
        if request.hold and expires <= now:
            request = HoldRequest(request.source, False)
        self._expires[uav_id, request.source] = (
            self._now(request.source) + expires - now if request.hold else math.inf)
        self._apply(uav_id, request)

    def _now(self, source: str) -> float:
        return self._clocks.get(source, self._stamp)()

    def step(self) -> None:
        """End the holds that have expired."""
        for (uav_id, source), expires in self._expires.items():
            now = self._now(source)
            if now >= expires:
                self._expires[uav_id, source] = math.inf
                self._apply(uav_id, HoldRequest(source, False))
            elif source == 'separation' and expires < math.inf:  # after the clock went back, too
                self._expires[uav_id, source] = min(expires, now + SEPARATION_HOLD)
