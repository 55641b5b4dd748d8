# SPDX-License-Identifier: Apache-2.0
"""How kernels are compiled: without the GIL, kept on disk, and without counting references.

Counting references to each array of a tuple that a call passes on would take most of the time; it
is left out, so a kernel can change arrays but make none.

Most kernels are called by kernels only. The code that calls one from Python takes as long to
compile as the kernel, so those (`inner_`, `inline_`) are compiled without it.
"""
from __future__ import annotations

import functools
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

import numba
from numba.core.registry import CPUDispatcher

from uav_task_alloc.kernel_cache import install

NJIT: Any = numba.njit  # its stubs do not know all options
_Function = TypeVar('_Function', bound=Callable[..., Any])

install()


class InnerKernel(CPUDispatcher):
    """A kernel for kernels. Called from Python, it is compiled once more with code for that."""

    @functools.cached_property
    def from_python(self) -> Any:
        """The same kernel, to be called from Python."""
        function = FunctionType(*(getattr(self.py_func, f'__{each}__') for each in (
            'code', 'globals', 'name', 'defaults', 'closure')))
        function.__module__ = self.py_func.__module__
        function.__qualname__ = f'{self.py_func.__qualname__}.from_python'  # its name on disk
        options = {**self.targetoptions, 'no_cpython_wrapper': False, 'forceinline': False}
        options.pop('nopython')
        return NJIT(cache=True, **options)(function)

    def __call__(self, *args: Any) -> Any:
        return self.from_python(*args)


def kernel(function: _Function) -> _Function:
    """Compile a function that is called from Python and makes no arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    return _compiled(function, _nrt=False)


def allocating_kernel(function: _Function) -> _Function:
    """Compile a function that is called from Python and may make arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    return _compiled(function)


def inner_kernel(function: _Function) -> _Function:
    """Compile a function that is called by kernels only and makes no arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    return _inner(_compiled(function, _nrt=False, no_cpython_wrapper=True))


def inner_allocating_kernel(function: _Function) -> _Function:
    """Compile a function that is called by kernels only and may make arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    return _inner(_compiled(function, no_cpython_wrapper=True))


def inline_kernel(function: _Function) -> _Function:
    """Compile a function that makes no arrays into each kernel that calls it.

    Args:
        function: called by kernels only.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    return _inner(_compiled(function, _nrt=False, no_cpython_wrapper=True, forceinline=True))


def _compiled(function: _Function, **options: bool) -> _Function:
    """What compiles a function when it is first called."""
    compiled: _Function = NJIT(cache=True, nogil=True, no_cfunc_wrapper=True, **options)(function)
    return compiled


def _inner(compiled: _Function) -> _Function:
    """Without code for calls from Python a call would end the process: see InnerKernel."""
    dispatcher: Any = compiled
    dispatcher.__class__ = InnerKernel
    return compiled
