# SPDX-License-Identifier: Apache-2.0
"""What the launch files start, with which parameters; test/nodes/test_launch.py flies them."""
import sys
import types
from itertools import pairwise
from pathlib import Path

import launch_stand_in
import pytest
import yaml

from uav_task_alloc import params
from uav_task_alloc.nodes.ros.bridge_shutdown import UPLOAD_TIMEOUT
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


def test_finding_35_the_demo_serves_the_vehicles_of_its_scenario_only_on_loopback(moved):
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


def test_the_nodes_of_a_demo_use_loopback_unless_a_discovery_range_is_set(monkeypatch):
    monkeypatch.delenv('ROS_AUTOMATIC_DISCOVERY_RANGE', raising=False)
    assert {words.env.get('ROS_AUTOMATIC_DISCOVERY_RANGE')
            for words in started('demo').values()} == {'LOCALHOST'}
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    assert all(not words.env for words in started('demo').values())


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_finding_37_allocator_and_bridge_get_the_values_of_the_scenario(name, moved):
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
    # until a UAV reports its battery; none has less
    assert values(nodes['allocator'])['default_range'] == 3000.0


@pytest.mark.parametrize(('given', 'speedup'), [({}, 20), ({'speedup': '3'}, 3)])
def test_finding_37_a_demo_has_the_speedup_of_its_scenario_or_argument(moved, given, speedup):
    nodes = started('demo', scenario=moved, **given)
    assert {values(nodes[name])['speedup']
            for name in ('fleet_sim', 'scenario_player', 'live_view')} == {speedup}


@pytest.mark.parametrize(('given', 'speedup'), [({}, None), ({'speedup': '3'}, 3)])
def test_the_live_view_of_a_fleet_has_the_scenario_and_the_speedup(
        moved, tmp_path, given, speedup):
    view = values(started('fleet', scenario=moved, record=str(tmp_path / 'x.mcap'),
                          **given)['live_view'])
    assert view['scenario'] == moved
    assert view.get('speedup') == speedup  # otherwise it is measured


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_map_tiles_reach_the_live_view(name, tmp_path):
    (tmp_path / '7').mkdir()
    view = values(started(name, tiles=str(tmp_path), tiles_attribution='© us')['live_view'])
    assert (view['tiles'], view['tiles_attribution']) == (str(tmp_path), '© us')
    assert not view['record']


def test_a_demo_lives_by_the_clock_of_its_simulated_fleet():
    nodes = {name: values(words) for name, words in started('demo').items()}
    assert {name for name, given in nodes.items() if given.get('use_sim_time')} == {
        'allocator', 'mavlink_bridge', 'scenario_player', 'live_view'}


@pytest.mark.parametrize('simulated', [True, False])
def test_a_fleet_lives_by_simulated_time_where_the_argument_says_so(tmp_path, simulated):
    nodes = started('fleet', record=str(tmp_path / 'x.mcap'),
                    **({'use_sim_time': 'true'} if simulated else {}))
    assert {values(words).get('use_sim_time', False) for words in nodes.values()} == {simulated}


@pytest.mark.parametrize('name', ['demo', 'fleet', 'rviz'])
def test_each_launch_argument_is_described(name):
    described = launch_stand_in.show_args(ROOT / f'launch/{name}.launch.py')
    assert described
    for text in described.values():
        assert text[0].isupper() or text.startswith('true: ')
        assert text.endswith('.')


@pytest.mark.parametrize(('name', 'word', 'nearest'), [
    ('fleet', 'scenari:=x.yaml', 'scenario'), ('demo', 'record_file:=x', 'record'),
    ('rviz', 'name_space:=x', 'namespace')])
def test_an_argument_that_launch_would_ignore_is_refused(monkeypatch, name, word, nearest):
    path = ROOT / f'launch/{name}.launch.py'
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', 'uav_task_alloc', path.name, word])
    with pytest.raises(ValueError, match=f'^{word}: expected an argument .* {nearest!r}$'):
        launch_stand_in.commands(path, {})
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', 'mine', 'all.launch.py', word])
    launch_stand_in.commands(path, {})  # of a launch file that includes this one


