# SPDX-License-Identifier: Apache-2.0
"""Scenario files: what is read, what is refused and with which words, what is generated."""
import math
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from uav_task_alloc import scenario
from uav_task_alloc.errors import InvalidValue, ScenarioError
from uav_task_alloc.geometry.zones import zones_around
from uav_task_alloc.model import Shape, ThreatZone
from uav_task_alloc.scenario import checked_yaml, document
from uav_task_alloc.scenario.schema import TABLES

ROOT = Path(__file__).parents[2]
FILES = sorted(ROOT.glob('config/scenarios/*.yaml'))
UAV = 'uavs:\n  - {id: u1, position: [0, 0, 0]}\n'


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)
def test_every_file_that_comes_with_the_package_is_read(path):
    read = scenario.load(path)
    assert read.name == path.stem
    assert read.tasks
    assert read.uavs


def test_the_demo_has_the_announced_size():
    demo = scenario.load(ROOT / 'config/scenarios/demo.yaml')
    assert [uav.autopilot for uav in demo.uavs].count('px4') == 2
    assert [uav.system_id for uav in demo.uavs] == [1, 2, 3, 4]
    assert sum(uav.dies_at is not None for uav in demo.uavs) == 1
    assert sum(timed.at == 0.0 for timed in demo.tasks) == 20
    assert sum(timed.at > 0.0 for timed in demo.tasks) == 12
    assert {timed.zone.shape for timed in demo.zones} == set(Shape)
    assert sum(timed.appears > 0.0 for timed in demo.zones) == 1


def test_a_missing_key_has_its_default():
    read = scenario.parse(UAV, 'some/name.yaml')
    uav, = read.uavs
    assert (read.name, read.seed, read.origin.latitude) == ('name', 0, 47.397742)
    assert (uav.system_id, uav.autopilot, uav.home, uav.range) == (
        1, 'ardupilot', (0.0, 0.0, 0.0), math.inf)
    assert (read.tasks, read.zones, read.cancels, read.duration) == ((), (), (), 0.0)


def test_null_means_the_default():
    text = UAV.replace('}', ', range: null, home: ~, dies_at: }') + 'tasks:\nzones: null\n'
    assert scenario.parse(text) == scenario.parse(UAV)


def test_tasks_may_be_given_in_degrees():
    text = UAV + ('origin: {latitude: 47.0, longitude: 8.0, altitude_amsl: 400}\n'
                  'tasks:\n  - {id: t, latitude: 47.001, longitude: 8.0, altitude: 50}\n')
    x, y, z = scenario.parse(text).tasks[0].task.position
    assert (x, y, z) == pytest.approx((0.0, 111.2, 50.0), abs=0.1)


IN_DEGREES = 'origin: {latitude: 47.0, longitude: 8.0, altitude_amsl: 400}\n'


def test_uavs_may_start_at_degrees_and_have_a_home_there():
    read = scenario.parse(IN_DEGREES + """uavs:
  - {id: u1, latitude: 47.001, longitude: 8.0, altitude: 5}
  - {id: u2, position: [1, 2, 3], home: {latitude: 47.0, longitude: 8.001, altitude: 7}}
""")
    first, second = read.uavs
    assert first.position == pytest.approx((0.0, 111.2, 5.0), abs=0.1)
    assert first.home == first.position
    assert second.position == (1.0, 2.0, 3.0)
    assert second.home == pytest.approx((76.1, 0.0, 7.0), abs=0.1)


def test_zones_may_be_given_in_degrees():
    dome, column, prism = (timed.zone for timed in scenario.parse(UAV + IN_DEGREES + """zones:
  - {id: a, shape: hemisphere, latitude: 47.001, longitude: 8.0, altitude: 5, radius: 4}
  - {id: b, shape: cylinder, latitude: 47.001, longitude: 8.0, radius: 3, z_max: 9}
  - id: c
    shape: polygon
    z_min: 3
    vertices: [{latitude: 47.001, longitude: 8.0}, [1, 0], {latitude: 47, longitude: 8.001}]
""").zones)
    assert dome.center == pytest.approx((0.0, 111.2, 5.0), abs=0.1)
    assert column.center == pytest.approx((0.0, 111.2, 0.0), abs=0.1)
    assert column.z_max == 9.0
    assert prism.vertices[1] == (1.0, 0.0)
    assert [*prism.vertices[0], *prism.vertices[2]] == pytest.approx(
        [0.0, 111.2, 76.1, 0.0], abs=0.1)
    assert (prism.z_min, prism.z_max) == (3.0, math.inf)


