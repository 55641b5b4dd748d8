# SPDX-License-Identifier: Apache-2.0
"""How kernels are compiled: without the GIL, kept on disk, and without counting references.

Counting references to each array of a tuple that a call passes on would take most of the time; it
is left out, so a kernel can change arrays but make none.

Most kernels are called by kernels only. The code that calls one from Python takes as long to
compile as the kernel, so those (`inner_`, `inline_`) are compiled without it; and they are not
kept on disk, where each kernel that calls them has them within it. A constant argument makes no
further version of a kernel, as numba has it by default.
"""
from __future__ import annotations

import functools
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

import numba
from numba import types
from numba.core.registry import CPUDispatcher

from uav_task_alloc.kernel_arguments import pass_tuples_whole
from uav_task_alloc.kernel_cache import NOTICE, ON_DISK, install
from uav_task_alloc.kernel_shortcuts import shortcuts

NJIT: Any = numba.njit  # its stubs do not know all options
_Function = TypeVar('_Function', bound=Callable[..., Any])

install()
pass_tuples_whole()


class _Kernel(CPUDispatcher):
    """A kernel of which constant arguments make no further version."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return super().get_call_template(
            tuple(types.unliteral(each) for each in args), kws)  # type: ignore[no-untyped-call]

    def compile(self, sig: Any) -> Any:
        """Compile it for some types, or load it."""
        with shortcuts():
            try:
                return super().compile(sig)
            except OSError as error:  # on a full disk it is compiled, and not kept
                NOTICE.report_not_kept(error)
                return super().compile(sig)


class _InnerKernel(_Kernel):
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
        return NJIT(cache=ON_DISK, **options)(function)

    def __call__(self, *args: Any) -> Any:
        return self.from_python(*args)


def kernel(function: _Function) -> _Function:
    """Compile a function that is called from Python and makes no arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    return _compiled(_Kernel, function, cache=ON_DISK, _nrt=False)


def allocating_kernel(function: _Function) -> _Function:
    """Compile a function that is called from Python and may make arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    return _compiled(_Kernel, function, cache=ON_DISK)


def inner_kernel(function: _Function) -> _Function:
    """Compile a function that is called by kernels only and makes no arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL.
    """
    return _compiled(_InnerKernel, function, _nrt=False)


def inner_allocating_kernel(function: _Function) -> _Function:
    """Compile a function that is called by kernels only and may make arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL.
    """
    return _compiled(_InnerKernel, function)


def inline_kernel(function: _Function) -> _Function:
    """Compile a function that makes no arrays into each kernel that calls it.

    Args:
        function: called by kernels only.

    Returns:
        The compiled function; releases the GIL.
    """
    return _compiled(_InnerKernel, function, _nrt=False, forceinline=True)


@functools.cache
def _inner_options() -> dict[str, Any]:
    """What makes numba optimise kernels for kernels only where they are linked."""
    try:
        from uav_task_alloc.kernel_inner import InnerCompiler, replaces_known_methods
    except (ImportError, AttributeError):  # of another version; the kernels are the same without
        return {}
    return {'pipeline_class': InnerCompiler} if replaces_known_methods() else {}


def c_function(function: Callable[..., Any], signature: Any) -> Any:
    """Compile a function whose address kernels call.

    Args:
        function: takes and returns numbers.
        signature: numba's, of its types.

    Returns:
        The compiled function; cached on disk, where that can be written.
    """
    with shortcuts():
        try:
            return numba.cfunc(signature, cache=True)(function)
        except OSError as error:
            NOTICE.report_not_kept(error)
            return numba.cfunc(signature)(function)


def _compiled(kind: type[_Kernel], function: _Function, **options: Any) -> _Function:
    """What compiles a function when it is first called."""
    if kind is _InnerKernel:
        options |= _inner_options()
    compiled: Any = NJIT(nogil=True, no_cfunc_wrapper=True,
                         no_cpython_wrapper=kind is _InnerKernel, **options)(function)
    compiled.__class__ = kind
    result: _Function = compiled
    return result
