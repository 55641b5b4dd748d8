# SPDX-License-Identifier: Apache-2.0
"""Mission files, read back by independent readers: MAVSDK's and pymavlink's."""
import importlib.util
import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from pymavlink import mavwp
from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc import scenario
from uav_task_alloc.actions import Action
from uav_task_alloc.errors import MissionError
from uav_task_alloc.geometry.frames import to_enu, to_geodetic
from uav_task_alloc.mavlink.mission.files import file_name, planned_mission, write_missions
from uav_task_alloc.model import Leg, Plan, Task

WORLD = """
route_end: home
origin: {latitude: -33.9, longitude: 18.4, altitude_amsl: 120.5}
uavs:
  - {id: u_px4, autopilot: px4, position: [0, 0, 0], home: [5, -7, 1]}
  - {id: u_ardu, autopilot: ardupilot, position: [10, 0, 0], cruise_speed: 12}
  - {id: idle, position: [20, 0, 0]}
tasks:
  - {id: a, position: [300, 400, 50], service_time: 2.5, acceptance_radius: 4}
  - {id: b, position: [-200, 500.25, 61.125]}
  - {id: c, position: [100, 900, 70], service_time: 7}
zones:
  - {id: dome, shape: hemisphere, center: [150, 200, 0], radius: 60}
  - {id: mast, shape: cylinder, center: [2000, 0], radius: 30, margin: 9}
  - {id: field, shape: polygon, vertices: [[900, 0], [950, 0], [920, 40]]}
"""
ROUTES = {'u_px4': ('b', 'a'), 'u_ardu': ('c',), 'idle': ()}
LEGS = {'u_px4': (Leg((), 1.0), Leg(((150.0, 300.0, 70.0), (160.0, 200.0, 80.0)), 1.0),
                  Leg(((100.0, 100.0, 60.0),), 1.0)),
        'u_ardu': (Leg((), 1.0), Leg((), 1.0)), 'idle': ()}
PLACES = {  # [m] ENU in order, written down by hand
    'u_px4': [(-200.0, 500.25, 61.125), (150.0, 300.0, 70.0), (160.0, 200.0, 80.0),
              (300.0, 400.0, 50.0), (100.0, 100.0, 60.0)],
    'u_ardu': [(100.0, 900.0, 70.0)], 'idle': []}
HOMES = {'u_px4': (5.0, -7.0, 1.0), 'u_ardu': (10.0, 0.0, 0.0), 'idle': (20.0, 0.0, 0.0)}
ONE = 1.0001e-7  # [deg]


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    path = tmp_path_factory.mktemp('world') / 'world.yaml'
    path.write_text(WORLD)
    return scenario.load(path)


@pytest.fixture(scope='module')
def folder(world, tmp_path_factory):
    folder = tmp_path_factory.mktemp('missions') / 'made' / 'here'
    write_missions(world, Plan(ROUTES, legs=LEGS, returns=True), folder)
    return folder


def assert_at(world, place, point):
    """Degrees and metres AMSL agree with an ENU point."""
    latitude, longitude, altitude = to_geodetic(world.origin, point)
    assert place[0] == pytest.approx(latitude, abs=ONE)
    assert place[1] == pytest.approx(longitude, abs=ONE)
    assert place[2] == pytest.approx(altitude, abs=1e-3)


def test_each_uav_has_both_files_and_nothing_else_is_written(folder):
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        f'{uav}.{kind}' for uav in ROUTES for kind in ('plan', 'waypoints'))


@pytest.mark.parametrize('uav', ROUTES)
def test_pymavlink_reads_home_and_the_items_in_order_from_waypoints(world, folder, uav):
    loader = mavwp.MAVWPLoader()
    count = loader.load(str(folder / f'{uav}.waypoints'))
    items = [loader.wp(i) for i in range(count)]
    assert [item.seq for item in items] == list(range(count))
    assert [item.current for item in items] == [1] + [0] * (count - 1)
    assert_at(world, (items[0].x, items[0].y, items[0].z), HOMES[uav])
    flown = [item for item in items[1:] if item.command != d.MAV_CMD_NAV_RETURN_TO_LAUNCH]
    assert all((item.frame, item.command, item.autocontinue) == (0, 16, 1) for item in flown)
    for item, point in zip(flown, PLACES[uav], strict=True):
        assert_at(world, (item.x, item.y, item.z), point)
    returns = [d.MAV_CMD_NAV_RETURN_TO_LAUNCH] * bool(PLACES[uav])
    assert [item.command for item in items[1:]][-1:] == returns


