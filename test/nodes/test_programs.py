# SPDX-License-Identifier: Apache-2.0
"""Every executable: found by the ament index, stops in good order, refuses bad parameters."""
import math
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import fields
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from node_server import Forked
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SubmitTasks

from uav_task_alloc import parameter_field, params
from uav_task_alloc.nodes.conversions.messages import EVENTS, LATCHED, STATES
from uav_task_alloc.nodes.ros import run as nodes_run

pytestmark = pytest.mark.ros
SHARE = Path(get_package_share_directory('uav_task_alloc'))
DEMO = SHARE / 'config/scenarios/demo.yaml'
NEEDS = {'fleet_sim': ['-p', f'scenario:={DEMO}'], 'scenario_player': ['-p', f'scenario:={DEMO}'],
         'mavlink_bridge': ['-p', "connections:=['udpin:127.0.0.1:0']"]}


@pytest.mark.parametrize('name', [*params.NODES, 'demo'])
def test_an_executable_is_where_ros2_run_looks(name):
    path = Path(get_package_prefix('uav_task_alloc'), 'lib/uav_task_alloc', name)
    assert os.access(path, os.X_OK)


def test_the_command_line_of_a_workspace_is_on_path_and_no_node_is():
    words = ['bash', '-c', 'source "$0/setup.bash" && command -v uav_task_alloc allocator']
    found = subprocess.run([*words, str(SHARE.parents[2])], capture_output=True, text=True,
                           env={'PATH': '/usr/bin:/bin'}, check=False).stdout.split()
    assert [Path(path).parent for path in found] == [SHARE.parents[1] / 'bin']
    done = subprocess.run([sys.executable, found[0], '--version'], capture_output=True, text=True,
                          check=True)
    assert done.stdout.startswith('uav_task_alloc ')


@pytest.mark.parametrize('delay', [0.01, 0.02, 0.04, 0.1, 0.2, 0.3, 0.8])  # [s], as below
def test_the_command_line_ends_without_a_traceback_however_early_the_signal(delay):
    process = subprocess.Popen([SHARE.parents[1] / 'bin/uav_task_alloc', 'plan', DEMO,
                                '--budget', '600'], stderr=subprocess.PIPE, text=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert 'Traceback' not in err
    if process.returncode == -signal.SIGINT:  # that of sh, in its first milliseconds
        assert not err
        return
    assert process.returncode == 130
    last = err.splitlines()[-1]
    assert re.fullmatch(r'interrupted|stopped before the search.*|'  # a machine may be that fast
                        r'stopped after [\d.]+ s of 600 s: the best plan so far', last)


@pytest.mark.parametrize('name', params.NODES)
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_a_node_exits_in_order_on_a_signal(execute, probe, name, number):
    process = execute(name, *NEEDS.get(name, []))
    probe.until(lambda: name in probe.node.get_node_names())
    code, out = process.stop(number)
    assert code == 0, out
    assert 'Traceback' not in out


# [s]: while sh starts Python, while modules are imported, while the node is created
@pytest.mark.parametrize('delay', [0.01, 0.02, 0.04, 0.1, 0.2, 0.3, 0.5, 0.8])
@pytest.mark.parametrize('name', ['allocator', 'live_view'])
def test_a_node_ends_without_a_traceback_however_early_the_signal(execute, name, delay):
    process = execute(name)
    time.sleep(delay)
    code, out = process.stop()
    assert code in (0, -signal.SIGINT), out  # that of sh, in its first milliseconds
    assert 'Traceback' not in out
    others = [line for line in out.splitlines() if not re.match(r'\[(INFO|WARN)\] \[', line)]
    assert others in ([], [f'{name}: stopped during its start']) or 'Live' in out


@pytest.mark.parametrize(('name', 'given', 'text'), [
    ('allocator', 'solve_budget:=-1.0', 'solve_budget = -1.0: expected float in [0.001, 60] s'),
    ('allocator', 'route_end:=land', "route_end = 'land': expected one of hold, home"),
    ('allocator', 'seed:=many', "seed = 'many': expected int in [0, 2.14748e+09]"),
    ('mavlink_bridge', 'autopilot:=cleanflight', "autopilot = 'cleanflight': expected one of"),
    ('fleet_sim', 'scenario:=/nowhere.yaml', '/nowhere.yaml'),
    ('scenario_player', 'speedup:=0.0', 'speedup = 0.0: expected float in [0.1, 100]'),
])
def test_a_bad_start_parameter_ends_the_node_with_a_reason(start, name, given, text):
    process = start(name, *NEEDS.get(name, []), '-p', given)
    process.popen.wait(90)
    code, out = process.stop()
    assert code == 1
    assert text in out
    assert 'Traceback' not in out


def test_a_node_whose_callback_raises_ends_with_a_status_of_its_own(domain):
    code = ('from rclpy.node import Node\n'
            'from uav_task_alloc.nodes.ros.run import run\n'
            'class Faulty(Node):\n'
            '    def __init__(self):\n'
            "        super().__init__('faulty')\n"
            '        self.create_timer(0.01, lambda: 1 / 0)\n'
            'run(Faulty)')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          timeout=120, check=False)
    assert done.returncode == nodes_run.CRASHED, done.stderr
    assert 'ZeroDivisionError' in done.stderr