def test_each_shape_of_zone_is_read():
    zones = scenario.parse(UAV + """zones:
  - {id: a, shape: hemisphere, center: [1, 2, 3], radius: 4, margin: 5}
  - {id: b, shape: cylinder, center: [1, 2], radius: 3, z_max: 9, appears: 7, vanishes: 8}
  - {id: c, shape: polygon, vertices: [[0, 0], [1, 0], [0, 1]], z_min: -.inf}
""").zones
    assert [timed.zone for timed in zones] == [
        ThreatZone.hemisphere('a', (1, 2, 3), 4.0, 5.0),
        ThreatZone.cylinder('b', (1, 2), 3.0, z_max=9.0),
        ThreatZone.polygon('c', [(0, 0), (1, 0), (0, 1)])]
    assert (zones[1].appears, zones[1].vanishes) == (7.0, 8.0)


def test_arrivals_are_reproducible_sorted_and_outside_zones():
    text = UAV + """seed: 5
zones: [{id: z, shape: cylinder, center: [50, 50], radius: 30, appears: 60}]
arrivals: {count: 30, between: [10, 20], area: [[0, 0, 40], [100, 100, 60]], service_time: 2}
"""
    read = scenario.parse(text)
    assert scenario.parse(text) == read
    assert scenario.parse(text.replace('seed: 5', 'seed: 6')).tasks != read.tasks
    times = [timed.at for timed in read.tasks]
    assert times == sorted(times)
    assert all(10.0 <= time <= 20.0 for time in times)
    assert [timed.task.id for timed in read.tasks][:2] == ['a01', 'a02']
    zones = [timed.zone for timed in read.zones]
    assert not any(zones_around(timed.task.position, zones) for timed in read.tasks)


