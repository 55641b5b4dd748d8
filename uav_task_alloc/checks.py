# SPDX-License-Identifier: Apache-2.0
"""Checks of numbers, points, polygons and names; errors state value, expectation and place."""
from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sized
from enum import Enum
from typing import TypeVar

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.polygon import is_simple, signed_area

_Names = TypeVar('_Names', bound=Enum)
_Type = TypeVar('_Type')
FAR = 1e8  # [m] bound of all coordinates
_ROS_NAME = re.compile(r'[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*')


def check_point(place: str, value: Iterable[float]) -> tuple[float, float, float]:
    """Check three coordinates.

    Args:
        place: name of the value in the error text.
        value: [m] ENU.

    Returns:
        Three floats.

    Raises:
        InvalidValue: it has not three coordinates, or one is not finite or beyond FAR.
    """
    try:
        x, y, z = (float(v) for v in value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidValue(place, value, 'three coordinates [m]') from None
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        raise InvalidValue(place, (x, y, z), 'three finite coordinates [m]')
    if max(abs(x), abs(y), abs(z)) > FAR:
        raise InvalidValue(place, (x, y, z), f'three coordinates in [{-FAR:g}, {FAR:g}] m')
    return x, y, z


def check_number(place: str, value: float, low: float, high: float = math.inf,
                 open_low: bool = False) -> float:
    """Check that a number is in [low, high], or in (low, high].

    Args:
        place: name of the value in the error text.
        value: the number.
        low: lower bound.
        high: upper bound, inclusive.
        open_low: the lower bound is exclusive.

    Returns:
        The number as a float.

    Raises:
        InvalidValue: it is outside, NaN or not a number.
    """
    if isinstance(value, bool) or (not isinstance(value, (int, float)) and not hasattr(
            value, '__float__')):
        raise InvalidValue(place, value, _number_in(low, high, open_low))
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):  # of an array, or of a very long integer
        raise InvalidValue(place, value, _number_in(low, high, open_low)) from None
    if not low <= number <= high or (open_low and number == low):
        raise InvalidValue(place, number, _number_in(low, high, open_low))
    return number


def _number_in(low: float, high: float, open_low: bool) -> str:
    return f'a number in {"(" if open_low else "["}{low:g}, {high:g}]'


def check_member(place: str, value: int, names: type[_Names]) -> _Names:
    """Check that a number is a value of an enumeration.

    Args:
        place: name of the value in the error text.
        value: the number.
        names: the enumeration, of integers.

    Returns:
        The member with this value.

    Raises:
        InvalidValue: there is no such member; the text names all.
    """
    try:
        return names(value)
    except ValueError:
        *most, last = (f'{each.name} ({each.value})' for each in names)
        raise InvalidValue(place, value, f'{", ".join(most)} or {last}') from None


def check_instances(place: str, values: Iterable[_Type], expected: type[_Type]
                    ) -> tuple[_Type, ...]:
    """Check that values can be listed, and that each is of a type.

    Args:
        place: name of the values in the error text.
        values: the values.
        expected: their type.

    Returns:
        The same in a tuple.

    Raises:
        InvalidValue: there is no list of them, or one is of another type.
    """
    if not isinstance(values, Iterable):
        raise InvalidValue(place, values, f'an iterable of {expected.__name__}')
    checked = tuple(values)
    for each in checked:
        if not isinstance(each, expected):
            raise InvalidValue(place, each, f'a {expected.__name__}')
    return checked


def check_count(place: str, many: Sized, most: int) -> None:
    """Check how many values there are.

    Args:
        place: name of the values in the error text.
        many: the values.
        most: how many there may be.

    Raises:
        InvalidValue: there are more.
    """
    if len(many) > most:
        raise InvalidValue(f'{place}: number', len(many), f'at most {most}')


def check_id(place: str, value: object) -> str:
    """Check an id.

    Args:
        place: name of the value in the error text.
        value: the id.

    Returns:
        The id.

    Raises:
        InvalidValue: it is no string, empty or blank.
    """
    if not isinstance(value, str) or not value.strip():
        raise InvalidValue(place, value, 'a non-empty string')
    return value


def check_ros_name(place: str, value: str) -> str:
    """Check a name that becomes part of a topic name.

    Args:
        place: name of the value in the error text.
        value: the name.

    Returns:
        The name.

    Raises:
        InvalidValue: it is no ROS name, see `is_ros_name`.
    """
    if not is_ros_name(value):
        raise InvalidValue(place, value, 'a ROS name (letters, digits, single _ and /; no digit '
                                         'first; at most 200 characters)')
    return value


def is_ros_name(value: str) -> bool:
    """Return whether a string can be part of a topic name.

    Such a name has at most 200 characters: tokens of letters, digits and single _, no digit
    first, joined by / (https://design.ros2.org/articles/topic_and_service_names.html).

    Args:
        value: the name.

    Returns:
        False for an empty string.
    """
    return len(value) <= 200 and '__' not in value and _ROS_NAME.fullmatch(value) is not None


def check_names(place: str, value: Iterable[str]) -> frozenset[str]:
    """Check a set of names.

    Args:
        place: name of the value in the error text.
        value: the names.

    Returns:
        Each name once.

    Raises:
        InvalidValue: it is a bare string, or holds anything but non-empty strings.
    """
    expected = 'a set of non-empty strings'
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise InvalidValue(place, value, expected)
    names = tuple(value)  # an iterator gives them once
    if not all(isinstance(name, str) and name.strip() for name in names):
        raise InvalidValue(place, value, expected)
    return frozenset(names)


def check_polygon(place: str, vertices: Iterable[Iterable[float]]) -> tuple[
        tuple[float, float], ...]:
    """Check the corners of a polygon.

    Args:
        place: name of the value in the error text.
        vertices: (x, y) [m]; a last corner equal to the first is dropped.

    Returns:
        The corners as floats.

    Raises:
        InvalidValue: there are less than three, one is not finite or beyond FAR, edges cross or
            touch, or there is no area.
    """
    corners = []
    for corner in vertices:
        try:
            x, y = (float(v) for v in tuple(corner)[:2])
        except (TypeError, ValueError, OverflowError):
            raise InvalidValue(place, corner, 'points (x, y) [m]') from None
        if not (math.isfinite(x) and math.isfinite(y)):
            raise InvalidValue(place, (x, y), 'finite coordinates [m]')
        if max(abs(x), abs(y)) > FAR:
            raise InvalidValue(place, (x, y), f'coordinates in [{-FAR:g}, {FAR:g}] m')
        corners.append((x, y))
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if len(corners) < 3:
        raise InvalidValue(place, tuple(corners), 'at least 3 corners')
    if not is_simple(corners):
        raise InvalidValue(place, tuple(corners), 'edges that do not cross or touch')
    if abs(signed_area(corners)) < 5e-10:
        raise InvalidValue(place, tuple(corners), 'a polygon with some area')
    return tuple(corners)