@pytest.fixture
def ask(server, tmp_path):
    """ask('allocator', '--help') -> exit status and output of what becomes no running node.

    With variables `env`, or a program that is no node, it is the installed executable.
    """
    def ask(name, *arguments, env=None):
        argv = [str(Path(get_package_prefix('uav_task_alloc'), 'lib/uav_task_alloc', name)),
                *arguments]
        log = tmp_path / 'asked.log'
        with open(log, 'w') as out:
            process = subprocess.Popen(
                argv, stdout=out, stderr=subprocess.STDOUT, env={**os.environ, **(env or {})},
            ) if env or name == 'demo' else Forked(server, argv, log)
        try:
            code = process.wait(60)
        finally:
            process.kill()
        assert 'Traceback' not in log.read_text()
        return code, log.read_text()
    return ask


@pytest.mark.parametrize('name', params.NODES)
def test_help_lists_each_parameter_and_needs_no_ros_graph(ask, name):
    code, out = ask(name, '--help', '--ros-args', '-p', 'seed:=1', env={'ROS_DOMAIN_ID': 'none'})
    assert code == 0
    words = ' '.join(out.split())
    for spec in fields(params.NODES[name]):
        star = ' *' if spec.metadata['fixed'] else ''
        name = f'{parameter_field.ros_name(spec)}{star}'
        assert f'{name}: {parameter_field.expectation(spec)}; default' in words
        assert spec.metadata['text'] in words
    assert 'see docs/parameters.md' not in out
    assert '--log-level LEVEL' in out


@pytest.mark.parametrize(('arguments', 'text'), [
    (['--bogus'], "'--bogus': expected --ros-args and its arguments"),
    (['--ros-args', '--bogus'], "['--bogus']: expected arguments of ROS after --ros-args"),
    (['--ros-args', '-p', 'seed'], '-p seed: expected -p NAME:=VALUE'),
    (['--ros-args', '-p', 'seed:=[1, a]'], '-p seed:=[1, a]: expected -p NAME:=VALUE'),
    (['--ros-args', '-r', '__ns:=bad ns'], '-r __ns:=bad ns: expected -r FROM:=TO'),
    (['--ros-args', '--log-level', 'loud'], '--log-level loud: expected --log-level debug, info'),
    (['--ros-args', '--params-file', 'none.yaml'],
     '--params-file none.yaml: expected a parameter file: No such file or directory'),
    (['--ros-args', '--params-file', '/'],
     '--params-file /: expected a parameter file: Is a directory'),
    (['--ros-args', '--params-file'], 'No file path provided.'),
], ids=str)
def test_a_command_line_that_ros_cannot_read_is_one_line_and_status_2(ask, arguments, text):
    code, out = ask('allocator', *arguments)
    assert (code, text in out.splitlines()[-1]) == (2, True), out
    assert len([line for line in out.splitlines() if '[rcl]' not in line]) == 1