@pytest.mark.parametrize('uav', ROUTES)
def test_both_files_hold_what_the_bridge_would_upload(world, folder, uav):
    scenario_uav = next(each for each in world.uavs if each.id == uav)
    route = Plan(ROUTES, legs=LEGS, returns=True).route(uav)
    sent = planned_mission(world, scenario_uav, route).items
    loader = mavwp.MAVWPLoader()
    loader.load(str(folder / f'{uav}.waypoints'))
    rows = json.loads((folder / f'{uav}.plan').read_text())['mission']['items']
    assert len(sent) == len(rows) == loader.count() - 1
    for seq, (item, row) in enumerate(zip(sent, rows, strict=True), 1):
        line, frame = loader.wp(seq), 0 if item.frame == d.MAV_FRAME_GLOBAL_INT else item.frame
        assert (line.command, line.frame) == (row['command'], row['frame']) == (item.command,
                                                                                frame)
        for text, number, value in zip(
                (line.param1, line.param2, line.param3, line.param4), row['params'], item.params,
                strict=False):
            assert text == value or (math.isnan(text) and math.isnan(value))
            assert number == value or (number is None and math.isnan(value))
        assert [round(line.x * 1e7), round(line.y * 1e7)] == [item.x, item.y]


def test_the_files_follow_the_rules_of_each_autopilot(folder):
    ardupilot, px4 = (json.loads((folder / f'{uav}.plan').read_text())['mission']
                      for uav in ('u_ardu', 'u_px4'))
    assert (ardupilot['firmwareType'], px4['firmwareType']) == (3, 12)
    assert (ardupilot['cruiseSpeed'], ardupilot['hoverSpeed']) == (12.0, 12.0)
    assert ardupilot['items'][0]['params'][:4] == [7.0, 0.0, 0.0, 0.0]
    task = next(item for item in px4['items'] if item['params'][0])
    assert task['params'][:4] == [2.5, 4.0, 0.0, None]  # hold [s], radius [m], -, any yaw


REQUIRED = {'type': str, 'frame': int, 'command': int, 'params': list, 'autoContinue': bool,
            'doJumpId': int}


@pytest.mark.parametrize('uav', ROUTES)
def test_a_plan_has_the_published_format(world, folder, uav):
    """docs.qgroundcontrol.com, "Plan File Format"."""
    read = json.loads((folder / f'{uav}.plan').read_text(), parse_constant=pytest.fail)
    assert (read['fileType'], read['version']) == ('Plan', 1)
    assert isinstance(read['groundStation'], str)
    mission = read['mission']
    assert (mission['version'], mission['vehicleType']) == (2, 2)
    assert_at(world, mission['plannedHomePosition'], HOMES[uav])
    for number, item in enumerate(mission['items'], 1):
        assert all(type(item[key]) is kind for key, kind in REQUIRED.items())
        assert (item['type'], item['doJumpId'], len(item['params'])) == ('SimpleItem', number, 7)
        assert all(isinstance(value, float) or value is None for value in item['params'][:4])
        if item['command'] != d.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            assert (item['AltitudeMode'], item['AMSLAltAboveTerrain']) == (2, None)
            assert item['Altitude'] == item['params'][6]
    assert read['rallyPoints'] == {'version': 2, 'points': []}


def test_a_zone_is_a_fence_unless_the_path_passes_over_it(folder, world):
    fences = {uav: json.loads((folder / f'{uav}.plan').read_text())['geoFence'] for uav in ROUTES}
    assert [len(fences[uav]['circles']) for uav in ('u_px4', 'u_ardu', 'idle')] == [1, 2, 2]
    mast, = fences['u_px4']['circles']
    assert (mast['inclusion'], mast['circle']['radius'], mast['version']) == (False, 30.0, 1)
    assert_at(world, (*mast['circle']['center'], to_geodetic(
        world.origin, (2000.0, 0.0, 0.0))[2]), (2000.0, 0.0, 0.0))
    field, = fences['idle']['polygons']
    assert (field['inclusion'], field['version'], len(field['polygon'])) == (False, 1, 3)


