# SPDX-License-Identifier: Apache-2.0
"""The command line from its arguments to its output and exit status."""
import json
import subprocess
import sys
from pathlib import Path

import pytest

from uav_task_alloc import SOLVERS, __main__ as cli, params

ROOT = Path(__file__).parents[2]
FILE = str(ROOT / 'config/scenarios/plan_only.yaml')


def test_plan_prints_writes_and_draws_a_plan(tmp_path, capsys):
    out, png, png_3d = (tmp_path / name for name in ('plan.json', 'plan.png', 'plan_3d.png'))
    assert cli.main(['plan', FILE, '--budget', '0.05', '--seed', '3', '--json', str(out), '--plot',
                     str(png), '--plot-3d', str(png_3d), '--missions', str(tmp_path / 'm')]) == 0
    result = json.loads(out.read_text())
    assert set(result['routes']) == {'scout', 'lifter', 'relay'}
    assert sorted(name for route in result['routes'].values() for name in route) == [
        'bridge', 'parcel', 'quay', 'roof', 'yard']
    assert 'fenced' in result['unassigned']
    assert result['distance'] == pytest.approx(sum(
        leg['length'] for legs in result['legs'].values() for leg in legs))
    assert all(path.read_bytes().startswith(b'\x89PNG') for path in (png, png_3d))
    assert {path.name for path in (tmp_path / 'm').iterdir()} == {
        f'{uav}.{kind}' for uav in result['routes'] for kind in ('plan', 'waypoints')}
    printed = capsys.readouterr().out
    assert '5 tasks planned, 1 unassigned' in printed
    assert 'unassigned fenced: ' in printed
    assert 'relay.plan, .waypoints: ' in printed


def test_a_cancelled_task_is_not_planned(tmp_path):
    out = tmp_path / 'plan.json'
    small = str(ROOT / 'config/scenarios/small.yaml')
    assert cli.main(['plan', small, '--budget', '0.02', '--json', str(out)]) == 0
    result = json.loads(out.read_text())
    assert 'never' not in result['unassigned']
    assert sorted(name for route in result['routes'].values() for name in route) == [
        'beyond', 'east', 'late', 'north']


@pytest.mark.parametrize(('arguments', 'text'), [
    (['plan', 'none.yaml'], 'none.yaml: No such file or directory: expected a scenario file'),
    (['plan', FILE, '--solver', 'bee'], "'bee': expected one of "),
    (['plan', FILE, '--budget', '-1'], 'budget'),
    (['plan', FILE, '--budget', '0.01', '--json', '/none/plan.json'], '/none/plan.json'),
    (['plan', FILE, '--plot-3d', 'plan.txt'],
     "--plot-3d = 'plan.txt': expected a name that ends with .png or .pdf or .svg"),
    (['plan', FILE, '--budget', '0.01', '--missions', FILE + '/m'], 'plan_only.yaml'),
])
def test_an_error_is_one_line_and_status_1(arguments, text, capsys):
    assert cli.main(arguments) == 1
    refusal = capsys.readouterr().err
    assert text in refusal
    assert refusal.count('\n') == 1


def test_ctrl_c_before_the_solving_ends_silently(monkeypatch, capsys):
    def interrupted(argv):
        raise KeyboardInterrupt
    monkeypatch.setattr('uav_task_alloc.cli.plan.main', interrupted)
    assert cli.main(['plan', FILE]) == 130
    assert capsys.readouterr() == ('', '')


def test_a_bad_scenario_is_refused_with_file_and_line(tmp_path, capsys):
    path = tmp_path / 'bad.yaml'
    path.write_text('uavs:\n  - {id: u1, position: [0, 0]}\n')
    assert cli.main(['plan', str(path)]) == 1
    assert capsys.readouterr().err == (
        f'{path}:2: scenario.uavs[0].position = [0, 0]: expected three numbers [x, y, z]\n')


def test_params_prints_the_tables(capsys):
    assert cli.main(['params']) == 0
    printed = capsys.readouterr().out
    assert params.markdown_text() in printed
    assert '# Scenario files' in printed


def test_params_writes_every_generated_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(['params', '--write']) == 0
    result = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob('*.*')}
    assert {'docs/parameters.md', 'docs/scenarios.md', 'config/allocator.yaml'} <= result


def test_params_refuses_other_arguments():
    with pytest.raises(SystemExit, match='usage'):
        cli.main(['params', '--wirte'])


def test_an_unknown_command_is_refused(capsys):
    with pytest.raises(SystemExit):
        cli.main(['fly'])
    assert "'fly'" in capsys.readouterr().err


def test_the_help_lists_every_command(capsys):
    with pytest.raises(SystemExit):
        cli.main(['-h'])
    printed = capsys.readouterr().out
    assert all(f'  {name} ' in printed for name in cli.COMMANDS)


def test_a_command_has_help_of_its_own(capsys):
    with pytest.raises(SystemExit):
        cli.main(['plan', '-h'])
    printed = capsys.readouterr().out
    assert '--budget' in printed
    assert all(name in printed for name in SOLVERS)


def test_the_module_is_the_command():
    done = subprocess.run([sys.executable, '-m', 'uav_task_alloc', 'plan', 'none.yaml'],
                          cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith('none.yaml: ')


@pytest.mark.parametrize('arguments', [['-h'], ['plan', '-h'], ['params']], ids=' '.join)
def test_a_command_that_solves_nothing_imports_no_numba(arguments):
    code = ('import contextlib, sys\nfrom uav_task_alloc.__main__ import main\n'
            'with contextlib.suppress(SystemExit):\n    main(sys.argv[1:])\n'
            'sys.exit("numba" in sys.modules or "matplotlib" in sys.modules)')
    done = subprocess.run([sys.executable, '-c', code, *arguments], cwd=ROOT,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
