# SPDX-License-Identifier: Apache-2.0
"""Arguments of kernels that are compiled into their callers: a tuple of arrays is one value there.

numba passes each number of each array of a tuple as an argument of its own, several hundred of
the problem and the routes together, which the caller takes apart and the kernel puts together.
Within one machine code nothing is left of that, but most of the compiler's work was for it.

It replaces private methods of numba. Where a version has others, arguments are passed as numba
passes them: the kernels are the same, and take longer to compile.
"""
from __future__ import annotations

import copy
from collections.abc import Iterable
from inspect import signature
from typing import Any

from numba import types
from numba.core import callconv, cpu
from numba.extending import models, register_model

_ALWAYS_INLINE = 'alwaysinline'  # LLVM's attribute of functions that all callers contain
_Model: Any = models.DataModel  # without types
_register: Any = register_model
# methods that are replaced here, with their arguments
_METHODS = ((cpu.CPUContext, 'declare_function', ('module', 'fndesc')),
            (callconv.CPUCallConv, 'decode_arguments', ('builder', 'argtypes', 'func')),
            (callconv.CPUCallConv, 'call_function',
             ('builder', 'callee', 'resty', 'argtys', 'args', 'attrs')))


class WholeTuple(types.Type):
    """A tuple of arrays that is passed as one value.

    Args:
        kind: the type of the tuple.
    """

    def __init__(self, kind: Any) -> None:
        self.kind = kind
        super().__init__(f'whole {kind}')


@_register(WholeTuple)
class _WholeModel(_Model):  # type: ignore[misc]
    """How LLVM passes it."""

    def get_value_type(self) -> Any:
        return self._dmm.lookup(self.fe_type.kind).get_value_type()

    get_argument_type = get_value_type

    def as_argument(self, builder: object, value: Any) -> Any:
        return value

    from_argument = as_argument


def has_known_calls() -> bool:
    """Whether numba has the methods that are replaced here, with these arguments."""
    return all(callable(method := getattr(kind, name, None))
               and tuple(signature(method).parameters) == ('self', *names)
               for kind, name, names in _METHODS)


def pass_tuples_whole() -> None:
    """Make numba pass named tuples of this package as one value where a function is inlined."""
    if not has_known_calls():
        return
    context, convention = cpu.CPUContext, callconv.CPUCallConv
    declare: Any = context.declare_function
    decode: Any = convention.decode_arguments
    call: Any = convention.call_function

    def declare_function(self: Any, module: Any, fndesc: Any) -> Any:
        if fndesc.inline:
            fndesc = copy.copy(fndesc)
            fndesc.argtypes = _whole(fndesc.argtypes)
        return declare(self, module, fndesc)

    def decode_arguments(self: Any, builder: Any, argtypes: Any, func: Any) -> Any:
        return decode(self, builder, _passed(func, argtypes), func)

    def call_function(self: Any, builder: Any, callee: Any, resty: Any, argtys: Any, args: Any,
                      attrs: Any = None) -> Any:
        return call(self, builder, callee, resty, _passed(callee, argtys), args, attrs)
    for kind, each in ((context, declare_function), (convention, decode_arguments),
                       (convention, call_function)):
        setattr(kind, each.__name__, each)


def _passed(function: Any, kinds: Iterable[Any]) -> Iterable[Any]:
    """The types of a function's arguments, as they are passed."""
    return _whole(kinds) if _ALWAYS_INLINE in getattr(function, 'attributes', ()) else kinds


def _whole(kinds: Iterable[Any]) -> tuple[Any, ...]:
    """The types, named tuples of this package as one value."""
    return tuple(WholeTuple(kind) if isinstance(kind, types.NamedTuple)
                 and kind.instance_class.__module__.startswith(f'{__package__}.') else kind
                 for kind in kinds)
