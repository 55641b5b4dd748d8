# SPDX-License-Identifier: Apache-2.0
"""How kernels are compiled: without the GIL, kept on disk, and without counting references.

Counting references to each array of a tuple that a call passes on would take most of the time; it
is left out, so a kernel can change arrays but make none.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

NJIT: Any = numba.njit  # its stubs do not know all options
_Made = TypeVar('_Made', bound=Callable[..., Any])


def kernel(function: _Made) -> _Made:
    """Compile a function that is called from Python."""
    made: _Made = NJIT(cache=True, nogil=True, _nrt=False)(function)
    return made


def part(function: _Made) -> _Made:
    """Compile a function into each kernel that calls it."""
    made: _Made = NJIT(cache=True, nogil=True, _nrt=False, forceinline=True)(function)
    return made


def maker(function: _Made) -> _Made:
    """Compile a function that makes arrays."""
    made: _Made = NJIT(cache=True, nogil=True)(function)
    return made