def test_without_a_scenario_a_fleet_has_the_values_of_its_files(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text('/**/allocator: {ros__parameters: {seed: 5, route_end: hold}}')
    assert values(started('fleet', allocator_params=str(path))['allocator']) == {
        'seed': 5, 'route_end': 'hold'}


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_every_parameter_that_a_launch_file_sets_exists(name, moved):
    for executable, words in started(name, scenario=moved).items():
        kind = params.NODES[executable]
        given = values(words)
        assert given.pop('use_sim_time', True) is True  # of ROS itself
        kind(**{key.replace('.', '__'): value for key, value in given.items()})


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_a_launched_bridge_saves_its_authority_where_the_argument_says(name):
    for given, state_dir in (({}, ''), ({'bridge_state_dir': 'kept'}, 'kept')):
        bridge = started(name, **given)['mavlink_bridge']
        assert values(bridge)['state_dir'] == state_dir
        assert (values(bridge)['relaunch'] == 'automatic') is (name == 'demo')


def test_a_launched_allocator_keeps_clear_of_the_ground_of_the_argument():
    assert values(started('fleet')['allocator'])['terrain'] == ''
    given = started('fleet', terrain=__file__)['allocator']
    assert values(given)['terrain'] == __file__


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
    ('fleet', {'terrain': '/none.tif'}, 'terrain:=/none.tif: expected a file'),
    ('fleet', {'speedup': 'fast'}, 'speedup:=fast: expected a number'),
    ('fleet', {'speedup': '1000'}, 'speedup = 1000.0: expected float in [0.1, 100]'),
    ('fleet', {'allocator_params': '/none.yaml'}, 'allocator_params:=/none.yaml: expected a para'),
    ('fleet', {'bridge_params': str(ROOT / 'README.md')}, 'expected a parameter file'),
    ('demo', {'record': '/none/x.mcap'}, 'record:=/none/x.mcap: expected a file that does'),
    ('fleet', {'record': str(ROOT / 'README.md')}, 'expected a file that does not exist'),
    ('demo', {'tiles': '/none'}, "tiles = '/none': expected a folder"),
    ('fleet', {'tiles': '/none'}, "tiles = '/none': expected a folder"),
])
def test_finding_36_nothing_is_started_before_all_arguments_are_valid(
        name, given, refusal, monkeypatch):
    started_nodes = []
    monkeypatch.setattr(launch_stand_in.Node, 'starts',
                        lambda *_: started_nodes.append(1) or [])
    with pytest.raises(ValueError) as refused:
        launch_stand_in.commands(ROOT / f'launch/{name}.launch.py', given)
    assert refusal in str(refused.value)
    assert not started_nodes


def actions_after(words, status):
    """What a launch file does after a node has exited."""
    event = types.SimpleNamespace(returncode=status)
    return words.on_exit(event, launch_stand_in.Context(words.given))


@pytest.mark.parametrize('name', ['demo', 'fleet'])
@pytest.mark.parametrize('executable', ['allocator', 'mavlink_bridge'])
def test_finding_36_a_node_that_dies_is_restarted_with_its_parameters(name, executable):
    words = started(name)[executable]
    for status in (-9, 70, 0, 1, 1):
        log, timer = actions_after(words, status)
        assert log.msg == f'{executable} has exited with status {status}: restarted in ' \
            f'{timer.period:g} s'
        [restarted] = [each for action in timer.actions for each in action.starts(words.given)]
        assert restarted == words


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_finding_36_a_bad_parameter_ends_the_launch_without_a_restart(name):
    [end] = actions_after(started(name)['mavlink_bridge'], 1)
    assert end.reason == 'mavlink_bridge refuses its parameters, see its error above'


@pytest.mark.parametrize('name', ['demo', 'fleet'])
def test_finding_36_the_end_of_a_viewer_ends_nothing(name, tmp_path, monkeypatch):
    monkeypatch.setattr(launch_stand_in, 'INSTALLED', {'rviz2', 'tf2_ros'})
    nodes = started(name, rviz='true', record=str(tmp_path / 'x.mcap'))
    assert {'live_view', 'rviz2', 'static_transform_publisher'} <= set(nodes)
    for viewer in ('live_view', 'rviz2', 'static_transform_publisher'):
        assert nodes[viewer].on_exit is None


def test_a_bridge_has_time_to_complete_an_upload_before_sigterm():
    assert started('fleet')['mavlink_bridge'].patience > UPLOAD_TIMEOUT


def test_short_runs_double_the_delay_of_the_next_restart():
    policy = RestartPolicy()
    delays = []
    for duration in (5.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 100.0, 1.0):
        assert policy.on_exit(70, duration) is RestartVerdict.RESTART
        delays.append(policy.delay)
    assert delays == [1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0, 1.0, 2.0]


def test_finding_36_a_node_that_refuses_its_parameters_five_times_is_given_up():
    policy = RestartPolicy()
    verdicts = [policy.on_exit(status, 1.0) for status in (-9, 1, 1, 70, *[1] * 5)]
    assert verdicts == [RestartVerdict.RESTART] * 8 + [RestartVerdict.GIVE_UP]
    assert RestartPolicy().on_exit(1, 1.0) is RestartVerdict.END_ALL