REFUSED = {
    '': ':1: the file is empty: expected a scenario',
    'uavs: [': ':1: ',
    'uavs: []\n': ':1: scenario.uavs = []: expected at least one UAV',
    'name: x\n': ':1: scenario.uavs is missing: expected a list of UAVs',
    '- 1\n': ':1: scenario = [1]: expected a mapping with name, seed',
    'uavs: 3\n': ':1: scenario.uavs = 3: expected a list of UAVs',
    UAV + 'uavz: 1\n': ":3: scenario: unknown key 'uavz': expected one of name, ",
    UAV + 'uavs: 1\n':
        ":3: scenario: key 'uavs' is given twice: expected it once; first in line 1",
    UAV.replace('id: u1, ', ''): ':2: scenario.uavs[0].id is missing: expected letters',
    UAV.replace('u1', 'u__1'): ':2: scenario.uavs[0].id = u__1: expected letters, digits and s',
    UAV.replace('u1', 'u' * 201): f':2: scenario.uavs[0].id = {"u" * 40}: expected letters',
    UAV + 'tasks:\n  - {id: a b, position: [1, 1, 1]}\n':
        ':4: scenario.tasks[0].id = a b: expected letters',
    UAV.replace('[0, 0, 0]', '&a [0, 0, *a]'): ':2: a value contains itself',
    UAV.replace('u1', '1u'): ':2: scenario.uavs[0].id = 1u: expected letters',
    UAV.replace('[0, 0, 0]', '[0, 0]'):
        ':2: scenario.uavs[0].position = [0, 0]: expected three numbers [x, y, z]',
    UAV.replace('[0, 0, 0]', '[0, .nan, 0]'):
        ':2: scenario.uavs[0].position[1] = .nan: expected a number',
    UAV.replace('[0, 0, 0]', '[0, 0, .inf]'):
        ':2: scenario.uavs[0].position[2] = .inf: expected a number',
    UAV.replace('}', ', range: -1}'):
        ':2: scenario.uavs[0].range = -1: expected a number in [0, inf]',
    UAV.replace('}', ', autopilot: apm}'):
        ':2: scenario.uavs[0].autopilot = apm: expected one of ardupilot, px4',
    UAV.replace('}', ', system_id: 256}'):
        ':2: scenario.uavs[0].system_id = 256: expected a whole number in [1, 255]',
    UAV + '  - {id: u1, position: [1, 1, 1]}\n':
        ':3: scenario.uavs[1].id = u1: expected one not given before; first in line 2',
    UAV + '  - {id: u2, position: [1, 1, 1], system_id: 1}\n':
        ':3: scenario.uavs[1].system_id = 1: expected one not given before; first in line 2',
    UAV + 'tasks:\n  - {id: t, position: [1, 1, 1], value: 0}\n':
        ':4: scenario.tasks[0].value = 0: expected a number in (0, inf)',
    UAV + 'tasks:\n  - {id: t}\n':
        ':4: scenario.tasks[0].position is missing: expected either position, or latitude',
    UAV + 'tasks:\n  - {id: t, latitude: 1}\n':
        ':4: scenario.tasks[0].longitude is missing: expected all three of latitude',
    UAV + 'tasks:\n  - {id: t, position: [465100, 5270000, 50]}\n':
        ':4: scenario.tasks[0].position[1] = 5270000: expected a number of metres within 500 km',
    UAV + 'zones:\n  - {id: z, shape: cylinder, center: [465100, 5270000], radius: 5}\n':
        ':4: scenario.zones[0].center[1] = 5270000: expected a number of metres within 500 km',
    UAV + 'tasks:\n  - {id: t, latitude: 47.4, longitude: 8.5, altitude: 1e8}\n':
        ':4: scenario.tasks[0].altitude = 1e8: expected a number of metres within 500 km',
    UAV + 'tasks:\n  - {id: t, latitude: 40, longitude: 8, altitude: 50}\n':
        ':4: scenario.tasks[0].latitude = 40: expected a place within 500 km of the origin, 47.39',
    'uavs:\n  - {id: u1}\n':
        ':2: scenario.uavs[0].position is missing: expected either position, or latitude, longit',
    'uavs:\n  - {id: u1, position: [0, 0, 0], latitude: 47}\n':
        ':2: scenario.uavs[0].position = [0, 0, 0]: expected either position, or latitude',
    'uavs:\n  - {id: u1, latitude: 47.4, longitude: 8.5}\n':
        ':2: scenario.uavs[0].altitude is missing: expected all three of latitude, longitude, alt',
    'uavs:\n  - {id: u1, position: [0, 0, 0], home: 5}\n':
        ':2: scenario.uavs[0].home = 5: expected three numbers [x, y, z], or a mapping with latit',
    'uavs:\n  - {id: u1, position: [0, 0, 0], home: {latitude: 95, longitude: 8, altitude: 0}}\n':
        ':2: scenario.uavs[0].home.latitude = 95: expected a number in [-90, 90]',
    UAV + 'zones:\n  - {id: z, shape: cylinder, latitude: 47.4, radius: 5}\n':
        ':4: scenario.zones[0].longitude is missing: expected all of latitude, longitude',
    UAV + 'zones:\n  - {id: z, shape: cylinder, center: [0, 0], altitude: 3, radius: 5}\n':
        ':4: scenario.zones[0].altitude = 3: expected no such key for a cylinder',
    UAV + 'zones:\n  - {id: z, shape: cylinder, center: [0, 0], latitude: 47, radius: 5}\n':
        ':4: scenario.zones[0].center = [0, 0]: expected either center, or latitude and longitude',
    UAV + 'zones:\n  - {id: z, shape: polygon, vertices: [[0, 0], [1, 1], {latitude: 47.4}]}\n':
        ':4: scenario.zones[0].vertices[2].longitude is missing: expected a number in [-180, 180]',
    UAV + 'tasks:\n  - {id: t, position: [1, 1, 1], allowed_uavs: [u2]}\n':
        ":4: scenario.tasks[0].allowed_uavs = [u2]: expected one of the UAVs of this file; "
        "nearest is 'u1'",
    UAV + 'zones:\n  - {id: z, shape: cone}\n':
        ':4: scenario.zones[0].shape = cone: expected one of hemisphere, cylinder, polygon',
    UAV + 'zones:\n  - {id: z, shape: hemisphere, center: [0, 0, 0]}\n':
        ':4: scenario.zones[0].radius is missing: expected it for a hemisphere',
    UAV + 'zones:\n  - {id: z, shape: hemisphere, center: [0, 0], radius: 1}\n':
        ':4: scenario.zones[0].center = [0, 0]: expected three numbers [x, y, z]',
    UAV + 'zones:\n  - {id: z, shape: hemisphere, center: [0, 0, 0], radius: 1, z_max: 3}\n':
        ':4: scenario.zones[0].z_max = 3: expected no such key for a hemisphere',
    UAV + 'zones:\n  - {id: z, shape: polygon, vertices: [[0, 0], [1, 1], [1, 0], [0, 1]]}\n':
        ':4: scenario.zones[0]: zone z: vertices = ',
    UAV + 'zones:\n  - {id: z, shape: cylinder, center: [0, 0], radius: 1, appears: 5, '
          'vanishes: 5}\n':
        ':4: scenario.zones[0].vanishes = 5: expected a time after appears = 5',
    UAV + 'arrivals: {count: 1, between: [2, 1], area: [[0, 0, 0], [1, 1, 1]]}\n':
        ':3: scenario.arrivals.between = [2, 1]: expected the first time not after the last',
    UAV + 'tasks: [{id: a01, position: [1, 1, 1]}]\n'
          'arrivals: {count: 1, between: [1, 2], area: [[0, 0, 0], [1, 1, 1]]}\n':
        ':4: scenario.arrivals.prefix is missing: expected one that gives no id twice',
    UAV + 'zones: [{id: z, shape: cylinder, center: [0, 0], radius: 9}]\n'
          'arrivals: {count: 1, between: [1, 2], area: [[0, 0, 0], [1, 1, 1]]}\n':
        ':4: scenario.arrivals.area = [[0, 0, 0], [1, 1, 1]]: expected a box with room outside',
    UAV + 'tasks: [{id: north, position: [1, 1, 1]}]\ncancels:\n  - {task: nort, at: 1}\n':
        ":5: scenario.cancels[0].task = nort: expected one of the tasks of this file; "
        "nearest is 'north'",
    UAV + 'tasks: [{id: t, position: [1, 1, 1], at: 9}]\ncancels: [{task: t, at: 1}]\n':
        ':4: scenario.cancels[0].at = 1: expected not before it is announced at 9',
    UAV + 'name: "\x01"\n': ":3: character '\\x01': expected printable text",
    UAV + 'seed: 1.5\n': ':3: scenario.seed = 1.5: expected a whole number',
    '[' * 5000: ':1: nested too deep',
}


