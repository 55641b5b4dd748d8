# SPDX-License-Identifier: Apache-2.0
import json
from xml.etree import ElementTree

import pytest

from uav_task_alloc.cli.report import write_flown
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.map_files.read import read_map_file
from uav_task_alloc.map_files.scenario_rows import ImportChoices, to_scenario
from uav_task_alloc.map_files.write import plan_shapes, write_map
from uav_task_alloc.mavlink.mission.files import write_missions
from uav_task_alloc.model import Leg, Plan
from uav_task_alloc.record.ground_truth import TrueSample
from uav_task_alloc.record.reported import AnnouncedTask
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.scenario.read import parse
from uav_task_alloc.scenario.values import TASK_TIMES
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

SCENARIO = parse("""
origin: {latitude: 47.3977, longitude: 8.5456, altitude_amsl: 488}
uavs: [{id: u1, position: [0, 0, 0]}, {id: u2, position: [9, 0, 0]}]
tasks:
  - {id: a, position: [100, 200, 40], value: 2, service_time: 4}
  - {id: b, position: [300, -50, 60], earliest: 0, latest: 90.5}
  - {id: c, position: [-300, 50, 60], payload: 1.5, release: 9,
     required_capabilities: [lidar, camera]}
zones:
  - {id: dome, shape: hemisphere, center: [200, 100, 10], radius: 30, margin: 2}
  - {id: wall, shape: polygon, vertices: [[0, 300], [50, 300], [50, 350]], z_max: 90}
""")
PLAN = Plan({'u1': ('a', 'b'), 'u2': ()}, {'c': 'no UAV reaches it'},
            legs={'u1': (Leg((), 230.0), Leg(((150.0, 20.0, 50.0),), 330.0)), 'u2': ()})


@pytest.fixture(params=['.geojson', '.kml'])
def map_file(request, tmp_path):
    path = tmp_path / f'plan{request.param}'
    write_map(path, SCENARIO.origin, plan_shapes(SCENARIO, PLAN))
    return path


def test_a_plan_that_is_imported_again_has_the_same_tasks_and_zones(map_file):
    made = to_scenario([read_map_file(map_file)], ImportChoices(SCENARIO.origin), 'again')
    again = parse(made.text)
    for before, after in zip(SCENARIO.tasks, again.tasks, strict=True):
        assert after.task.id == before.task.id
        assert after.task.position == pytest.approx(before.task.position, abs=0.01)
        assert (after.task.value, after.task.service_time) == (
            before.task.value, before.task.service_time)
        for key in (*TASK_TIMES, 'required_capabilities'):
            assert getattr(after.task, key) == getattr(before.task, key)
    dome, wall = (timed.zone for timed in again.zones)
    assert (dome.z_max, dome.margin, wall.z_max) == (40.0, 2.0, 90.0)
    assert all(30.0 <= ((x - 200) ** 2 + (y - 100) ** 2) ** 0.5 <= 30.1 for x, y in dome.vertices)
    assert wall.vertices == tuple(pytest.approx(corner, abs=1e-3)
                                  for corner in SCENARIO.zones[1].zone.vertices)
    assert [note for note in made.notes if 'as plans and flights are written' not in note] == []


def test_the_route_of_a_map_has_the_detours_and_ends_at_its_last_task(map_file):
    if map_file.suffix == '.geojson':
        features = json.loads(map_file.read_text())['features']
        route, = (each for each in features if each['properties'].get('kind') == 'route')
        places = route['geometry']['coordinates']
    else:
        root = ElementTree.parse(map_file).getroot()
        line, = root.iter('{http://www.opengis.net/kml/2.2}LineString')
        assert line[0].text == 'absolute'
        places = [[float(part) for part in row.split(',')] for row in line[1].text.split()]
    assert [round(place[2] - 488.0) for place in places] == [0, 40, 50, 60]
    assert places[0][:2] == pytest.approx([8.5456, 47.3977], abs=1e-8)


def test_a_task_that_is_left_out_says_why(map_file):
    assert 'no UAV reaches it' in map_file.read_text()


def test_missions_of_a_plan_that_are_imported_again_are_at_the_same_places(tmp_path):
    write_missions(SCENARIO, Plan(PLAN.routes, legs={'u1': (Leg((), 230.0),) * 2}), tmp_path)
    made = to_scenario([read_map_file(tmp_path / 'u1.plan')], ImportChoices(), 'again')
    again = [timed.task for timed in parse(made.text).tasks]
    flown = [timed.task for timed in SCENARIO.tasks[:2]]
    for before, after in zip(flown, again, strict=True):
        assert after.position == pytest.approx(before.position, abs=0.02)
        assert after.service_time == before.service_time
    assert made.notes == []


@pytest.mark.parametrize('suffix', ['.geojson', '.kml'])
def test_the_map_of_a_flight_has_tracks_states_and_zones(tmp_path, capsys, suffix):
    zone = encode_zone(SCENARIO.zones[0].zone, JSON_ZONE)
    record = [
        {'kind': 'origin', 'wall': 1.0, 'latitude': 47.3977, 'longitude': 8.5456,
         'altitude_amsl': 488.0},
        {'kind': 'zones', 'wall': 1.0, 'zones': [zone]},
        {'kind': 'zones', 'wall': 2.0, 'zones': []}]
    run = RunState()
    for line in record:
        run.apply(line)
    run.tasks['a'] = AnnouncedTask((100.0, 200.0, 40.0), 1.0)
    tracks = {'u1': [TrueSample(1.0, (0.0, 0.0, 0.0)), TrueSample(2.0, (0.0, 0.0, 30.0))],
              'u2': [TrueSample(1.0, (9.0, 0.0, 0.0))]}
    out = tmp_path / f'flight{suffix}'
    write_flown(out, run, tracks)
    assert capsys.readouterr().out == f'Map: {out}\n'
    elements = read_map_file(out).elements
    assert [(each.name, each.properties['kind']) for each in elements] == [
        ('a', 'task'), ('dome', 'zone'), ('u1', 'track')]
    assert elements[0].properties['state'] == 'no status'
    run.apply({'kind': 'statuses', 'wall': 3.0, 'statuses': [
        {'task': 'a', 'state': 'COMPLETED', 'uav': 'u1', 'reason': ''}]})
    run.apply({'kind': 'statuses', 'wall': 4.0, 'statuses': []})  # forgotten
    write_flown(out, run, tracks)
    assert read_map_file(out).elements[0].properties['state'] == 'COMPLETED'
    assert [place.altitude for place in elements[2].places] == [488.0, 518.0]


def test_a_flight_without_origin_has_no_map(tmp_path):
    with pytest.raises(InvalidValue, match='expected a recording with fleet_origin'):
        write_flown(tmp_path / 'a.kml', RunState(), {})
