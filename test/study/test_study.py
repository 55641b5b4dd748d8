# SPDX-License-Identifier: Apache-2.0
"""The studies and the bench run without rivals and say so."""
import json
import math

import pytest

from uav_task_alloc import study
from uav_task_alloc.study import bench, rivals
from uav_task_alloc.study.instances import make_instance
from uav_task_alloc.study.learning import confidence


def test_an_instance_is_the_same_again_and_within_reach():
    first, second = make_instance(4, 20, 3), make_instance(4, 20, 3)
    assert first == second != make_instance(4, 20, 4)
    base = make_instance(4, 20, 3, one_base=True)
    assert len({uav.position for uav in base.uavs}) == 1
    assert all(math.dist(task.position, base.uavs[0].position) < base.uavs[0].range
               for task in base.tasks)


def test_the_bench_prints_gaps_and_keeps_lengths(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(rivals, 'installed', lambda: [])
    out = tmp_path / 'runs.json'
    assert bench.main(['--sizes', '2x6', '--seeds', '2', '--first', '3', '--budgets', '0.01',
                       '--solvers', 'chain_q,greedy', '--rivals', '1', '--json', str(out)]) == 0
    said = capsys.readouterr().out
    assert 'not installed, so left out: ortools, pyvrp' in said
    assert '| instances | chain_q@0.01 | greedy@0.01 |' in said
    assert list(json.loads(out.read_text())) == ['spread-2-6-3', 'spread-2-6-4', 'base-2-6-3',
                                                 'base-2-6-4']


def test_a_plan_that_leaves_tasks_out_is_counted_apart():
    text = bench.table({'s-2-6-1': {'a': 100.0, 'b': math.inf},
                        's-2-6-2': {'a': 103.0, 'b': 100.0}})
    assert text.splitlines()[2] == '| s-2-6 | 1.50 | 0.00 (1/2) |'


@pytest.mark.parametrize('name', ['scouts', 'whole', 'warm'])
def test_a_study_prints_its_figures(name, capsys):
    assert study.main([name, '--budget', '0.01', '--runs', '2', '--size', '3x12']) == 0
    assert '%' in capsys.readouterr().out


def test_an_interval_is_half_a_student_interval():
    mean, half = confidence([1.0, 2.0, 3.0])
    assert mean == 2.0
    assert half == pytest.approx(4.303 / math.sqrt(3.0), rel=1e-3)
    assert confidence([1.0])[1] == math.inf
