# SPDX-License-Identifier: Apache-2.0
"""Shortcuts through numba's compiler: in place while a kernel is compiled, with equal results."""
import io
import operator
import os
import subprocess
import sys
from functools import reduce
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from llvmlite import ir as llvm
from llvmlite.ir._utils import DuplicatedNameError, NameScope
from numba import types
from numba.core import analysis, compiler, event, ir
from numba.core.postproc import PostProcessor
from numba.core.registry import cpu_target
from numba.core.runtime import _nrt_python, rtsys
from numba.core.targetconfig import ConfigStack

from uav_task_alloc import kernel_shortcuts
from uav_task_alloc.kernel import allocating_kernel, kernel
from uav_task_alloc.kernel_shortcuts import SHORTCUTS, Shortcut, shortcuts

WHERE = ir.Loc('file', 1)


def methods():
    """The methods that shortcuts replace, as they are now."""
    found = []
    for shortcut in SHORTCUTS:
        *owner, name = shortcut.path.split('.')
        kind = reduce(getattr, owner, import_module(shortcut.module))
        found.append((name in vars(kind), getattr(kind, name)))  # its own or inherited
    return found


def test_numba_has_its_own_methods_before_and_after_a_compilation():
    before = methods()
    with shortcuts():
        assert all(now is not was for now, was in zip(methods(), before, strict=True))
        with shortcuts():
            pass
        assert all(now is not was for now, was in zip(methods(), before, strict=True))
    assert methods() == before
    with pytest.raises(ZeroDivisionError), shortcuts():
        raise ZeroDivisionError
    assert methods() == before


def test_flags_are_equal_where_their_values_are_set_or_not():
    left, right, other = compiler.Flags(), compiler.Flags(), compiler.Flags()
    right.nrt = left.nrt  # a default that is set
    other.nrt = not left.nrt
    plain = hash(left), left == right, left == other, left == 1
    with shortcuts():
        assert (hash(left), left == right, left == other, left == 1) == plain
        assert hash(other) == hash(right)
    assert plain[1:] == (True, False, False)


def test_the_variables_of_an_instruction_are_the_same():
    scope = ir.Scope(None, WHERE)
    a, b, c = (ir.Var(scope, name, WHERE) for name in 'abc')
    added = ir.Expr.binop(operator.add, a, b, WHERE)
    each = (ir.Expr.call(a, (b,), (('key', c),), WHERE), ir.Assign(added, c, WHERE),
            ir.Expr.build_tuple([a, b], WHERE), ir.Return(a, WHERE), ir.Expr.phi(WHERE),
            ir.Del('a', WHERE))
    plain = [one.list_vars() for one in each]
    with shortcuts():
        assert [one.list_vars() for one in each] == plain
    assert [var.name for var in plain[0]] == ['a', 'b', 'c']


def test_a_call_with_known_types_is_resolved_once_for_each_kind_of_kernel():
    resolved = []

    def resolve(self, context, args, kws):
        resolved.append(args)
        self._impl_keys[args] = len(resolved)
        return types.float64(*args)
    function, flags, inline = SimpleNamespace(_impl_keys={}), compiler.Flags(), compiler.Flags()
    inline.forceinline = True
    call = kernel_shortcuts._faster_calls(resolve)
    number, real = (types.int64,), (types.float64,)
    with ConfigStack().enter(flags):
        assert call(function, None, number, {}) == call(function, None, number, {})
        assert call(function, None, real, {}).args == real
    assert resolved == [number, real]
    with ConfigStack().enter(inline):
        call(function, None, number, {})
    assert function._impl_keys[number] == 3
    with ConfigStack().enter(flags):
        call(function, None, number, {})
        assert function._impl_keys[number] == 1  # its own version again
        call(function, None, number, {'key': types.int64})
        call(function, None, (types.unicode_type,), {})
        call(function, None, (types.unicode_type,), {})
    assert len(resolved) == 6


def test_sizes_and_hashes_of_types_are_the_same_and_computed_once(monkeypatch):
    context, asked = cpu_target.target_context, []
    pair = llvm.LiteralStructType([llvm.IntType(8), llvm.DoubleType()])
    named = llvm.global_context.get_identified_type('pair')
    named.set_body(llvm.IntType(64))
    tuple_type = types.Tuple((types.int64, types.Array(types.float64, 2, 'C')))
    plain = [context.get_abi_sizeof(each) for each in (pair, named)], hash(tuple_type)
    size = llvm.Type.get_abi_size
    monkeypatch.setattr(llvm.Type, 'get_abi_size', lambda self, *data: (
        asked.append(str(self)), size(self, *data))[1])
    with shortcuts():
        context.get_abi_sizeof(pair)
        asked.clear()
        assert ([context.get_abi_sizeof(each) for each in (pair, named)],
                hash(tuple_type)) == plain
    assert plain[0] == [16, 8]
    assert asked == ['%"pair"']  # its body may have been set since


def test_names_of_values_are_numbered_as_they_are_without():
    names = ['a', 'a', 'b', 'a.1', 'a', 'a.1', '', '', 'b']

    def registered():
        scope = NameScope()
        return [scope.register(name, deduplicate=True) for name in names]
    plain = registered()
    with shortcuts():
        assert registered() == plain
        scope = NameScope()
        scope.register('a')
        with pytest.raises(DuplicatedNameError):
            scope.register('a')
    assert plain[:5] == ['a', 'a.1', 'b', 'a.1.1', 'a.2']


