# SPDX-License-Identifier: Apache-2.0
"""What the launch files start, with which parameters; test/nodes/test_launch.py flies them."""
import types
from itertools import pairwise
from pathlib import Path

import launch_stand_in
import pytest
import yaml

from uav_task_alloc import params
from uav_task_alloc.nodes.ros import bridge_shutdown as bridge_end
from uav_task_alloc.nodes.ros.restart_policy import RestartPolicy, RestartVerdict

ROOT = Path(__file__).parent.parent
MOVED = """
seed: 4000000000
speedup: 20
route_end: home
origin: {latitude: -33.9, longitude: 151.2, altitude_amsl: 40.0}
uavs:
  - {id: drone_7, system_id: 7, position: [0, 0, 0], range: 3000, capabilities: [camera, winch]}
  - {id: drone_9, system_id: 9, position: [50, 0, 0], range: 5000}
  - {id: drone_11, system_id: 11, position: [99, 0, 0]}
tasks:
  - {id: t1, position: [10, 20, 30]}
"""


def started(name, **given):
    """{executable: words} of a launch file of this package."""
    found = launch_stand_in.commands(ROOT / f'launch/{name}.launch.py', given)
    return {words[1]: words for words in found}


def values(words):
    """The parameters of a command; a file's are read."""
    found = {}
    for flag, value in pairwise(words):
        if flag == '--params-file':
            [content] = yaml.safe_load(Path(value).read_text()).values()
            found |= content['ros__parameters']
        elif flag == '-p':
            key, _, text = value.partition(':=')
            found[key] = yaml.safe_load(text)
    return found


@pytest.fixture
def moved(tmp_path):
    path = tmp_path / 'moved.yaml'
    path.write_text(MOVED)
    return str(path)


def test_finding_35_the_demo_listens_on_loopback_to_the_vehicles_of_its_scenario_alone(moved):
    nodes = started('demo', scenario=moved)
    bridge = values(nodes['mavlink_bridge'])
    [connection] = bridge['connections']
    host, port = connection.removeprefix('udpin:').split(':')
    assert host == '127.0.0.1'
    assert values(nodes['fleet_sim'])['target'] == f'127.0.0.1:{port}'
    assert port != '14550'
    assert bridge['system_ids'] == [7, 9, 11]
    assert bridge['takeoff'] is True


def test_finding_35_two_demos_do_not_share_a_port():
    ports = {values(started('demo')['mavlink_bridge'])['connections'][0] for _ in range(3)}
    assert len(ports) > 1


def test_the_nodes_of_a_demo_stay_on_this_machine_unless_told(monkeypatch):
    monkeypatch.delenv('ROS_AUTOMATIC_DISCOVERY_RANGE', raising=False)
    assert {words.env.get('ROS_AUTOMATIC_DISCOVERY_RANGE')
            for words in started('demo').values()} == {'LOCALHOST'}
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    assert all(not words.env for words in started('demo').values())


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_finding_37_allocator_and_bridge_have_the_values_of_the_scenario(name, moved):
    nodes = started(name, scenario=moved)
    allocator, bridge = values(nodes['allocator']), values(nodes['mavlink_bridge'])
    for node in (allocator, bridge):
        assert [node[f'origin.{key}'] for key in ('latitude', 'longitude', 'altitude_amsl')] == [
            -33.9, 151.2, 40.0]
    assert allocator['route_end'] == 'home'
    assert allocator['seed'] == 4000000000 % 2**31  # what a parameter of ROS holds
    assert bridge['system_ids'] == [7, 9, 11]
    assert bridge['uav_id_pattern'] == 'drone_{sysid}'
    assert bridge['capabilities'] == ['drone_7:camera,winch']


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_finding_38_the_ranges_of_a_scenario_reach_the_nodes(name, moved):
    nodes = started(name, scenario=moved)
    assert values(nodes['mavlink_bridge'])['full_ranges'] == [
        'drone_7:3000.0', 'drone_9:5000.0', 'drone_11:10000000.0']
    # until a battery was heard; nobody has less
    assert values(nodes['allocator'])['default_range'] == 3000.0


@pytest.mark.parametrize(('given', 'speedup'), [({}, 20), ({'speedup': '3'}, 3)])
def test_finding_37_a_demo_is_as_fast_as_its_scenario_says_unless_told(moved, given, speedup):
    nodes = started('demo', scenario=moved, **given)
    assert {values(nodes[name])['speedup']
            for name in ('fleet_sim', 'scenario_player', 'live_view')} == {speedup}


