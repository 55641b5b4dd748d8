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
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

from uav_task_alloc.kernel_cache import install

NJIT: Any = numba.njit  # its stubs do not know all options
_register_pass: Any = register_pass  # without types
_Function = TypeVar('_Function', bound=Callable[..., Any])

install()


class _NoEnvironments:
    """A code generator whose code is not run, so its Python objects are not stored."""

    def set_env(self, name: str, environment: object) -> None:
        """Do nothing."""


class _InnerLibrary(JITCodeLibrary):
    """Code that is optimised, and made machine code, only within the kernels that it is linked to.

    Optimising it before as well takes a tenth of a compilation.
    """

    @property
    def codegen(self) -> Any:
        """What the code is run by."""
        return _NoEnvironments()

    def get_pointer_to_function(self, name: str) -> int:
        """No address."""
        return 0

    def _optimize_final_module(self) -> None:
        """The caller's code is optimised with it."""

    def _finalize_final_module(self) -> None:
        self._finalized = True


@_register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(NativeLowering):
    """Makes an _InnerLibrary."""

    _name = 'native_lowering_inner'

    def run_pass(self, state: Any) -> bool:
        """Lower a kernel for kernels."""
        kind: Any = _InnerLibrary
        state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))  # type: ignore[no-untyped-call]


class _InnerCompiler(CompilerBase):
    """Compiles kernels for kernels."""

    def define_pipelines(self) -> list[Any]:
        """The passes of numba's own compiler, with the other lowering."""
        builder: Any = DefaultPassBuilder
        passes: Any = builder.define_nopython_pipeline(self.state)
        passes.passes[:] = [(_InnerLowering if each is NativeLowering else each, text)
                            for each, text in passes.passes]
        passes.finalize()
        return [passes]


class _Kernel(CPUDispatcher):
    """A kernel of which constant arguments make no further version."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return super().get_call_template(
            tuple(types.unliteral(each) for each in args), kws)  # type: ignore[no-untyped-call]


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
    return _compiled(_Kernel, function, cache=True, _nrt=False)


def allocating_kernel(function: _Function) -> _Function:
    """Compile a function that is called from Python and may make arrays.

    Args:
        function: takes numbers and arrays.

    Returns:
        The compiled function; releases the GIL, is cached on disk.
    """
    return _compiled(_Kernel, function, cache=True)


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


def _compiled(kind: type[_Kernel], function: _Function, **options: Any) -> _Function:
    """What compiles a function when it is first called."""
    if kind is _InnerKernel:
        options['pipeline_class'] = _InnerCompiler
    compiled: Any = NJIT(nogil=True, no_cfunc_wrapper=True,
                         no_cpython_wrapper=kind is _InnerKernel, **options)(function)
    compiled.__class__ = kind
    result: _Function = compiled
    return result
