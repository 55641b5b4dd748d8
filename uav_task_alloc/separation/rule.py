# SPDX-License-Identifier: Apache-2.0
"""When two UAVs are apart, and what a conflict of two planned flights is."""
from __future__ import annotations

from dataclasses import dataclass

from uav_task_alloc.checks import check_number
from uav_task_alloc.errors import InvalidValue

FORGOTTEN = 30.0  # [s] for which a UAV that reports no more is in the way of others
_LIMITS = (('horizontal', 1e4), ('vertical', 1e4), ('time', 3600.0), ('speed_error', 1.0),
           ('horizon', 3600.0))


@dataclass(frozen=True, slots=True)
class Separation:
    """Two UAVs in the air are apart while their horizontal or their vertical distance is kept.

    Planned flights are apart while that holds for all their positions whose times differ by no
    more than `time` and the uncertainty of both: each may be early or late by `speed_error` of the
    time since its position is known, up to `horizon`.

    Attributes:
        horizontal: [m]; 0: nothing keeps UAVs apart.
        vertical: [m].
        time: [s].
        speed_error: share of the speed, in [0, 1].
        horizon: [s] after which the uncertainty grows no more, as plans are made again before.

    Raises:
        InvalidValue: a value is out of range, or `vertical` is 0 where `horizontal` is not.
    """

    horizontal: float = 0.0  # [m]
    vertical: float = 0.0  # [m]
    time: float = 0.0  # [s]
    speed_error: float = 0.2
    horizon: float = 60.0  # [s]

    def __post_init__(self) -> None:
        for name, high in _LIMITS:
            number = check_number(f'separation: {name}', getattr(self, name), 0.0, high)
            object.__setattr__(self, name, number)
        if self.horizontal > 0.0 and self.vertical == 0.0:
            raise InvalidValue('separation: vertical', 0.0, 'more than 0 m where horizontal = '
                               f'{self.horizontal:g} m; at 0 all UAVs are apart')

    @property
    def on(self) -> bool:
        """Whether UAVs are kept apart at all."""
        return self.horizontal > 0.0

    def keeps(self, horizontal: float, vertical: float) -> bool:
        """Return whether two UAVs at these distances [m] are apart.

        Args:
            horizontal: [m] between them.
            vertical: [m] between them, of either sign.
        """
        return horizontal >= self.horizontal or abs(vertical) >= self.vertical

    def uncertainty(self, seconds: float, speed_error: float | None = None) -> float:
        """Return by how much a UAV may be early or late [s].

        Args:
            seconds: since its position was known [s].
            speed_error: share of this UAV; None: that of the rule.
        """
        share = self.speed_error if speed_error is None else speed_error
        return share * max(0.0, min(seconds, self.horizon))


@dataclass(frozen=True, slots=True)
class Conflict:
    """Two legs of planned flights that are not apart, and what was done about it.

    Attributes:
        uavs: ids of both.
        tasks: ids of the tasks that their legs lead to; '' for the base.
        time: [s] from the moment of the plan, when they come nearest.
        horizontal: [m] least distance, within the uncertainty of their times.
        vertical: [m] distance there.
        resolution: `height`, `hold`, `other uav`, `left out`, or '' where it is not resolved.
        detail: a sentence about that.
        position: [m] ENU of one of them at that time; None: not known.
    """

    uavs: tuple[str, str]
    tasks: tuple[str, str]
    time: float  # [s]
    horizontal: float  # [m]
    vertical: float  # [m]
    resolution: str = ''
    detail: str = ''
    position: tuple[float, float, float] | None = None  # [m] ENU