@pytest.mark.parametrize('text', REFUSED, ids=REFUSED.values())
def test_a_bad_file_is_refused_with_file_line_value_and_expectation(text, tmp_path):
    path = tmp_path / 'bad.yaml'
    path.write_text(text)
    with pytest.raises(ScenarioError) as refusal:
        scenario.load(path)
    assert str(refusal.value).startswith(f'{path}{REFUSED[text]}')
    assert '\n' not in str(refusal.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r'none\.yaml: No such file or directory: expected'):
        scenario.load(tmp_path / 'none.yaml')


def test_an_empty_path_is_refused():
    with pytest.raises(ScenarioError, match=r"^'': Is a directory: expected a scenario file"):
        scenario.load('')


def test_invalid_utf8_is_refused_with_its_line(tmp_path):
    (tmp_path / 'bad.yaml').write_bytes(b'name: x\nseed: \xff\n')
    with pytest.raises(ScenarioError, match=r'bad.yaml:2: byte 0xff: expected UTF-8 text'):
        scenario.load(tmp_path / 'bad.yaml')


@given(text=st.text(max_size=60))
@settings(max_examples=200, deadline=None)
def test_any_text_is_read_or_refused_with_its_line(text):
    with pytest.raises(ScenarioError, match=r'^f\.yaml:\d+: (?s:.*)expected'):
        scenario.parse(text, 'f.yaml')


