# SPDX-License-Identifier: Apache-2.0
"""The command line from its arguments to its output and exit status."""
import argparse
import contextlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import uav_task_alloc
from uav_task_alloc import SOLVERS, __main__ as cli, kernel_cache, parameter_texts
from uav_task_alloc.cli.study import EXPERIMENTS

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


IN_DEGREES = """origin: {latitude: 47.0, longitude: 8.0, altitude_amsl: 400}
route_end: home
uavs:
  - {id: u1, latitude: 47.0, longitude: 8.0, altitude: 0, home: [10, 0, 0]}
  - {id: u2, position: [900, 0, 0]}
tasks:
  - {id: t1, latitude: 47.002, longitude: 8.0, altitude: 50}
  - {id: far, latitude: 47.2, longitude: 8.0, altitude: 60, allowed_uavs: []}
zones:
  - {id: hut, shape: cylinder, latitude: 47.001, longitude: 8.0, radius: 30}
"""


def test_the_json_of_a_plan_has_tasks_and_routes_in_degrees(tmp_path):
    path, out = tmp_path / 'degrees.yaml', tmp_path / 'plan.json'
    path.write_text(IN_DEGREES)
    assert cli.main(['plan', str(path), '--budget', '0.02', '--json', str(out)]) == 0
    result = json.loads(out.read_text())
    assert result['origin'] == {'latitude': 47.0, 'longitude': 8.0, 'altitude_amsl': 400.0}
    for name, latitude, altitude in (('t1', 47.002, 50.0), ('far', 47.2, 60.0)):
        assert result['tasks'][name] == pytest.approx(
            {'latitude': latitude, 'longitude': 8.0, 'altitude': altitude}, abs=1e-8)
    route, out, back = result['waypoints']['u1'], *result['legs']['u1']
    assert route[0] == {'task': None, 'latitude': 47.0, 'longitude': 8.0, 'altitude': 0.0}
    assert len(route) == 3 + len(out['via']) + len(back['via']) > 3  # around the hut
    assert route[1 + len(out['via'])] == {'task': 't1', **result['tasks']['t1']}
    assert route[-1]['longitude'] > 8.0001
    assert [row['task'] for row in result['waypoints']['u2']] == [None]


def test_a_uav_that_starts_inside_a_zone_is_warned_of(tmp_path, capsys):
    path = tmp_path / 'inside.yaml'
    path.write_text("""uavs:
  - {id: u1, position: [25, 0, 0], home: [100, 0, 0]}
  - {id: u2, position: [500, 0, 0]}
zones:
  - {id: hut, shape: cylinder, center: [0, 0], radius: 20, margin: 3}
  - {id: pole, shape: cylinder, center: [100, 5], radius: 2}
""")
    assert cli.main(['plan', str(path), '--budget', '0', '--clearance', '4']) == 0
    assert capsys.readouterr().err == (
        'Warning: u1 starts inside zone hut (with its margin of 3 m and the clearance of 4 m): '
        'its route leaves it first; in a flight it gets no tasks while it is on the ground there\n'
        'Warning: the home of u1 is inside zone pole (with its margin of 0 m and the clearance of '
        '4 m): no safe way leads home\n')
    assert cli.main(['plan', str(path), '--budget', '0', '--clearance', '1']) == 0
    assert 'pole' not in capsys.readouterr().err


DELIVERIES = str(ROOT / 'config/scenarios/deliveries.yaml')


def test_plan_prints_writes_and_draws_times(tmp_path, capsys):
    out, png = tmp_path / 'plan.json', tmp_path / 'times.png'
    assert cli.main(['plan', DELIVERIES, '--budget', '0.2', '--json', str(out), '--plot-times',
                     str(png)]) == 0
    result, printed = json.loads(out.read_text()), capsys.readouterr().out
    assert png.read_bytes().startswith(b'\x89PNG')
    assert set(result['unassigned']) == {'island', 'quarry'}
    assert 'unassigned quarry: payload 4 kg; the largest capacity is 3 kg' in printed
    assert re.search('unassigned island: .*latest is 150 s', printed)
    head, *rows = printed[printed.index('task '):].splitlines()
    assert head.split() == ['task', 'uav', 'trip', 'arrival', 'wait', 'start', 'end', 'window',
                            'late']
    served = {row.split()[0]: row.split() for row in rows if not row.startswith(' ')}
    assert set(served) == set(result['arrivals'])
    assert float(served['harbour'][5]) >= 300.0
    assert served['harbour'][7:] == ['[300.0,', '420.0]', '0.0']
    assert result['finish'] == max(result['ends'].values())
    assert sorted(name for rows in result['trips'].values() for row in rows for name in row
                  ) == sorted(served)
    assert ' -> (home) -> ' in printed


