# SPDX-License-Identifier: Apache-2.0
"""Shortcuts through numba's compiler while a kernel is compiled: the same results in less time.

They replace private methods of numba. Each is left out where a version has others: kernels are
the same then, and take longer to compile.
"""
from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from inspect import signature
from typing import Any, NamedTuple

from numba import types
from numba.core.compiler_lock import global_compiler_lock

_LOCK: Any = global_compiler_lock  # without types
_LOCK_EVENTS = 'numba:llvm_lock', 'numba:compiler_lock'
# types whose operators and functions give the same at each call with the same types
_SIMPLE = (types.Number, types.Boolean, types.IntegerLiteral, types.Array, types.UniTuple)


class Shortcut(NamedTuple):
    """A method of numba, and what stands in for it."""

    module: str  # of numba or llvmlite
    path: str  # class and method, or a function
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
        if self is other:
            return True
        if type(self) is not type(other):
            return original(self, other)
        mine, others = self._values, other._values  # without defaults
        return mine == others or all(
            getattr(self, name) == getattr(other, name) for name in (*mine, *others))
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


def _fewer_events(original: Any) -> Any:
    """Events: each call of LLVM takes a lock, and numba reports it to all that time locks."""
    def trigger(kind: str, *details: Any, **named: Any) -> None:
        if kind not in _LOCK_EVENTS:
            original(kind, *details, **named)
    return trigger


