# SPDX-License-Identifier: Apache-2.0
"""The compiler of kernels that only kernels call: their code is optimised where it is linked.

It replaces private methods of numba. Where a version has others, it is not used: the kernels are
the same then, and take a tenth longer to compile.
"""
from __future__ import annotations

from inspect import signature
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering

_register_pass: Any = register_pass  # without types
# methods that are called or replaced here, with their arguments
_LIBRARY = {'__init__': ('codegen', 'name'), '_optimize_final_module': (),
            '_finalize_final_module': (), 'get_pointer_to_function': ('name',),
            'enable_object_caching': (), '_optimize_functions': ('ll_module',)}
_LOWERING = {'run_pass': ('state',)}


def replaces_known_methods(library: type = JITCodeLibrary,
                           lowering: type = NativeLowering) -> bool:
    """Whether numba has the methods that are called or replaced here, with these arguments.

    Args:
        library, lowering: numba's classes.

    Returns:
        False: InnerCompiler is not to be used.
    """
    return isinstance(getattr(library, 'codegen', None), property) and all(
        callable(method := getattr(kind, name, None))
        and tuple(signature(method).parameters) == ('self', *names)
        for kind, methods in ((library, _LIBRARY), (lowering, _LOWERING))
        for name, names in methods.items())


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

    def _optimize_functions(self, ll_module: Any) -> None:
        """Only make the code short: all passes run over the caller's code."""
        passes: Any = self._codegen._function_pass_manager
        usual: Any = super()._optimize_functions
        if tuple(signature(passes).parameters) != ('kwargs',):  # of another version
            usual(ll_module)
            return
        ll_module.data_layout = self._codegen._data_layout
        manager, builder = passes(opt=1, loop_vectorize=False)
        for function in ll_module.functions:
            if not function.is_declaration:
                manager.run(function, builder)

    def _optimize_final_module(self) -> None:
        """The caller's code is optimised with it."""

    def _finalize_final_module(self) -> None:
        self._finalized = True


def begin_inner_library(state: Any) -> None:
    """Put the code of a function that is compiled into an _InnerLibrary.

    Args:
        state: of numba's compiler.
    """
    kind: Any = _InnerLibrary
    state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
    state.library.enable_object_caching()


@_register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(NativeLowering):
    """Makes an _InnerLibrary."""

    _name = 'native_lowering_inner'

    def run_pass(self, state: Any) -> bool:
        """Lower a kernel for kernels."""
        begin_inner_library(state)
        return bool(super().run_pass(state))  # type: ignore[no-untyped-call]


class InnerCompiler(CompilerBase):
    """Compiles kernels for kernels."""

    def define_pipelines(self) -> list[Any]:
        """The passes of numba's own compiler, with the other lowering."""
        builder: Any = DefaultPassBuilder
        passes: Any = builder.define_nopython_pipeline(self.state)
        passes.passes[:] = [(_InnerLowering if each is NativeLowering else each, text)
                            for each, text in passes.passes]
        passes.finalize()
        return [passes]