def test_listeners_get_all_events_but_those_of_locks():
    got = {kind: event.RecordingListener() for kind in ('numba:llvm_lock', 'numba:compile')}
    for kind, listener in got.items():
        event.register(kind, listener)
    try:
        with shortcuts():
            for kind in got:
                event.start_event(kind)
                event.end_event(kind)
    finally:
        for kind, listener in got.items():
            event.unregister(kind, listener)
    assert [len(listener.buffer) for listener in got.values()] == [0, 2]


def looped(n):
    total = 0
    for i in range(n):
        if i % 3:
            square = i * i
            total += square
    return total


def generated(n):
    for i in range(n):
        yield -i


@pytest.mark.parametrize('function', [looped, generated])
@pytest.mark.parametrize('emit_dels', [False, True])
def test_variables_end_where_they_end_without(function, emit_dels):
    def processed():
        state = compiler.run_frontend(function)
        PostProcessor(state).run(emit_dels=emit_dels)
        text = io.StringIO()
        state.dump(text)
        return text.getvalue(), state.variable_lifetime.livemap, state.generator_info is None
    plain = processed()
    with shortcuts():
        assert processed() == plain
    assert ('del i' in plain[0]) == emit_dels


def branched(n, start):
    size = start + n
    for i in range(n):
        odd = i % 2
        if odd:
            last = i
            size += 1
        total = odd + size
    return total + last


def test_variables_are_values_where_one_assignment_precedes_all_uses():
    blocks = compiler.run_frontend(branched).blocks
    found = kernel_shortcuts._dominating(blocks, analysis)
    assert {'n', 'start', 'i', 'odd'} <= found
    assert not found & {'size', 'last', 'total'}
    blocks[min(blocks)].prepend(ir.Del('n', WHERE))
    assert 'n' in kernel_shortcuts._dominating(blocks, analysis)
    del_before = next(block for block in blocks.values() if not any(
        each.target.name in ('n', 'odd') for each in block.find_insts(ir.Assign)))
    del_before.prepend(ir.Del('odd', WHERE))
    assert 'odd' not in kernel_shortcuts._dominating(blocks, analysis)


def arrays_in_a_loop(n):
    total, held = 0.0, np.ones(n)
    if n == 1:
        return total
    for i in range(n):
        part = np.arange(i) * 0.5
        if i % 3:
            for each in (held, part):
                for k in range(each.size):
                    total += each[k]
            continue
        total += part.size
    return total


def test_arrays_that_a_loop_makes_are_freed_once():
    compiled = allocating_kernel(arrays_in_a_loop)
    compiled(1)  # from now on numba has what it counts with
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        assert compiled(50) == arrays_in_a_loop(50)
        after = rtsys.get_allocation_stats()
    finally:
        _nrt_python.memsys_disable_stats()
    assert after.alloc - before.alloc == after.free - before.free > 0


@pytest.mark.parametrize('changed', [
    {'module': 'missing'}, {'path': 'Missing.__eq__'}, {'arguments': ('one', 'more')}])
def test_a_method_that_numba_has_no_more_is_not_replaced(monkeypatch, changed):
    shortcut = Shortcut('numba.core.targetconfig', 'TargetConfig.__eq__', ('other',),
                        lambda original: 0)
    found = kernel_shortcuts._found.__wrapped__
    monkeypatch.setattr(kernel_shortcuts, 'SHORTCUTS', (shortcut,))
    assert len(found()) == 1
    monkeypatch.setattr(kernel_shortcuts, 'SHORTCUTS', (shortcut._replace(**changed),))
    assert found() == ()


PRINT = """
import numpy as np
from uav_task_alloc.kernel import allocating_kernel
{before}
def count(n):
    order = np.arange(n)
    order[:] = np.flatnonzero(order >= 0)
    return max(order.sum(), min(n, 3)), np.full(2, 0.5)[1] ** 2

print(allocating_kernel(count)(5))
"""
NONE = 'from uav_task_alloc import kernel_shortcuts; kernel_shortcuts._found = tuple'


def python_prints(source, folder):
    """What a Python prints that runs a program with kernels."""
    (folder / 'program.py').write_text(source)
    package = Path(kernel_shortcuts.__file__).parents[1]
    done = subprocess.run([sys.executable, folder / 'program.py'], capture_output=True, text=True,
                          env={**os.environ, 'PYTHONPATH': str(package)})
    assert not done.stderr
    return done.stdout


@pytest.mark.parametrize('before', ['', NONE])
def test_functions_of_numba_give_the_same_with_and_without(before, tmp_path):
    assert python_prints(PRINT.format(before=before), tmp_path) == '(10, 0.25)\n'


BLAS = """
import sys
import numpy as np
from numba import njit
from uav_task_alloc.kernel import kernel

@kernel
def next_one(n):
    return n + 1

assert next_one(1) == 2
print('scipy.linalg' in sys.modules, njit(lambda a: np.dot(a, a))(np.full(2, 3.0)))
"""


def test_a_kernel_needs_no_scipy_and_other_code_has_its_blas(tmp_path):
    assert python_prints(BLAS, tmp_path) == 'False 18.0\n'


def test_a_kernel_raises_what_a_function_of_numba_raises():
    @kernel
    def divide(x, y):
        return x // y
    assert divide(7, 2) == 3
    with pytest.raises(ZeroDivisionError):
        divide(7, 0)
    assert isinstance(np.int64(divide(4, 2)), np.int64)