def _shorter_post_processing(original: Any) -> Any:
    """Lifetimes of variables: computed when they are needed, which few passes do."""
    post: Any = import_module('numba.core.postproc')
    lifetimes, canonical = post.VariableLifetime, post.transforms.canonicalize_cfg

    def run(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        function = self.func_ir
        if function.is_generator:
            original(self, emit_dels, extend_lifetimes)
            return
        function.blocks = canonical(function.blocks)
        function.variable_lifetime = lifetimes(function.blocks)
        function.generator_info = None
        if emit_dels:
            self._insert_var_dels(extend_lifetimes=extend_lifetimes)
    return run


def _known_sizes(original: Any) -> Any:
    """Sizes of LLVM's types: numba has LLVM parse a module for each time it needs one."""
    known: dict[str, int] = {}

    def get_abi_sizeof(self: Any, ty: Any) -> int:
        text = str(ty)
        if '%' in text:  # a name, which may mean another type later
            size: int = original(self, ty)
            return size
        if text not in known:
            known[text] = original(self, ty)
        return known[text]
    return get_abi_sizeof


def _known_hashes(original: Any) -> Any:
    """Hash of a type of tuples: of all types in it, the same each time."""
    known: dict[int, tuple[int, Any]] = {}  # with the type, so that no other gets its id

    def hash_of_types(self: Any) -> int:
        if id(self) not in known:
            known[id(self)] = original(self), self
        return known[id(self)][0]
    return hash_of_types


def _faster_names(original: Any) -> Any:
    """Names of LLVM's values: the next number of a name, without a call for each."""
    scope: Any = import_module('llvmlite.ir._utils').NameScope()
    if scope._useset != {''} or scope._basenamemap:
        raise AttributeError(scope)  # of another version

    def register(self: Any, name: str, deduplicate: bool = False) -> Any:
        used, base = self._useset, name
        if name in used:
            if not deduplicate:
                return original(self, name)
            number = self._basenamemap[base]
            while name in used:
                number += 1
                name = f'{base}.{number}'
            self._basenamemap[base] = number
        used.add(name)
        return name
    return register


def _fewer_slots(original: Any) -> Any:
    """Variables: values where they are assigned once, before all uses, not slots on the stack.

    numba has slots for those of several blocks, such as the arguments. Each use of a tuple of
    arrays would read all of it, some hundred values, before the code is optimised.
    """
    analysis: Any = import_module('numba.core.analysis')
    for name in ('compute_use_defs', 'must_use_alloca', 'compute_cfg_from_blocks'):
        getattr(analysis, name)  # of another version

    def find(self: Any) -> None:
        original(self)
        # arrays whose references are counted may be deleted twice, which slots allow
        if not (self.context.enable_nrt or self.func_ir.func_id.is_generator):
            self._singly_assigned_vars |= _dominating(self.func_ir.blocks, analysis)
    return find


def _dominating(blocks: Any, analysis: Any) -> set[str]:
    """Variables with one assignment, which each path to any of their uses passes before."""
    ir: Any = import_module('numba.core.ir')
    assigned = Counter(each.target.name for block in blocks.values()
                       for each in block.find_insts(ir.Assign))
    use_defs = analysis.compute_use_defs(blocks)
    found = {name: offset for offset, names in use_defs.defmap.items() for name in names
             if assigned[name] == 1}
    for name in analysis.must_use_alloca(blocks):
        found.pop(name, None)
    dominators = analysis.compute_cfg_from_blocks(blocks).dominators()
    for offset, block in blocks.items():
        before = use_defs.usemap[offset]  # used before an assignment in this block
        deleted = {each.value for each in block.find_insts(ir.Del)}
        for name in before | deleted:
            first = found.get(name, offset)
            # blocks are compiled in this order
            earlier = first < offset and first in dominators.get(offset, ())
            if name in found and not earlier and (first != offset or name in before):
                del found[name]
    return set(found)


def _inner_lowering(original: Any) -> Any:
    """Functions of numba that a kernel calls: optimised where they are linked, as kernels are."""
    from uav_task_alloc.kernel_inner import begin_inner_library, replaces_known_methods
    known = replaces_known_methods()

    def run_pass(self: Any, state: Any) -> Any:
        if known and state.library is None and state.func_id.modname.startswith('numba.'):
            begin_inner_library(state)
        return original(self, state)
    return run_pass


def _no_look_for_blas(original: Any) -> Any:
    """BLAS: numba imports scipy.linalg to know whether there is one, and where one is used."""
    def ensure_blas() -> None:
        """No kernel uses one."""
    return ensure_blas


SHORTCUTS = (
    Shortcut('numba.core.targetconfig', 'TargetConfig.__hash__', (), _faster_hash),
    Shortcut('numba.core.targetconfig', 'TargetConfig.__eq__', ('other',), _faster_equality),
    Shortcut('numba.core.ir', 'Inst._rec_list_vars', ('val',), _faster_variables),
    Shortcut('numba.core.types.functions', 'BaseFunction.get_call_type',
             ('context', 'args', 'kws'), _faster_calls),
    Shortcut('numba.core.types', 'BaseTuple.__hash__', (), _known_hashes),
    Shortcut('numba.core.cpu', 'CPUContext.get_abi_sizeof', ('ty',), _known_sizes),
    Shortcut('numba.core.event', 'start_event', ('kind', 'data'), _fewer_events),
    Shortcut('numba.core.event', 'end_event', ('kind', 'data', 'exc_details'), _fewer_events),
    Shortcut('numba.core.postproc', 'PostProcessor.run', ('emit_dels', 'extend_lifetimes'),
             _shorter_post_processing),
    Shortcut('llvmlite.ir._utils', 'NameScope.register', ('name', 'deduplicate'), _faster_names),
    Shortcut('numba.core.lowering', 'Lower._find_singly_assigned_variable', (), _fewer_slots),
    Shortcut('numba.core.typed_passes', 'NativeLowering.run_pass', ('state',), _inner_lowering),
    Shortcut('numba.np.linalg', 'ensure_blas', (), _no_look_for_blas))


def _hash_ignores_values(kind: Any) -> bool:
    """Whether all flags have one hash."""
    flags: Any = import_module('numba.core.compiler').Flags()
    before = hash(flags)
    flags.nrt, flags.forceinline = True, True
    return kind is not None and hash(flags) == before


@functools.cache
def _found() -> tuple[tuple[Any, str, Any, Any], ...]:
    """Class or module, name, its own (None: inherited) and what stands in for it, where known."""
    found = []
    for module, path, arguments, replacement in SHORTCUTS:
        *names, name = path.split('.')
        try:
            owner = functools.reduce(getattr, names, import_module(module))
            original = getattr(owner, name)
            own = vars(owner).get(name)
            expected = *('self' for _ in names), *arguments
            if tuple(signature(original).parameters) == expected and (
                    replacement is not _faster_hash or _hash_ignores_values(owner)):
                found.append((owner, name, own, replacement(original)))
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
