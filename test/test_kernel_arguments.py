# SPDX-License-Identifier: Apache-2.0
"""Tuples of arrays as arguments of kernels: one value where a function is always inlined."""
from types import SimpleNamespace
from typing import NamedTuple

import numba
import numpy as np
import pytest
from llvmlite import ir
from numba.core import callconv
from numba.core.registry import cpu_target

from uav_task_alloc import kernel_arguments
from uav_task_alloc.kernel import inline_kernel, inner_kernel, kernel
from uav_task_alloc.kernel_arguments import has_known_calls
from uav_task_alloc.solver.timed.search import Incumbent

BEST = Incumbent(np.arange(4, dtype=np.uint32), np.array([7.0, 2.0]))
OTHER = NamedTuple('OTHER', [('order', np.ndarray), ('score', np.ndarray)])(*BEST)


@pytest.mark.parametrize(('value', 'inlined', 'passed'), [
    (BEST, True, 1), (BEST, False, 14), (OTHER, True, 14)], ids=['inlined', 'called', 'other'])
def test_an_inlined_function_takes_a_tuple_of_this_package_as_one_value(value, inlined, passed):
    description = SimpleNamespace(restype=numba.float64, argtypes=(numba.typeof(value),),
                                  mangled_name='f', args=('best',), noalias=False, inline=inlined)
    function = cpu_target.target_context.declare_function(ir.Module(), description)
    assert len(function.args) == 2 + passed  # its result, what it raises
    assert description.argtypes == (numba.typeof(value),)


@inline_kernel
def _worth(best: Incumbent, factor: float) -> float:
    return factor * best.score[1] + best.order[3]


@inline_kernel
def _cost(best: Incumbent) -> float:
    return best.score[0] + _worth(best, 10.0)


@inner_kernel
def _loop(best: Incumbent, n: int) -> float:
    cost = 0.0
    for i in range(n):
        if i % 2:
            cost += _cost(best)
    return cost


@kernel
def _all(best: Incumbent, n: int) -> float:
    return _loop(best, n) + _worth(best, 0.5)


def test_kernels_that_call_each_other_get_the_same_arrays():
    assert _all(BEST, 5) == 2 * 30.0 + 4.0
    assert _cost(BEST) == 30.0  # from Python


def test_a_function_of_numba_can_call_them():
    assert numba.njit(lambda best: _cost(best) + best.score[1])(BEST) == 32.0


def test_arguments_stay_as_they_are_where_numba_has_other_methods(monkeypatch):
    assert has_known_calls()
    before = callconv.CPUCallConv.decode_arguments
    monkeypatch.setattr(callconv.CPUCallConv, 'call_function', lambda self, builder: None)
    kernel_arguments.pass_tuples_whole()
    assert not has_known_calls()
    assert callconv.CPUCallConv.decode_arguments is before
