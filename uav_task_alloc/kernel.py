# SPDX-License-Identifier: Apache-2.0
"""How kernels are compiled: without the GIL, kept on disk, and without counting references.

Counting references to each array of a tuple that a call passes on would take most of the time; it
is left out, so a kernel can change arrays but make none.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

from uav_task_alloc.kernel_cache import install

NJIT: Any = numba.njit  # its stubs do not know all options
_Function = TypeVar('_Function', bound=Callable[..., Any])

install()


def kernel(function: _Function) -> _Function:
    """Compile a function that is called from Python and makes no arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    compiled: _Function = NJIT(cache=True, nogil=True, _nrt=False)(function)
    return compiled


def inline_kernel(function: _Function) -> _Function:
    """Compile a function that makes no arrays into each kernel that calls it.

    Args:
        function: called by kernels only.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    compiled: _Function = NJIT(cache=True, nogil=True, _nrt=False, forceinline=True)(function)
    return compiled


def allocating_kernel(function: _Function) -> _Function:
    """Compile a function that may make arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    compiled: _Function = NJIT(cache=True, nogil=True)(function)
    return compiled
