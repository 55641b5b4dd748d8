# SPDX-License-Identifier: Apache-2.0
"""Arrays and functions at plain addresses, for kernels that would otherwise wait for Python.

Numba counts a reference for each array of a tuple that a call passes on: 100 ns for a lookup that
takes 3. A function object in such a tuple makes numba resolve its type again: 130 us for a call
from Python. The code that takes an address has to keep the array or function alive.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core.typing.templates import Signature
from numba.extending import intrinsic


def cast(context: Any, builder: Any, signature: Signature, args: Any) -> Any:
    """Code for a pointer from an integer, for intrinsics that name the type."""
    target: ir.Type = context.get_value_type(signature.return_type)
    return builder.inttoptr(args[0], target)


@intrinsic
def _floats_at(typing_context: Any, address: int) -> tuple[Signature, Callable[..., Any]]:
    """The float64 values at an address."""
    return types.CPointer(types.float64)(types.int64), cast  # type: ignore[no-untyped-call]


@intrinsic
def _ints_at(typing_context: Any, address: int) -> tuple[Signature, Callable[..., Any]]:
    """The int64 values at an address."""
    return types.CPointer(types.int64)(types.int64), cast  # type: ignore[no-untyped-call]


@intrinsic
def _call_float(typing_context: Any, address: int, a: int, b: int, c: int) -> tuple[
        Signature, Callable[..., Any]]:
    """Call the C function float64(int64, int64, int64) at an address."""
    def call(context: Any, builder: Any, signature: Signature, args: Any) -> Any:
        whole = ir.IntType(64)
        kind = ir.FunctionType(ir.DoubleType(), [whole, whole, whole])
        return builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
    return types.float64(types.int64, types.int64, types.int64, types.int64), call


call_float: Callable[[int, int, int, int], float] = _call_float  # type: ignore[assignment]
floats_at: Callable[[int], Any] = _floats_at  # type: ignore[assignment]
ints_at: Callable[[int], Any] = _ints_at  # type: ignore[assignment]
