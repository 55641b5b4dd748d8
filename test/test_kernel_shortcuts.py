# SPDX-License-Identifier: Apache-2.0
"""Shortcuts through numba's compiler: in place while a kernel is compiled, with equal results."""
import operator
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numba import types
from numba.core import compiler, ir
from numba.core.targetconfig import ConfigStack

from uav_task_alloc import kernel_shortcuts
from uav_task_alloc.kernel import kernel
from uav_task_alloc.kernel_shortcuts import SHORTCUTS, Shortcut, shortcuts

WHERE = ir.Loc('file', 1)


def methods():
    """The methods that shortcuts replace, as they are now."""
    found = []
    for shortcut in SHORTCUTS:
        owner, name = shortcut.path.split('.')
        kind = getattr(import_module(f'numba.core.{shortcut.module}'), owner)
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


@pytest.mark.parametrize('changed', [
    {'module': 'missing'}, {'path': 'Missing.__eq__'}, {'arguments': ('one', 'more')}])
def test_a_method_that_numba_has_no_more_is_not_replaced(monkeypatch, changed):
    shortcut = Shortcut('targetconfig', 'TargetConfig.__eq__', ('other',), lambda original: 0)
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


@pytest.mark.parametrize('before', ['', NONE])
def test_functions_of_numba_give_the_same_with_and_without(before, tmp_path):
    (tmp_path / 'count.py').write_text(PRINT.format(before=before))
    package = Path(kernel_shortcuts.__file__).parents[1]
    done = subprocess.run([sys.executable, tmp_path / 'count.py'], capture_output=True, text=True,
                          env={**os.environ, 'PYTHONPATH': str(package)})
    assert done.stdout == '(10, 0.25)\n', done.stderr


def test_a_kernel_raises_what_a_function_of_numba_raises():
    @kernel
    def divide(x, y):
        return x // y
    assert divide(7, 2) == 3
    with pytest.raises(ZeroDivisionError):
        divide(7, 0)
    assert isinstance(np.int64(divide(4, 2)), np.int64)