def test_without_a_scenario_a_fleet_has_the_values_of_its_files(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text('/**/allocator: {ros__parameters: {seed: 5, route_end: hold}}')
    assert values(started('fleet', allocator_params=str(path))['allocator']) == {
        'seed': 5, 'route_end': 'hold'}


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_every_parameter_that_a_launch_file_gives_is_one(name, moved):
    for executable, words in started(name, scenario=moved).items():
        kind = params.NODES[executable]
        kind(**{key.replace('.', '__'): value for key, value in values(words).items()})


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_a_launched_bridge_is_started_again_and_keeps_who_has_each_aircraft(name):
    for given, state_dir in (({}, ''), ({'bridge_state_dir': 'kept'}, 'kept')):
        bridge = started(name, **given)['mavlink_bridge']
        assert values(bridge)['state_dir'] == state_dir
        assert (values(bridge)['relaunch'] == 'automatic') is (name == 'demo')


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_rviz_comes_with_the_nodes_when_it_is_asked_for(name, monkeypatch):
    monkeypatch.setattr(launch_stand_in, 'INSTALLED', {'rviz2', 'tf2_ros'})
    path = ROOT / f'launch/{name}.launch.py'
    plain, shown = (launch_stand_in.commands(path, {'rviz': rviz}) for rviz in ('false', 'true'))
    assert [node[:2] for node in shown[:len(plain)]] == [node[:2] for node in plain]
    assert [node[0] for node in shown[len(plain):]] == ['rviz2', 'tf2_ros']


@pytest.mark.parametrize(('name', 'given', 'refusal'), [
    ('demo', {'rviz': 'true'}, "rviz:=true: expected rviz2 to be installed: package 'rviz2' not"),
    ('fleet', {'rviz': 'true'}, "rviz:=true: expected rviz2 to be installed: package 'rviz2' not"),
    ('demo', {'rviz': 'yes'}, 'rviz:=yes: expected true or false'),
    ('demo', {'scenario': '/none.yaml'}, '/none.yaml: No such file or directory: expected a sc'),
    ('fleet', {'scenario': '/none.yaml'}, '/none.yaml: No such file or directory: expected a sc'),
    ('demo', {'speedup': 'fast'}, 'speedup:=fast: expected a number'),
    ('demo', {'speedup': '1000'}, 'speedup = 1000.0: expected float in [0.1, 100]'),
    ('fleet', {'bridge_params': '/none.yaml'}, 'bridge_params:=/none.yaml: expected a parameter'),
    ('fleet', {'allocator_params': '/none.yaml'}, 'allocator_params:=/none.yaml: expected a para'),
    ('fleet', {'bridge_params': str(ROOT / 'README.md')}, 'expected a parameter file'),
    ('demo', {'record': '/none/x.mcap'}, 'record:=/none/x.mcap: expected a file that is not'),
    ('fleet', {'record': str(ROOT / 'README.md')}, 'expected a file that is not there yet'),
])
def test_finding_36_nothing_is_started_before_all_arguments_are_good(
        name, given, refusal, monkeypatch):
    asked = []
    monkeypatch.setattr(launch_stand_in.Node, 'starts', lambda *_: asked.append(1) or [])
    with pytest.raises(ValueError) as refused:
        launch_stand_in.commands(ROOT / f'launch/{name}.launch.py', given)
    assert refusal in str(refused.value)
    assert not asked


def died(words, status):
    """What a launch file does about the end of a node."""
    event = types.SimpleNamespace(returncode=status)
    return words.on_exit(event, launch_stand_in.Context(words.given))


@pytest.mark.parametrize('name', ['demo', 'fleet'])
@pytest.mark.parametrize('executable', ['allocator', 'mavlink_bridge'])
def test_finding_36_a_node_that_dies_is_started_again_with_its_parameters(name, executable):
    words = started(name)[executable]
    for status in (-9, 70, 0, 1, 1):
        said, later = died(words, status)
        assert said.msg == f'{executable} has ended with status {status}: again in ' \
            f'{later.period:g} s'
        [again] = [again for action in later.actions for again in action.starts(words.given)]
        assert again == words


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_finding_36_a_bad_parameter_ends_the_launch_and_is_not_tried_again(name):
    [end] = died(started(name)['mavlink_bridge'], 1)
    assert end.reason == 'mavlink_bridge refuses what it is given, as it says above'


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_finding_36_the_end_of_a_viewer_ends_nothing(name, tmp_path, monkeypatch):
    monkeypatch.setattr(launch_stand_in, 'INSTALLED', {'rviz2', 'tf2_ros'})
    nodes = started(name, rviz='true', record=str(tmp_path / 'x.mcap'))
    assert {'live_view', 'rviz2', 'static_transform_publisher'} <= set(nodes)
    for viewer in ('live_view', 'rviz2', 'static_transform_publisher'):
        assert nodes[viewer].on_exit is None


def test_a_bridge_has_time_to_end_after_its_swap():
    assert started('fleet')['mavlink_bridge'].patience > bridge_end.LONGEST


def test_lives_that_are_short_make_the_next_one_wait_longer():
    restarts = RestartPolicy()
    delays = []
    for lived in (5.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 100.0, 1.0):
        assert restarts.died(70, lived) is RestartVerdict.AGAIN
        delays.append(restarts.delay)
    assert delays == [1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0, 1.0, 2.0]


def test_finding_36_a_node_that_refuses_again_and_again_is_given_up():
    restarts = RestartPolicy()
    verdicts = [restarts.died(status, 1.0) for status in (-9, 1, 1, 70, *[1] * 5)]
    assert verdicts == [RestartVerdict.AGAIN] * 8 + [RestartVerdict.GIVE_UP]
    assert RestartPolicy().died(1, 1.0) is RestartVerdict.END_ALL
