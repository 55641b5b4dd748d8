# SPDX-License-Identifier: Apache-2.0
"""The command `plan`: clearance and altitude limits of the mission files that it writes."""
import json

import pytest

from uav_task_alloc import __main__ as cli, scenario
from uav_task_alloc.geometry.frames import to_enu
from uav_task_alloc.geometry.zones import path_is_clear
from uav_task_alloc.params import AllocatorParams

MAST = """uavs:
  - {id: u1, position: [0, 0, 50]}
tasks:
  - {id: t1, position: [400, 0, 50]}
zones:
  - {id: mast, shape: cylinder, center: [200, 10], radius: 60, z_max: 90}
"""
ROUNDED = 0.02  # [m] by the 1e-7 degrees of a file


@pytest.fixture
def plan(tmp_path):
    """plan(text of a scenario, option, ...): the points of u1's mission file, and the zones."""
    def run(text, *options):
        file = tmp_path / 'mast.yaml'
        file.write_text(text)
        assert cli.main(['plan', str(file), '--budget', '0.05', '--missions',
                         str(tmp_path / 'm'), *options]) == 0
        loaded = scenario.load(file)
        rows = [line.split('\t') for line in
                (tmp_path / 'm/u1.waypoints').read_text().splitlines()[2:]]
        points = [to_enu(loaded.origin, *map(float, row[8:11])) for row in rows]
        return [loaded.uavs[0].position, *points], [timed.zone for timed in loaded.zones]
    return run


@pytest.mark.parametrize(('line', 'options', 'clearance'), [
    ('', (), AllocatorParams.clearance),
    ('clearance: 25\n', (), 25.0),
    ('clearance: 25\n', ('--clearance', '3'), 3.0),
    ('', ('--clearance', '1'), 1.0),
])
def test_finding_39_missions_keep_the_clearance(plan, line, options, clearance):
    points, zones = plan(line + MAST, *options)
    assert path_is_clear(points, zones, clearance - ROUNDED)
    assert not path_is_clear(points, zones, clearance + 1.0)  # no more than requested


@pytest.mark.parametrize(('line', 'options', 'low', 'high'), [
    ('', (), AllocatorParams.altitude_min, AllocatorParams.altitude_max),
    ('', ('--altitude-max', '95'), 0.0, 95.0),
    ('altitude_max: 95\n', (), 0.0, 95.0),
    ('altitude_max: 60\n', ('--altitude-max', '300'), 0.0, 300.0),
    ('altitude_min: 45\n', ('--altitude-max', '55'), 45.0, 55.0),
])
def test_finding_39_detours_keep_the_altitude_limits(plan, line, options, low, high):
    points, _ = plan(line + MAST.replace('radius: 60', 'radius: 150'), *options)
    assert all(low - ROUNDED <= z <= high + ROUNDED for _, _, z in points)
    over = any(z > 90.0 for _, _, z in points)
    assert over is (high > 100.0)  # the mast's 90 m and the clearance


@pytest.mark.parametrize(('options', 'refusal'), [
    (('--clearance', '-1'), '--clearance = -1.0: expected a number in [0, 10000] m'),
    (('--altitude-min', '60', '--altitude-max', '50'),
     '--altitude-min = 60.0: expected less than the highest detour, 50 m'),
])
def test_an_invalid_limit_is_refused(tmp_path, capsys, options, refusal):
    (tmp_path / 'mast.yaml').write_text(MAST)
    assert cli.main(['plan', str(tmp_path / 'mast.yaml'), *options]) == 1
    assert capsys.readouterr().err == f'{refusal}\n'


def test_a_limit_that_is_no_number_is_refused(tmp_path, capsys):
    (tmp_path / 'mast.yaml').write_text(MAST)
    with pytest.raises(SystemExit) as end:
        cli.main(['plan', str(tmp_path / 'mast.yaml'), '--clearance', 'nan'])
    assert end.value.code == 2
    assert "--clearance = 'nan': expected a number in [0, 10000] m" in (
        capsys.readouterr().err)


def test_a_scenario_whose_limits_contradict_is_refused(tmp_path, capsys):
    (tmp_path / 'mast.yaml').write_text('altitude_min: 60\naltitude_max: 50\n' + MAST)
    assert cli.main(['plan', str(tmp_path / 'mast.yaml')]) == 1
    assert 'mast.yaml:1: scenario.altitude_min = 60: expected less than altitude_max = 50' in (
        capsys.readouterr().err)


def test_limits_at_their_defaults_do_not_change_the_plan(tmp_path):
    (tmp_path / 'mast.yaml').write_text(MAST)
    legs = []
    for options in ((), ('--clearance', '10', '--altitude-min', '0')):
        out = tmp_path / 'plan.json'
        cli.main(['plan', str(tmp_path / 'mast.yaml'), '--budget', '0.05', '--json', str(out),
                  *options])
        legs.append(json.loads(out.read_text())['legs'])
    assert legs[0] == legs[1]
