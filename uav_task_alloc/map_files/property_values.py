# SPDX-License-Identifier: Apache-2.0
"""Properties of elements as values of a scenario: numbers, lists of names, JSON values, texts."""
from __future__ import annotations

import json
import re
from typing import Any

_LISTS = 'required_capabilities', 'allowed_uavs', 'capabilities'
_NESTED = 'actions', 'camera'  # JSON values, or texts of them


def property_value(key: str, value: Any) -> Any:
    """A property as scenarios have it.

    Args:
        key: of a scenario.
        value: as the reader of a file returns it, often a text.

    Returns:
        A list of names or a JSON value where `key` is of one; else a number or a text.
    """
    if key in _LISTS and not isinstance(value, list):
        return [part for part in re.split(r'[,;\s]+', str(value)) if part]
    if key in _NESTED and isinstance(value, str):
        try:
            return json.loads(value)
        except ValueError:
            return value
    if isinstance(value, (dict, list)):
        return value if key in _LISTS + _NESTED else json.dumps(value)
    return number_in(value)


def number_in(value: Any) -> Any:
    """A text as the number that it is, else unchanged; infinities stay texts of YAML.

    Args:
        value: a text, or anything else.

    Returns:
        An int for a whole number; another text without spaces around it.
    """
    if not isinstance(value, str):
        return value
    try:
        number = float(value)
    except ValueError:
        return value.strip()
    return int(number) if number.is_integer() and abs(number) < 1e15 else number