@pytest.mark.parametrize(('content', 'code', 'text'), [
    ('', 2, 'expected a parameter file: there is no `ros__parameters:` in a section `NODE:`'),
    ('hello', 2, 'expected a parameter file: there is no `ros__parameters:` in a section `NODE:`'),
    ('a: [', 2, 'expected a parameter file: while parsing a flow node'),
    ('/**:\n  ros__parameters: 5', 2, '/**: ros__parameters = 5 are no names and values'),
    ('/**:\n  ros__parameters:\n    seed: [1, a]', 2,
     'expected a parameter file (Sequence should be of same type.'),
    ('/**/mavlink_bridge:\n  ros__parameters:\n    takeoff: true', 1,
     'expected parameters for /allocator or /**: it is for /**/mavlink_bridge'),
    ('/fleet/allocator:\n  ros__parameters:\n    seed: 1', 1, 'it is for /fleet/allocator'),
    ('allocator:\n  ros__parameters:\n    solve_buget: 1.0', 1,
     "unknown parameter 'solve_buget': expected one that --help lists; nearest is 'solve_budget'"),
    ('allocator:\n  ros__parameters:\n    origin: {latitud: 1.0}', 1,
     "nearest is 'origin.latitude'"),
    ('allocator:\n  ros__parameters:\n    takeoff: true', 1,
     "unknown parameter 'takeoff': expected one that --help lists; it is one of mavlink_bridge"),
    ('allocator:\n  ros__parameters:\n    solve_budget: fast', 1,
     "solve_budget = 'fast': expected float in [0.001, 60] s"),
])
def test_a_parameter_file_is_used_in_full_or_refused(ask, tmp_path, content, code, text):
    path = tmp_path / 'given.yaml'
    path.write_text(content)
    given, out = ask('allocator', '--ros-args', '--params-file', str(path))
    assert (given, text in out) == (code, True), out
    assert len(out.splitlines()) == 1


@pytest.mark.parametrize(('given', 'shown'), [('[1, 2]', '(1, 2)'), ('5', '5'), ('a', "'a'")])
def test_another_type_is_refused_for_a_list_of_texts(ask, given, shown):
    assert ask('mavlink_bridge', '--ros-args', '-p', f'connections:={given}') == (
        1, f'connections = {shown}: expected list of text\n')


def test_a_file_for_all_nodes_may_have_parameters_of_others(start, probe, tmp_path):
    path = tmp_path / 'fleet.yaml'
    path.write_text('/**:\n  ros__parameters: {takeoff: true, origin: {latitude: 1.5}}')
    start('allocator', '--params-file', str(path), '-r', '__ns:=/fleet')
    got = probe.call(GetParameters, '/fleet/allocator/get_parameters',
                     GetParameters.Request(names=['origin.latitude'])).values[0]
    assert got.double_value == 1.5


@pytest.mark.parametrize(('name', 'given', 'text'), [
    ('fleet_sim', (), "scenario = '': expected a scenario file, by --ros-args -p scenario:=..."),
    ('scenario_player', (), "scenario = '': expected a scenario file, by --ros-args -p scenario"),
    ('fleet_sim', ('scenario', DEMO, 'log_file', '/'), "log_file = '/': expected a file that can"),
    ('fleet_sim', ('scenario', DEMO, 'target', 'no.invalid:5'),
     "target = 'no.invalid:5': expected HOST:PORT with a known host"),
    ('live_view', ('out_dir', '/proc/none'), "out_dir = '/proc/none': expected a folder that can"),
    ('live_view', ('host', "''"), "host = '': expected an address of this machine, 0.0.0.0 for"),
    ('live_view', ('record', '/'), "record = '/': expected a file"),
    ('mavlink_bridge', ('tlog', '/'), "tlog = '/': expected a file that can be written"),
    ('mavlink_bridge', ('state_dir', '/proc/none'), "state_dir = '/proc/none': expected a folder"),
], ids=str)
def test_a_path_or_host_that_cannot_be_used_is_one_line(ask, name, given, text):
    words = [word for key, value in zip(given[::2], given[1::2], strict=True)
             for word in ('-p', f'{key}:={value}')]
    code, out = ask(name, '--ros-args', *words)
    assert (code, text in out) == (1, True), out
    assert len([line for line in out.splitlines() if '[INFO]' not in line]) == 1


def test_a_flag_without_its_value_is_named(ask):
    assert ask('live_view', '--record') == (
        2, '--record: expected a value after it; flags are --record\n')


