# SPDX-License-Identifier: Apache-2.0
"""Ranges of keys, pairs of texts in the order of their characters, and a key in the middle."""
from __future__ import annotations

from typing import NamedTuple

RowKey = tuple[str, str]  # kind and id of a row

_BASE = 128  # digits are characters of ASCII; later ones count as the last
_DIGITS = 6  # beyond what the ends of a range have in common


class KeyRange(NamedTuple):
    """The keys from `low` to `high`, which is not one of them."""

    low: RowKey
    high: RowKey

    def middle(self) -> RowKey | None:
        """Return a key between both ends; None where there is none. O(characters)."""
        low, high = map('\0'.join, self)
        shared = next((k for k, (a, b) in enumerate(zip(low, high, strict=False)) if a != b),
                      min(len(low), len(high)))
        length = shared + _DIGITS
        text = _text((_number(low, length) + _number(high, length)) // 2, length)
        kind, _, id = text.partition('\0')
        return (kind, id) if self.low < (kind, id) < self.high else None


ALL_KEYS = KeyRange(('', ''), ('\x7f', ''))


def after(key: RowKey) -> RowKey:
    """Return the first key after another one."""
    return key[0], f'{key[1]}\0'


def _number(text: str, length: int) -> int:
    """The number whose digits are the first characters of a text."""
    number = 0
    for character in text[:length].ljust(length, '\0'):
        number = number * _BASE + min(ord(character), _BASE - 1)
    return number


def _text(number: int, length: int) -> str:
    """The characters of a number, without those of 0 at its end."""
    digits = []
    for _ in range(length):
        number, digit = divmod(number, _BASE)
        digits.append(chr(digit))
    return ''.join(reversed(digits)).rstrip('\0')
