# SPDX-License-Identifier: Apache-2.0
"""Shortcuts through numba's compiler while a kernel is compiled: the same results in less time.

They replace private methods of numba. Each is left out where a version has others: kernels are
the same then, and take longer to compile.
"""
from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from inspect import signature
from typing import Any, NamedTuple

from numba import types
from numba.core.compiler_lock import global_compiler_lock

_LOCK: Any = global_compiler_lock  # without types
# types whose operators and functions give the same at each call with the same types
_SIMPLE = (types.Number, types.Boolean, types.IntegerLiteral, types.Array, types.UniTuple)


class Shortcut(NamedTuple):
    """A method of numba, and what stands in for it."""

    module: str  # of numba.core
    path: str  # class and method
    arguments: tuple[str, ...]  # of the method, after self
    replacement: Callable[[Any], Any]  # of the method itself: what stands in for it


def _faster_hash(original: Any) -> Any:
    """Flags: a hash of the names of all options, the same for all values."""
    hashes: dict[Any, int] = {}

    def hash_of_names(self: Any) -> int:
        if type(self) not in hashes:
            hashes[type(self)] = original(self)
        return hashes[type(self)]
    return hash_of_names


def _faster_equality(original: Any) -> Any:
    """Flags: most that are compared are the same object, or set the same options."""
    def equal(self: Any, other: Any) -> Any:
        return self is other or (
            type(self) is type(other) and self._values == other._values) or original(self, other)
    return equal


def _faster_variables(original: Any) -> Any:
    """Variables of an instruction: numbers and names in it are not looked into."""
    ir: Any = import_module('numba.core.ir')
    leaves = frozenset((str, int, float, bool, type(None), ir.Loc))

    def list_vars(self: Any, value: Any) -> Any:
        if type(value) is dict:
            value = list(value.values())
        elif type(value) is not list:
            return original(self, value)
        found = []
        for each in value:
            if type(each) is ir.Var:
                found.append(each)
            elif type(each) not in leaves:
                found.extend(self._rec_list_vars(each))
        return found
    return list_vars


def _faster_calls(original: Any) -> Any:
    """Types of calls: numba tries all versions of an operator, each time it is used."""
    stack: Any = import_module('numba.core.targetconfig').ConfigStack
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        flags = stack.top_or_none()
        if (kws or flags is None or flags.fastmath
                or not all(isinstance(each, _SIMPLE) for each in args)):
            return original(self, context, args, kws)
        key = (id(self), id(context), tuple(args), flags.nrt, flags.forceinline,
               flags.error_model)  # what versions made for a call inherit
        if key not in known:
            sig = original(self, context, args, kws)
            known[key] = sig, self._impl_keys[sig.args], self, context
        sig, self._impl_keys[sig.args] = known[key][:2]
        return sig
    return get_call_type


def _inner_lowering(original: Any) -> Any:
    """Functions of numba that a kernel calls: optimised where they are linked, as kernels are."""
    from uav_task_alloc.kernel_inner import begin_inner_library, replaces_known_methods
    known = replaces_known_methods()

    def run_pass(self: Any, state: Any) -> Any:
        if known and state.library is None and state.func_id.modname.startswith('numba.'):
            begin_inner_library(state)
        return original(self, state)
    return run_pass


SHORTCUTS = (
    Shortcut('targetconfig', 'TargetConfig.__hash__', (), _faster_hash),
    Shortcut('targetconfig', 'TargetConfig.__eq__', ('other',), _faster_equality),
    Shortcut('ir', 'Inst._rec_list_vars', ('val',), _faster_variables),
    Shortcut('types.functions', 'BaseFunction.get_call_type', ('context', 'args', 'kws'),
             _faster_calls),
    Shortcut('typed_passes', 'NativeLowering.run_pass', ('state',), _inner_lowering))


def _hash_ignores_values(kind: Any) -> bool:
    """Whether all flags have one hash."""
    flags: Any = import_module('numba.core.compiler').Flags()
    before = hash(flags)
    flags.nrt, flags.forceinline = True, True
    return kind is not None and hash(flags) == before


@functools.cache
def _found() -> tuple[tuple[Any, str, Any, Any], ...]:
    """Class, name, method (None: inherited) and what stands in for it, where numba has it."""
    found = []
    for module, path, arguments, replacement in SHORTCUTS:
        owner, name = path.split('.')
        try:
            kind = getattr(import_module(f'numba.core.{module}'), owner)
            original = getattr(kind, name)
            own = vars(kind).get(name)
            if tuple(signature(original).parameters) == ('self', *arguments) and (
                    name != '__hash__' or _hash_ignores_values(kind)):
                found.append((kind, name, own, replacement(original)))
        except (ImportError, AttributeError):  # of another version
            continue
    return tuple(found)


class _Depth:
    """How many compilations are under way, one within the other."""

    value = 0


@contextmanager
def shortcuts() -> Iterator[None]:
    """Within it, numba's compiler takes the shortcuts; other threads wait to compile."""
    with _LOCK:
        _Depth.value += 1
        if _Depth.value == 1:
            for kind, name, _, faster in _found():
                setattr(kind, name, faster)
        try:
            yield
        finally:
            _Depth.value -= 1
            if _Depth.value == 0:
                for kind, name, own, _ in _found():
                    if own is None:
                        delattr(kind, name)
                    else:
                        setattr(kind, name, own)