@pytest.mark.parametrize('seed', range(3))
def test_a_generated_scenario_is_written_and_read_back_the_same(seed):
    generated = scenario.generate(seed, uavs=3, tasks=12, arrivals=4, base=seed == 1)
    assert scenario.parse(scenario.to_yaml(generated)) == generated
    assert (len(generated.uavs), len(generated.tasks), len(generated.zones)) == (3, 16, 3)
    assert scenario.generate(seed, uavs=3, tasks=12, arrivals=4, base=seed == 1) == generated


def test_the_demo_is_written_and_read_back_the_same():
    demo = scenario.load(ROOT / 'config/scenarios/demo.yaml')
    assert scenario.parse(scenario.to_yaml(demo)) == demo


def test_the_timeline_has_each_moment_once_in_order():
    moments = scenario.timeline(scenario.parse("""uavs:
  - {id: u1, position: [0, 0, 0], dies_at: 4}
tasks:
  - {id: t1, position: [1, 1, 1]}
  - {id: t2, position: [2, 2, 2], at: 4}
zones:
  - {id: z, shape: cylinder, center: [0, 9], radius: 1, appears: 2, vanishes: 4}
cancels: [{task: t1, at: 3}]
"""))
    seen = [(m.at, None if m.zones is None else len(m.zones), [t.id for t in m.tasks],
             [t.id for t in m.cancels], m.deaths) for m in moments]
    assert seen == [(0.0, 0, ['t1'], [], ()), (2.0, 1, [], [], ()), (3.0, None, [], ['t1'], ()),
                    (4.0, 0, ['t2'], [], ('u1',))]


def test_the_page_in_docs_is_up_to_date():
    assert (ROOT / 'docs/scenarios.md').read_text() == document.scenario_page()


def test_the_example_of_the_page_is_read():
    text = document.scenario_page().split('```yaml\n')[1].split('```')[0]
    assert len(scenario.parse(text).tasks) == 2


def test_every_key_has_a_description():
    for table in TABLES.values():
        for entry in table.values():
            assert entry.text
            assert entry.kind.description


@pytest.mark.parametrize(('text', 'shown'), [
    ('3', '3'), ('"3"', "'3'"), ('~', '~'), ('[1, 2, 3, 4, 5]', '[1, 2, 3, 4, ...]'),
    ('{a: 1}', 'a mapping')])
def test_a_refusal_shows_a_value_as_it_was_written(text, shown):
    assert checked_yaml.shown_yaml(checked_yaml.compose(text, 'f')) == shown


@pytest.mark.parametrize(('ids', 'pattern'), [
    ([('uav_1', 1), ('uav_12', 12)], 'uav_{sysid}'),
    ([('a1b', 1), ('a2b', 2)], 'a{sysid}b'),
    ([('u1_1', 1)], 'u1_{sysid}'),
    ([('u1_1', 1), ('u1_2', 2)], 'u1_{sysid}'),
])
def test_the_id_pattern_of_the_bridge_gives_the_ids_of_the_scenario(ids, pattern):
    rows = ''.join(f'  - {{id: {name}, system_id: {number}, position: [0, 0, 0]}}\n'
                   for name, number in ids)
    played = scenario.parse(f'uavs:\n{rows}')
    given = scenario.fleet_parameters(played)['mavlink_bridge']
    assert given['uav_id_pattern'] == pattern
    assert [pattern.format(sysid=number) for _, number in ids] == [name for name, _ in ids]


def test_ids_that_no_pattern_gives_are_refused():
    played = scenario.load(ROOT / 'config/scenarios/plan_only.yaml')
    with pytest.raises(InvalidValue) as refused:
        scenario.fleet_parameters(played)
    assert str(refused.value) == (
        "scenario plan_only: id of system_id 1 = 'scout': expected ids that one "
        "uav_id_pattern gives for all system ids, such as 'uav_1'")
