# SPDX-License-Identifier: Apache-2.0
"""One parameter: declaration as a dataclass field, name in ROS, check of a value."""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import Field, field, fields
from typing import Any, cast

from uav_task_alloc.errors import InvalidValue


def param(default: Any, text: str, *, low: float | None = None, high: float | None = None,
          choices: tuple[str, ...] = (), unit: str = '', fixed: bool = False) -> Any:
    """Declare a parameter as a dataclass field.

    Args:
        default: its type is that of the parameter; a list is stored as a tuple.
        text: one line for the docs.
        low: lowest value; None: unbounded.
        high: highest value; None: unbounded.
        choices: values allowed; empty: any.
        unit: of the value, SI.
        fixed: read at the start only; a later change is refused.

    Returns:
        The field, with all but the default in its metadata.
    """
    what = {'text': text, 'low': low, 'high': high, 'choices': choices, 'unit': unit,
            'fixed': fixed}
    if isinstance(default, (list, tuple)):
        return field(default=tuple(default), metadata=what)
    return field(default=default, metadata=what)


def ros_name(spec: Field[Any]) -> str:
    """Return the name of a parameter in ROS: `origin__latitude` is `origin.latitude`.

    Args:
        spec: the field of the parameter.

    Returns:
        Parts joined by dots.
    """
    return spec.name.replace('__', '.')


def expectation(spec: Field[Any]) -> str:
    """Describe what a value must be.

    Args:
        spec: the field of the parameter.

    Returns:
        Like `one of hold, home`, `float in [0, 1] m`, `text`.
    """
    meta, kind = spec.metadata, type(spec.default).__name__
    if meta['choices']:
        return 'one of ' + ', '.join(meta['choices'])
    if kind in ('int', 'float'):
        low = -math.inf if meta['low'] is None else meta['low']
        high = math.inf if meta['high'] is None else meta['high']
        ends = ('(' if low == -math.inf else '[', ')' if high == math.inf else ']')
        return f'{kind} in {ends[0]}{low:g}, {high:g}{ends[1]} {meta["unit"]}'.rstrip()
    return {'bool': 'true or false', 'str': 'text',
            'tuple': f'list of {_item_type(spec).__name__.replace("str", "text")}'}[kind]


def _item_type(spec: Field[Any]) -> type[int | float | str]:
    """Of a list."""
    return {'tuple[int, ...]': int, 'tuple[float, ...]': float}.get(str(spec.type), str)


def check(spec: Field[Any], value: Any) -> Any:
    """Convert a value to the declared type of its parameter.

    Args:
        spec: the field of the parameter.
        value: an int is accepted for a float, any iterable but a string for a tuple.

    Returns:
        The value.

    Raises:
        InvalidValue: it is of another type, out of range, or none of the choices.
    """
    meta, kind = spec.metadata, type(spec.default)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if kind is tuple and isinstance(value, Iterable) and not isinstance(value, str):
        value = tuple(float(item) if _item_type(spec) is float and type(item) is int else item
                      for item in value)
    wrong = (type(value) is not kind
             or (meta['choices'] and value not in meta['choices'])
             or (kind is float and value != value)
             or (kind is tuple and any(type(item) is not _item_type(spec)
                                   for item in cast('tuple[object, ...]', value)))
             or (meta['low'] is not None and value < meta['low'])
             or (meta['high'] is not None and value > meta['high']))
    if wrong:
        raise InvalidValue(ros_name(spec), value, expectation(spec))
    return value


class CheckedParams:
    """Base of the parameter classes: each field is checked when an object is created."""

    def __post_init__(self) -> None:
        for spec in fields(self):  # type: ignore[arg-type]
            object.__setattr__(self, spec.name, check(spec, getattr(self, spec.name)))