def hidden(folder, package):
    """The environment of a machine without a package."""
    (folder / f'{package}.py').write_text(
        f'raise ModuleNotFoundError("No module named {package!r}", name={package!r})')
    return {'PYTHONPATH': f'{folder}:{os.environ["PYTHONPATH"]}'}


def test_a_page_without_aiohttp_says_what_to_install_and_the_node_goes_on(
        execute, probe, tmp_path):
    view = execute('live_view', '-p', 'port:=0', env=hidden(tmp_path, 'aiohttp'))
    probe.until(lambda: '0 of 0 tasks' in view.output())
    code, out = view.stop()
    assert code == 0
    assert ("no live page: page: aiohttp is not installed: expected pip install '.[view]' in the "
            'folder of uav_task_alloc') in out
    assert 'Traceback' not in out


def test_a_record_without_mcap_says_what_to_install(ask, tmp_path):
    assert ask('live_view', '--record', str(tmp_path / 'x.mcap'), env=hidden(
        tmp_path, 'mcap')) == (1, "record: mcap is not installed: expected pip install '.[view]' "
                                  'in the folder of uav_task_alloc\n')


@pytest.mark.parametrize(('given', 'code', 'text'), [
    (['--speedup', '0'], 1, '--speedup = 0.0: expected a number in [0.1, 100]'),
    (['--speedup', 'x'], 2, "--speedup = 'x'"), (['--limit', '-1'], 1, '--limit = -1.0: expected'),
    (['--bogus'], 2, "'--bogus' is unknown"), (['--out', '/proc/none'], 1, '/proc/none'),
    (['--scenario', 'none'], 1, 'none: No such file or directory: expected a scenario file'),
    (['--record', '/none/x.mcap'], 1, '--record = '), (['--record', '/'], 1, '--record = '),
], ids=str)
def test_the_demo_refuses_a_bad_option_in_one_line(ask, tmp_path, given, code, text):
    refused, out = ask('demo', '--out', str(tmp_path / 'out'), *given)
    assert (refused, text in out, len(out.splitlines())) == (code, True, 1), out


@pytest.mark.parametrize(('env', 'text'), [
    ({'PYTHONPATH': ''}, "allocator: No module named 'uav_task_alloc': expected a shell that has "
                         'sourced install/setup.bash'),
    ({'ROS_DOMAIN_ID': 'none'}, 'ROS_DOMAIN_ID is not an integral number'),
])
def test_an_environment_without_ros_is_one_line(ask, env, text):
    code, out = ask('allocator', env=env)
    assert (code, text in out, len(out.splitlines())) == (1, True, 1), out


@pytest.mark.parametrize(('chosen', 'used'), [(None, 'UDPv4'), ('SHM', 'SHM')])
def test_nodes_use_udp_unless_another_transport_is_chosen(monkeypatch, chosen, used):
    def init(**_):
        raise SystemExit(os.environ['FASTDDS_BUILTIN_TRANSPORTS'])
    monkeypatch.setattr(nodes_run.rclpy, 'init', init)
    monkeypatch.setattr(sys, 'argv', ['allocator'])
    monkeypatch.setattr(signal, 'signal', lambda *_: None)
    monkeypatch.setenv('FASTDDS_BUILTIN_TRANSPORTS', chosen or '')
    if chosen is None:
        monkeypatch.delenv('FASTDDS_BUILTIN_TRANSPORTS')
    with pytest.raises(SystemExit) as raised:
        nodes_run.run(object)
    assert raised.value.code == used


def test_a_whole_number_is_accepted_for_a_real_one(start, probe):
    start('allocator', '-p', 'solve_budget:=1')
    got = probe.call(GetParameters, '/allocator/get_parameters',
                     GetParameters.Request(names=['solve_budget'])).values[0]
    assert got.double_value == 1.0


@pytest.mark.parametrize('name', params.NODES)
def test_the_parameter_file_of_a_node_is_installed_and_read(start, probe, name):
    start(name, '--params-file', str(SHARE / f'config/{name}.yaml'), *NEEDS.get(name, []))
    kind = params.NODES[name]
    names = [parameter_field.ros_name(spec) for spec in fields(kind)]
    values = probe.call(GetParameters, f'/{name}/get_parameters',
                        GetParameters.Request(names=names)).values
    assert len(values) == len(names)
    described = probe.call(DescribeParameters, f'/{name}/describe_parameters',
                           DescribeParameters.Request(names=names)).descriptors
    for spec, shown in zip(fields(kind), described, strict=True):
        assert spec.metadata['text'] in shown.description