MAVSDK = """
import json, sys
from mavsdk.autopilot import Autopilot
from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.mission_raw.mission_raw import MissionRaw
from pymavlink.dialects.v20 import ardupilotmega as d

read = {}
for path, autopilot in zip(sys.argv[1::2], map(int, sys.argv[2::2])):
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    mavsdk.add_any_connection('raw://')  # no socket: bytes are handed over
    heartbeat = d.MAVLink_heartbeat_message(d.MAV_TYPE_QUADROTOR, autopilot, 0, 0, 4, 3)
    # a system is there, as a generic one, a moment before its heartbeat was read
    while not any(system.is_connected() and system.autopilot_type() != Autopilot.GENERIC
                  for system in mavsdk.get_systems()):
        mavsdk.pass_received_raw_bytes(bytes(heartbeat.pack(d.MAVLink(None, 1, 1))))
    mission = MissionRaw(mavsdk.get_systems()[0])
    imported = mission.import_qgroundcontrol_mission(path)
    read[path] = [[[i.seq, i.frame, i.command, i.x, i.y, i.z, i.param1] for i in items]
                  for items in (imported.mission_items, imported.geofence_items)]
    mission.destroy()
    mavsdk.destroy()
print('READ' + json.dumps(read), flush=True)
"""


@pytest.mark.skipif(importlib.util.find_spec('mavsdk') is None, reason='mavsdk is not installed')
def test_mavsdk_imports_the_plans(world, folder):
    autopilots = {'u_px4': 12, 'u_ardu': 3, 'idle': 3}
    arguments = [text for uav, number in autopilots.items()
                 for text in (str(folder / f'{uav}.plan'), str(number))]
    done = subprocess.run([sys.executable, '-c', MAVSDK, *arguments], capture_output=True,
                          text=True, timeout=60, check=False)
    line = next((line for line in done.stdout.splitlines() if line.startswith('READ')), None)
    assert line, done.stdout + done.stderr
    for path, (items, fences) in json.loads(line[4:]).items():
        uav = Path(path).stem
        if autopilots[uav] == 3:  # MAVSDK puts the planned home before them
            _, _, _, x, y, z, _ = items.pop(0)
            assert_at(world, (x / 1e7, y / 1e7, z), HOMES[uav])
        flown = [item for item in items if item[2] != d.MAV_CMD_NAV_RETURN_TO_LAUNCH]
        assert all(item[1:3] == [0, 16] for item in flown)
        for (_, _, _, x, y, z, _), point in zip(flown, PLACES[uav], strict=True):
            assert_at(world, (x / 1e7, y / 1e7, z), point)
        assert len(items) == len(flown) + bool(flown)
        assert {fence[2] for fence in fences} == {5002, 5004}  # exclusions


def test_an_earlier_mission_of_a_uav_that_now_has_no_task_is_overwritten(world, tmp_path):
    write_missions(world, Plan(ROUTES, legs=LEGS), tmp_path)
    write_missions(world, Plan(dict.fromkeys(ROUTES, ()), legs={}), tmp_path)
    assert json.loads((tmp_path / 'u_px4.plan').read_text())['mission']['items'] == []
    assert len((tmp_path / 'u_px4.waypoints').read_text().splitlines()) == 2


@pytest.mark.parametrize(('uav', 'name'), [
    ('uav_1', 'uav_1'), ('team/uav 1', 'team%2Fuav%201'), ('..', '%2E.'), ('/etc/x', '%2Fetc%2Fx'),
    ('a\\b:c*', 'a%5Cb%3Ac%2A'), ('été', '%C3%A9t%C3%A9'),
])
def test_any_id_makes_a_name_that_stays_in_its_folder(uav, name):
    assert file_name(uav) == name


def test_what_no_item_holds_is_refused_before_anything_is_written(world, tmp_path):
    tasks = tuple(replace(timed, task=replace(timed.task, service_time=70000.0))
                  for timed in world.tasks)
    with pytest.raises(MissionError, match='service_time = 70000: expected at most 65535 s'):
        write_missions(replace(world, tasks=tasks), Plan(ROUTES, legs=LEGS), tmp_path / 'none')
    assert not (tmp_path / 'none').exists()