def test_another_objective_and_number_of_trips_may_be_asked_for(tmp_path):
    costs = []
    for objective, trips in (('finish', '3'), ('finish', '1')):
        out = tmp_path / f'{trips}.json'
        assert cli.main(['plan', DELIVERIES, '--budget', '0.1', '--objective', objective,
                         '--trips', trips, '--json', str(out)]) == 0
        costs.append(json.loads(out.read_text()))
    assert max(map(len, costs[0]['trips'].values())) > 1
    assert all(len(rows) == 1 for rows in costs[1]['trips'].values())
    assert len(costs[1]['unassigned']) > len(costs[0]['unassigned'])


def test_times_are_printed_on_request(capsys):
    assert cli.main(['plan', FILE, '--budget', '0.02']) == 0
    assert 'arrival' not in capsys.readouterr().out
    assert cli.main(['plan', FILE, '--budget', '0.02', '--times']) == 0
    assert 'arrival' in capsys.readouterr().out


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
    (['plan', DELIVERIES, '--budget', '0.1', '--missions', 'm'],
     'expected 1: a mission file holds one flight'),
    (['plan', '/dev/zero'], '/dev/zero: more than 100000000 bytes: expected a scenario file'),
    (['plan', FILE, '--trips', '0'], '--trips = 0: expected a whole number in [1, 64]'),
    (['plan', DELIVERIES, '--solver', 'nearest'],
     "solver = 'nearest': expected 'chain_q' where latest times, loads, "),
    (['plan', FILE, '--plot-3d', 'plan.txt'],
     "--plot-3d = 'plan.txt': expected a name that ends with .png or .pdf or .svg"),
    (['plan', FILE, '--budget', '0.01', '--missions', FILE + '/m'], 'plan_only.yaml'),
])
def test_an_error_is_one_line_and_status_1(arguments, text, capsys):
    assert cli.main(arguments) == 1
    refusal = capsys.readouterr().err
    assert text in refusal
    assert refusal.count('\n') == 1


@pytest.mark.parametrize('path', [FILE, DELIVERIES])
def test_an_unknown_solver_is_refused_before_anything_is_compiled(path, monkeypatch, capsys):
    monkeypatch.setattr('uav_task_alloc.cli.plan._load_kernels', lambda *_, **__: 1 / 0)
    assert cli.main(['plan', path, '--solver', 'bee']) == 1
    assert capsys.readouterr().err.startswith("solver 'bee': expected one of chain_q, ")


def test_ctrl_c_before_the_solving_is_one_line(monkeypatch, capsys):
    def interrupted(argv):
        raise KeyboardInterrupt
    monkeypatch.setattr('uav_task_alloc.cli.plan.main', interrupted)
    assert cli.main(['plan', FILE]) == 130
    assert capsys.readouterr() == ('', 'interrupted\n')


def test_a_bad_scenario_is_refused_with_file_and_line(tmp_path, capsys):
    path = tmp_path / 'bad.yaml'
    path.write_text('uavs:\n  - {id: u1, position: [0, 0]}\n')
    assert cli.main(['plan', str(path)]) == 1
    assert capsys.readouterr().err == (
        f'{path}:2: scenario.uavs[0].position = [0, 0]: expected three numbers [x, y, z]\n')


def test_params_prints_the_tables(capsys):
    assert cli.main(['params']) == 0
    printed = capsys.readouterr().out
    assert parameter_texts.markdown_text() in printed
    assert '# Scenario files' in printed


def test_params_writes_every_generated_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(['params', '--write']) == 0
    result = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob('*.*')}
    assert {'docs/parameters.md', 'docs/scenarios.md', 'config/allocator.yaml'} <= result


