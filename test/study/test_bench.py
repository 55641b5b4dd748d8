# SPDX-License-Identifier: Apache-2.0
"""The benchmark reports gaps to the best known: as a table, as JSON and as a plot."""
import json

import pytest

from uav_task_alloc.cli import bench
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.study import reference_solvers
from uav_task_alloc.study.bench import measure
from uav_task_alloc.study.gap_plot import draw_gaps
from uav_task_alloc.study.gaps import InstanceRuns, gap_table

SMALL = ['--sizes', '2x6', '--seeds', '2', '--first', '3', '--budgets', '0.02,0.01']
CHAO = 'n 4\nm 1\ntmax 9\n0\t0\t0\n1\t1\t10\n90\t1\t20\n4\t4\t0\n'


def runs_of(scores, collects=False, known=None, group='s-2-6'):
    runs = InstanceRuns(group, collects, known)
    for name, score in scores.items():
        runs.found[name] = [{'budget': 1.0, 'score': score}]
    return runs


def test_gaps_are_printed_and_written_as_json(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(reference_solvers, 'installed', lambda: [])
    out = tmp_path / 'runs.json'
    assert bench.main([*SMALL, '--solvers', 'chain_q,nearest', '--json', str(out)]) == 0
    printed = capsys.readouterr()
    assert 'not installed, so left out: ortools, pyvrp' in printed.err
    columns = 'chain_q@0.01 | chain_q@0.02 | nearest@0.01 | nearest@0.02'
    assert printed.out.startswith(f'| instances | {columns} |\n')
    stored = json.loads(out.read_text())
    assert list(stored) == ['spread-2-6-3', 'spread-2-6-4', 'base-2-6-3', 'base-2-6-4']
    assert stored['base-2-6-3']['gap_percent']['chain_q@0.02'] == 0.0


def test_a_reference_solver_runs_once_for_the_longest_budget(monkeypatch):
    calls = []

    def slow(instance, seconds):
        calls.append((instance.name, seconds))
        names = [task.id for task in instance.tasks]
        uav = instance.uavs[0].id
        return [(0.015, {uav: names}), (0.5, {uav: []})]

    monkeypatch.setitem(reference_solvers.REFERENCE_SOLVERS, 'pyvrp', slow)
    source = {'uavs': 1, 'tasks': 3, 'seed': 1, 'slack': 9.0}
    rows = measure(source, 'pyvrp', (0.01, 0.02, 1.0))['found']
    assert calls == [('spread*9-1-3-1', 1.0)]
    assert [each['score'] is None for each in rows] == [True, False, True]
    assert [each['missing'] for each in rows] == [3, 0, 3]


def test_public_instances_are_grouped_and_compared_with_their_best_known_values(tmp_path, capsys):
    (tmp_path / 'p1.2.a.txt').write_text(CHAO)
    (tmp_path / 'best_known.txt').write_text('p1.2.a.txt 20\n')
    (tmp_path / 'notes.md').write_text('words')
    plot = tmp_path / 'gap.png'
    assert bench.main(['--folder', str(tmp_path), '--budgets', '0.01', '--against', 'none',
                       '--plot', str(plot)]) == 0
    printed = capsys.readouterr()
    assert "notes.md left out: notes.md = 'words': expected an instance" in printed.err
    assert printed.out.splitlines()[-2:] == ['| p1 | 50.00 |', '| best reached | 0/1 |']
    assert plot.read_bytes().startswith(b'\x89PNG')


def test_kept_results_are_not_computed_again(tmp_path, capsys):
    given = [*SMALL, '--against', 'none', '--keep', str(tmp_path / 'kept')]
    assert bench.main(given) == 0
    first = capsys.readouterr()
    assert bench.main(given) == 0
    second = capsys.readouterr()
    assert (second.err, second.out) == ('4 of 4 results exist already\n', first.out)


@pytest.mark.parametrize(('given', 'text'), [
    (['--solvers', 'best'], "--solvers = 'best': expected one of chain_q"),
    (['--against', 'gurobi'], "--against = 'gurobi': expected one of pyvrp, ortools"),
])
def test_an_unknown_solver_is_refused(given, text, capsys):
    with pytest.raises(SystemExit) as end:
        bench.main(given)
    assert end.value.code == 2
    assert text in capsys.readouterr().err


def test_an_empty_folder_is_refused():
    with pytest.raises(InvalidValue, match=r'expected instances named no\*'):
        bench.main(['--folder', '.', '--match', 'no*'])


def test_the_table_says_how_many_instances_a_solver_solved():
    text = gap_table({'1': runs_of({'a': 100.0, 'b': None}),
                      '2': runs_of({'a': 103.0, 'b': 100.0})})
    assert text.splitlines()[2:] == ['| s-2-6 | 1.50 | 0.00 (1/2) |',
                                     '| best reached | 1/2 | 1/2 |']


def test_a_value_falls_short_of_the_published_one_a_length_exceeds_it():
    assert runs_of({'a': 90.0}, collects=True, known=100.0).gaps()['a@1'] == pytest.approx(10.0)
    assert runs_of({'a': 110.0}, known=100.0).gaps()['a@1'] == pytest.approx(10.0)
    assert runs_of({'a': 0.0}, collects=True, known=0.0).gaps()['a@1'] == 0.0


def test_a_plot_without_any_valid_plan_is_drawn(tmp_path):
    draw_gaps({'1': runs_of({'a': None})}, tmp_path / 'gap.svg')
    assert '<svg' in (tmp_path / 'gap.svg').read_text()