FAR_WORLD = """
origin: {latitude: 47.4, longitude: 8.5, altitude_amsl: 488}
uavs:
  - {id: ground, autopilot: ardupilot, position: [0, 0, 0]}
  - {id: air, autopilot: ardupilot, position: [0, 0, 100], home: [0, 0, 0]}
  - {id: px4, autopilot: px4, position: [0, 0, 100], home: [0, 0, 0]}
tasks:
  - {id: a, position: [50000, 0, 60]}
  - {id: b, position: [50000, 12000, 80]}
"""


def test_finding_32_files_have_points_in_between_on_long_legs(tmp_path):
    tmp_path.joinpath('far.yaml').write_text(FAR_WORLD)
    far = scenario.load(tmp_path / 'far.yaml')
    route = Plan(dict.fromkeys(('ground', 'air', 'px4'), ('a', 'b')), legs=dict.fromkeys(
        ('ground', 'air', 'px4'), (Leg((), 1.0), Leg((), 1.0))))
    missions = write_missions(far, route, tmp_path)
    places = {mission.uav.id: [to_enu(far.origin, item.x / 1e7, item.y / 1e7, item.z)
                               for item in mission.items] for mission in missions}
    assert [len(places[uav]) for uav in ('ground', 'air', 'px4')] == [13, 14, 12]
    for uav, start in (('ground', 60.0), ('air', 100.0), ('px4', 100.0)):
        for x, _, z in places[uav][:-3]:
            assert z == pytest.approx(start + (60.0 - start) * x / 50_000.0, abs=0.01)
    assert 10_000.0 < places['px4'][0][0] < 11_200.0  # PX4 refuses what it refused before
    assert [round(y) for _, y, _ in places['air'][-4:]] == [0, 4_000, 8_000, 12_000]
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(tmp_path / 'air.waypoints')) == 15


SURVEY = (Action('gimbal', {'pitch': -1.5}), Action('trigger', {'distance': 25.0}),
          Action('roi', {'x': 50.0, 'y': 60.0, 'z': 2.0}), Action('speed', {'speed': 6.0}))


@pytest.mark.parametrize('uav', ['u_px4', 'u_ardu'])
def test_ways_and_actions_are_in_both_files(world, tmp_path, uav):
    way = ((0.0, 300.0, 50.0), (200.0, 300.0, 50.0), (200.0, 400.0, 50.0))
    tasks = [Task('F#1', way[0], path=way, actions=SURVEY),
             Task('F#2', way[2], path=way[::-1], actions=SURVEY[1:2])]
    plan = Plan({**dict.fromkeys(ROUTES, ()), uav: ('F#1', 'F#2')},
                legs={uav: (Leg((), 1.0), Leg((), 1.0))}, reversed=frozenset({'F#2'}))
    missions = write_missions(world, plan, tmp_path, tasks)
    sent = next(mission.items for mission in missions if mission.uav.id == uav)
    loader = mavwp.MAVWPLoader()
    loader.load(str(tmp_path / f'{uav}.waypoints'))
    rows = json.loads((tmp_path / f'{uav}.plan').read_text())['mission']['items']
    assert [loader.wp(seq).command for seq in range(1, loader.count())] == [
        row['command'] for row in rows] == [item.command for item in sent]
    for item, row, seq in zip(sent, rows, range(1, loader.count()), strict=True):
        line = loader.wp(seq)
        assert [line.param1, line.param2, line.param3] == pytest.approx(item.params[:3])
        assert [line.x, line.y] == pytest.approx(row['params'][4:6], abs=ONE)
        assert row['params'][:3] == pytest.approx(item.params[:3])
    flown = [i.position for i in sent if i.position]
    assert flown[:3] == list(way)
    assert flown[-4:-1] == list(way)  # from its last point, which is the first of `way`
    commands = [item.command for item in sent]
    assert commands.count(d.MAV_CMD_DO_SET_CAM_TRIGG_DIST) == 4
    speed = {'u_px4': -2.0, 'u_ardu': 12.0}[uav]
    assert [i.params[1] for i in sent if i.command == d.MAV_CMD_DO_CHANGE_SPEED] == [6.0, speed]
    roi = next(row for row in rows if row['command'] == d.MAV_CMD_DO_SET_ROI_LOCATION)
    assert_at(world, roi['params'][4:], (50.0, 60.0, 2.0))