@pytest.mark.parametrize(('arguments', 'text'), [
    (['params', '--wirte'], "uav_task_alloc params: '--wirte' is unknown; nearest is --write; "),
    (['compile', 'x'], "uav_task_alloc compile: 'x' is unknown; "),
    (['fly'], "uav_task_alloc: 'fly': expected one of plan, import, study, bench, report, "),
    (['plann'], 'compile; nearest is plan; uav_task_alloc -h lists the options'),
    (['--verison'], "uav_task_alloc: '--verison' is unknown; nearest is --version; "),
    (['plan'], 'uav_task_alloc plan: the following arguments are required: SCENARIO.yaml; '),
    (['plan', FILE, '--budget'], 'uav_task_alloc plan: --budget: expected one argument; '),
    (['plan', FILE, '--budget', 'x'], "--budget = 'x': expected a number in [0, 86400] s; "),
    (['plan', FILE, '--budget', 'nan'], "--budget = 'nan': expected a number in [0, 86400] s; "),
    (['plan', FILE, '--seed', '1.5'], "--seed = '1.5': expected a whole number in [0, 922"),
    (['plan', FILE, '--missions', ''], "uav_task_alloc plan: --missions = '': expected a path; "),
    (['plan', FILE, '--route-end', 'land'], "--route-end = 'land': expected one of hold, home; "),
    (['bench', '--sizes', 'x'], "--sizes = 'x': expected UAVs x tasks, each in [1, 10000], as "),
    (['bench', '--sizes', '4x20,'], "--sizes = '': expected UAVs x tasks, each in "),
    (['bench', '--sizes', '0x5'], "--sizes = '0x5': expected UAVs x tasks, each in [1, 10000]"),
    (['bench', '--kinds', 'base,x'], "--kinds = 'x': expected one of spread, base; "),
    (['bench', '--solvers', 'bees'], "--solvers = 'bees': expected one of chain_q, "),
    (['bench', '--against', 'x'], "--against = 'x': expected one of pyvrp, ortools, none; "),
    (['bench', '--budgets', '1,x'], "--budgets = 'x': expected a number in [0.001, 86400] s; "),
    (['bench', '--budgets', '0'], "--budgets = '0': expected numbers in [0.001, 86400] s; "),
    (['study'], 'uav_task_alloc study: the following arguments are required: --out; '),
    (['study', 'whole', '--size', '3'], "uav_task_alloc study whole: --size = '3': expected UAVs"),
    (['report'], 'uav_task_alloc report: the following arguments are required: FILE.mcap'),
])
def test_malformed_arguments_are_one_line_and_status_2(arguments, text, capsys):
    with pytest.raises(SystemExit, match='2'):
        cli.main(arguments)
    refusal = capsys.readouterr().err
    assert text in refusal
    assert refusal.count('\n') == 1


@pytest.mark.parametrize(('arguments', 'text'), [
    (['plan', FILE, '--budget', '-1'], '--budget = -1.0: expected a number in [0, 86400] s'),
    (['plan', FILE, '--budget', 'inf'], '--budget = inf: expected a number in [0, 86400] s'),
    (['plan', FILE, '--seed', '-1'], '--seed = -1: expected a whole number in [0, 922'),
    (['plan', FILE, '--clearance', '-5'], '--clearance = -5.0: expected a number in [0, 10000] m'),
    (['plan', FILE, '--altitude-min', '1e5'],
     '--altitude-min = 100000.0: expected less than the highest detour, 100000 m'),
    (['plan', FILE, '--altitude-max', '-9'],
     '--altitude-max = -9.0: expected more than the lowest detour, '),
    (['bench', '--jobs', '0'], '--jobs = 0: expected a whole number in [1, 1024]'),
    (['bench', '--seeds', '0'], '--seeds = 0: expected a whole number in [1, 10000]'),
    (['bench', '--slack', 'inf'], '--slack = inf: expected a number in [0.01, 1000]'),
    (['study', 'whole', '--runs', '-3'], '--runs = -3: expected a whole number in [1, 100000]'),
    (['bench', '--folder', 'none'], "--folder = 'none': expected a folder"),
])
def test_a_number_out_of_range_is_one_line_and_status_1(arguments, text, capsys):
    assert cli.main(arguments) == 1
    refusal = capsys.readouterr().err
    assert text in refusal
    assert refusal.count('\n') == 1


