# SPDX-License-Identifier: Apache-2.0
"""Many names as a short text."""
from __future__ import annotations

from collections.abc import Collection
from itertools import islice


def first_names(names: Collection[str], most: int = 5, separator: str = ', ') -> str:
    """Return the first names joined, and how many more there are: 'a, b and 3 more'."""
    more = len(names) - most
    return separator.join(islice(names, most)) + (f' and {more} more' if more > 0 else '')