def put(probe, name, **value):
    return probe.call(SetParameters, '/allocator/set_parameters', SetParameters.Request(
        parameters=[Parameter(name=name, value=ParameterValue(**value))])).results[0]


def test_a_parameter_is_checked_when_it_is_changed(start, probe):
    start('allocator')
    double, text = ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_STRING
    assert put(probe, 'solve_budget', type=double, double_value=0.2).successful
    assert not put(probe, 'solve_budget', type=double, double_value=-0.2).successful
    answer = put(probe, 'route_end', type=text, string_value='land')
    assert (answer.successful, answer.reason) == (
        False, "route_end = 'land': expected one of hold, home")
    answer = put(probe, 'state_dir', type=text, string_value='/tmp')
    assert (answer.successful, answer.reason) == (False, 'state_dir is read at the start only')


@pytest.mark.parametrize(('level', 'shown'), [
    ('debug', {'DEBUG', 'INFO', 'WARN'}), ('info', {'INFO', 'WARN'}), ('warn', {'WARN'}),
    ('error', set())])
def test_the_log_level_selects_what_is_logged(start, probe, level, shown):
    """A plan, accepted tasks and the origin: INFO; a refused task: WARN; a start: DEBUG."""
    process = start('allocator', '--log-level', f'allocator:={level}')
    tasks = [m.Task(task_id=name, value=1.0) for name in ('t1', 'bad id')]
    request = SubmitTasks.Request(announcement=m.TaskAnnouncement(tasks=tasks))
    assert probe.call(SubmitTasks, '/allocator/submit_tasks', request).accepted
    states = probe.publisher(m.UavState, 'uav_states', STATES)
    events = probe.publisher(m.TaskEvent, 'task_events', EVENTS)
    plans = probe.collect(m.Allocation, 'allocation', LATCHED)
    statuses = probe.collect(m.TaskStatusArray, 'task_statuses', LATCHED)

    def planned():
        states.publish(m.UavState(uav_id='uav_1', available=True, battery=math.nan,
                                  range_remaining=math.nan, cruise_speed=math.nan))
        return plans and any(each.tasks for each in plans[-1].lists)

    def is_started():
        events.publish(m.TaskEvent(task_id='t1', uav_id='uav_1', event=m.TaskEvent.STARTED))
        return any(each.state == m.TaskStatus.ACTIVE for each in statuses[-1].statuses)

    probe.until(planned)
    probe.until(is_started)
    _, out = process.stop()
    expected = {"[allocator]: task 't1' started by uav_1": 'DEBUG',
                "[allocator]: task 't1' accepted": 'INFO', '[allocator]: plan ': 'INFO',
                '[allocator]: origin of the ENU frame: (47.3977420, 8.5455940, 488 m)': 'INFO',
                "[allocator]: task 'bad id' REJECTED: task_id": 'WARN'}
    found = {text: line[1:line.index(']')] for line in out.splitlines()
             for text in expected if text in line}
    assert found == {text: name for text, name in expected.items() if name in shown}


def test_a_namespace_moves_the_topics(start, probe):
    start('allocator', '-r', '__ns:=/fleet')
    probe.until(lambda: '/fleet/task_statuses' in dict(probe.node.get_topic_names_and_types()))


def test_the_core_runs_where_no_ros_is_sourced(tmp_path):
    env = {k: v for k, v in os.environ.items()
           if not k.startswith(('AMENT', 'ROS', 'COLCON', 'PYTHONPATH', 'LD_LIBRARY'))}
    env['PYTHONPATH'] = str(Path(__file__).parents[2])
    code = ('import sys, uav_task_alloc as u; '
            'print(u.plan([u.Uav("u1", (0, 0, 50))], [u.Task("t1", (9, 0, 50))]).routes); '
            'print(sorted(m for m in ("rclpy", "pymavlink", "matplotlib") if m in sys.modules))')
    done = subprocess.run([sys.executable, '-c', code], env=env, cwd=tmp_path,
                          capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["{'u1': ('t1',)}", '[]']