def test_a_negative_number_is_a_value_in_any_spelling(tmp_path, capsys):
    (tmp_path / 'south.csv').write_text('id,latitude,longitude\nt1,-33.9,151.2\n')
    assert cli.main(['import', str(tmp_path / 'south.csv'), '--origin', '-33.9,151.2,0',
                     '--output', str(tmp_path / 'south.yaml')]) == 0
    assert '-33.9' in (tmp_path / 'south.yaml').read_text()
    capsys.readouterr()
    for low in ('-1e2', '-.5', '-100'):
        assert cli.main(['plan', FILE, '--budget', '0', '--altitude-min', low]) == 0


@pytest.mark.parametrize('arguments', [[], ['-h']], ids=str)
def test_the_help_lists_every_command(arguments, capsys):
    with contextlib.suppress(SystemExit):
        assert cli.main(arguments) == 0
    printed = capsys.readouterr().out
    assert all(f'  {name} ' in printed for name in cli.COMMANDS)


def test_the_version_is_printed(capsys):
    with pytest.raises(SystemExit, match='0'):
        cli.main(['--version'])
    assert capsys.readouterr().out == f'uav_task_alloc {uav_task_alloc.__version__}\n'


PARSERS = [*([name] for name in cli.COMMANDS), *(['study', name] for name in EXPERIMENTS), []]


@pytest.mark.parametrize('words', PARSERS, ids=' '.join)
def test_the_help_has_a_sentence_and_the_default_of_each_option(words, monkeypatch, capsys):
    parsers = []
    initial = argparse.ArgumentParser.__init__

    def remember(self, *args, **kwargs):
        parsers.append(self)
        initial(self, *args, **kwargs)
    monkeypatch.setattr(argparse.ArgumentParser, '__init__', remember)
    with pytest.raises(SystemExit, match='0'):
        cli.main([*words, '--help'])
    assert words[0] in capsys.readouterr().out if words else True
    actions = parsers[-1]._actions
    assert [action.dest for action in actions if len(action.help or '') < 15] == []
    for action in actions:
        if action.option_strings and not isinstance(
                action, (argparse._HelpAction, argparse._VersionAction)):
            stated = re.search(r'\((?:default: (.+)|required)\)$', action.help)
            assert stated, action.dest
            if action.default not in (None, False):
                assert stated[1].replace('%(default)s', str(action.default)) == str(
                    action.default).removesuffix('.0'), action.dest


def test_out_of_memory_is_one_line(monkeypatch, capsys):
    def exhausted(argv):
        raise MemoryError
    monkeypatch.setattr('uav_task_alloc.cli.bench.main', exhausted)
    assert cli.main(['bench']) == 1
    assert capsys.readouterr().err == 'bench: out of memory: expected a smaller problem\n'


def test_compile_prints_and_removes_the_folders_of_the_kernels(monkeypatch, tmp_path, capsys):
    from uav_task_alloc.allocator import warm_up
    monkeypatch.setattr(warm_up, 'compile_kernels', lambda *_: None)
    monkeypatch.setattr('uav_task_alloc.solver.timed.solve.load_timed_kernels', lambda **_: None)
    monkeypatch.setattr(numba.core.config, 'CACHE_DIR', str(tmp_path))
    cli.main(['compile'])
    assert capsys.readouterr().out == ''
    kernels, other = tmp_path / 'a/kernels-1', tmp_path / 'a/other'
    monkeypatch.setattr(kernel_cache, 'kernel_folders', lambda: [kernels])
    for folder in (kernels, other):
        folder.mkdir(parents=True)
        (folder / 'x.nbc').write_bytes(bytes(2_000_000))
    cli.main(['compile'])
    assert capsys.readouterr().out == f'{kernels}: 2.0 MB\n'
    cli.main(['compile', '--remove'])
    assert capsys.readouterr().out == f'removed {kernels}\n'
    assert list((tmp_path / 'a').iterdir()) == [other]


def test_the_folders_of_the_kernels_are_those_that_numba_writes():
    from uav_task_alloc.geometry.detour import detour
    detour((0, 0, 50), (100, 0, 50), [uav_task_alloc.ThreatZone.cylinder('z', (50, 0), 10.0)])
    folders = kernel_cache.kernel_folders()
    package = ROOT / 'uav_task_alloc'
    written = set() if os.environ.get('NUMBA_CACHE_DIR') else {
        path.parent for path in package.rglob('*.nbi')}
    assert written <= set(folders)
    assert any(path.suffix == '.nbi' for folder in folders for path in folder.iterdir())


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
