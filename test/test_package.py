# SPDX-License-Identifier: Apache-2.0
"""The package as a whole: public names, launch files, interface files."""
import os
import re
import runpy
import signal
import subprocess
import sys
import time
import warnings
import zipfile
from pathlib import Path

import pytest
import yaml

import uav_task_alloc

ROOT = Path(__file__).parent.parent


def test_the_public_names_are_these():
    assert sorted(uav_task_alloc.__all__) == [
        'Objective', 'Plan', 'SOLVERS', 'Separation', 'Task', 'ThreatZone', 'Uav', 'detour',
        'plan']
    assert all(hasattr(uav_task_alloc, name) for name in uav_task_alloc.__all__)
    assert set(uav_task_alloc.__all__) <= set(dir(uav_task_alloc))


@pytest.mark.parametrize('path', sorted(ROOT.glob('launch/*.launch.py')), ids=lambda p: p.name)
def test_a_launch_file_compiles_and_builds_where_launch_is_installed(path):
    scope = {}
    code = compile(path.read_text(), str(path), 'exec')
    try:
        import launch_ros  # noqa: F401

        import launch  # noqa: F401
    except ImportError:
        assert 'generate_launch_description' in code.co_names
        return
    exec(code, scope)
    assert scope['generate_launch_description']().entities


def test_rviz_shows_the_topics_of_the_allocator_in_their_frame():
    config = yaml.safe_load((ROOT / 'config/allocation.rviz').read_text())['Visualization Manager']
    assert config['Global Options']['Fixed Frame'] == 'map'
    topics = {each['Class'].split('/')[1]: [] for each in config['Displays']}
    for each in config['Displays']:
        assert each['Enabled']
        if 'Topic' in each:
            topics[each['Class'].split('/')[1]].append(each['Topic']['Value'])
            assert each['Topic']['Durability Policy'] == 'Transient Local'
    assert topics == {'Grid': [], 'MarkerArray': ['/allocation_markers'],
                      'Polygon': ['/fence_area'],
                      'Path': [f'/uav_{k}/path' for k in range(1, 5)]}
    assert all(topic.split('/')[-1] in (ROOT / 'launch/rviz.launch.py').read_text()
               for topic in [*topics['MarkerArray'], *topics['Polygon'], *topics['Path']])


@pytest.mark.parametrize('path', sorted(ROOT.glob('msg_defs/*/*')), ids=lambda p: p.name)
def test_every_field_of_a_message_carries_a_comment(path):
    for line in path.read_text().splitlines():
        if re.match(r'\w', line) and '=' not in line.split('#')[0]:
            assert '#' in line, f'{path.name}: {line}'


@pytest.mark.parametrize('path', sorted(ROOT.glob('msg_defs/*/*')), ids=lambda p: p.name)
def test_every_interface_is_generated(path):
    cmake = (ROOT / 'msg_defs/CMakeLists.txt').read_text()
    assert f'"{path.parent.name}/{path.name}"' in cmake


@pytest.fixture(scope='module')
def wheel(tmp_path_factory):
    setuptools, folder = pytest.importorskip('setuptools', minversion='70.1'), tmp_path_factory
    assert setuptools  # has bdist_wheel
    out = folder.mktemp('wheel')
    subprocess.run([
        sys.executable, '-W', 'ignore', 'setup.py', '-q', 'egg_info', '--egg-base', out,
        'build', '--build-base', out, 'bdist_wheel', '--dist-dir', out], cwd=ROOT,
        check=True, capture_output=True)
    return next(out.glob('*.whl'))


def test_a_wheel_puts_the_command_line_on_path_and_no_node(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (entries,) = (archive.read(name).decode() for name in names
                      if name.endswith('entry_points.txt'))
    assert entries.split() == [  # hidden: the script of the same name starts it
        '[console_scripts]', '.uav_task_alloc', '=', 'uav_task_alloc.cli.entry:main']
    assert [name.partition('.data/')[2] for name in names if re.search(
        r'\.data/(scripts|data/(bin|lib))/', name)] == ['scripts/uav_task_alloc']


@pytest.fixture(scope='module')
def installed(wheel, tmp_path_factory):
    """The command line as pip installs it, and the environment to run it in."""
    pytest.importorskip('pip')
    folder = tmp_path_factory.mktemp('prefix with a space')
    subprocess.run([sys.executable, '-m', 'pip', 'install', '-q', '--no-deps', '--no-index',
                    '--no-compile', '--prefix', folder, wheel], check=True, capture_output=True)
    (path,) = folder.rglob('bin/uav_task_alloc')
    (package,) = folder.rglob('uav_task_alloc/__main__.py')
    return path, {**os.environ, 'PYTHONPATH': str(package.parents[1])}


def started(installed, *arguments, **options):
    """The installed command, as a shell with job control starts it."""
    path, env = installed
    return subprocess.Popen([path, *arguments], env=env, text=True, stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
                            **options)


@pytest.mark.parametrize('delay', [*range(0, 60, 2), 80, 100, 150, 200, 300])  # [ms]
def test_ctrl_c_in_the_start_of_an_installed_program_shows_no_traceback(installed, delay):
    process = started(installed, 'plan', 'config/scenarios/demo.yaml', '--budget', '600',
                      cwd=ROOT, start_new_session=True)
    time.sleep(delay / 1000.0)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=90)
    assert process.returncode in (130, -signal.SIGINT)
    assert (out, err) in (('', ''), ('', 'interrupted\n'))


def test_an_installed_program_keeps_arguments_status_input_and_links(installed, tmp_path):
    path, env = installed
    link, name = tmp_path / 'alloc', 'two words; $HOME'
    link.symlink_to(path)
    for program in (path, link):
        done = subprocess.run([program, 'plan', name], env=env, capture_output=True, text=True,
                              check=False)
        assert (done.returncode, done.stdout) == (1, '')
        assert done.stderr.startswith(f'{name}: No such file or directory')
    with started(installed, 'plan', '/dev/stdin') as process:
        _, err = process.communicate('uavs: 3\n')
    assert process.returncode == 1
    assert 'uavs' in err
    with started(installed, 'plan', '/dev/stdin') as process:  # it waits for its input
        process.terminate()
        process.wait(90)
    assert process.returncode == -signal.SIGTERM
    by_python = subprocess.run([sys.executable, path, '--version'], env=env, text=True,
                               capture_output=True, check=True)
    assert by_python.stdout == f'uav_task_alloc {uav_task_alloc.__version__}\n'


def test_the_python_versions_are_the_same_everywhere(monkeypatch):
    setuptools, given = pytest.importorskip('setuptools'), {}
    monkeypatch.setattr(setuptools, 'setup', lambda **kwargs: given.update(kwargs))
    monkeypatch.chdir(ROOT)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # those of setuptools
        runpy.run_path('setup.py')
    classified = [each.rpartition(' ')[2] for each in given['classifiers']][1:]
    low, high = re.fullmatch(r'>=3\.(\d+),<3\.(\d+)', given['python_requires']).groups()
    assert classified == [f'3.{minor}' for minor in range(int(low), int(high))]
    ci = yaml.safe_load((ROOT / '.github/workflows/ci.yml').read_text())
    assert ci['jobs']['python']['strategy']['matrix']['python-version'] == classified
    assert f'Python {classified[0]} to {classified[-1]}' in (ROOT / 'README.md').read_text()
    ruff = (ROOT / 'ruff.toml').read_text()
    assert f'target-version = "py3{low}"' in ruff


def test_the_version_is_the_same_everywhere():
    places = {
        re.search(r"version='([\d.]+)'", (ROOT / 'setup.py').read_text()).group(1),
        *(re.search(r'<version>([\d.]+)', (ROOT / p).read_text()).group(1)
          for p in ('package.xml', 'msg_defs/package.xml'))}
    assert places == {uav_task_alloc.__version__}


def test_ctrl_c_in_make_build_shows_no_traceback_of_the_build(tmp_path):
    """`python3` is a program that reports the signal as colcon does, at length.

    Kernels are compiled at the same time, by a program that reports it in one line.
    """
    colcon = tmp_path / 'bin/python3'
    colcon.parent.mkdir()
    colcon.write_text('#!/bin/sh\ncase "$*" in\n'
                      '*colcon*) trap "echo Traceback; exit 1" INT; > begun ;;\n'
                      '*) trap "echo interrupted; exit 130" INT; > compiling ;;\nesac\n'
                      'while :; do sleep 0.05; done\n')
    colcon.chmod(0o755)
    (tmp_path / '.ros').mkdir()
    for name in ('.ros/setup.sh', 'setup.py', 'setup.cfg', 'package.xml', 'colcon_defaults.yaml'):
        (tmp_path / name).touch()
    made = subprocess.Popen(
        ['make', '-f', ROOT / 'Makefile', '-o', '.ros/.made', 'build'], cwd=tmp_path, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # as in a terminal
        env={**os.environ, 'PATH': f'{colcon.parent}:{os.environ["PATH"]}'})
    while not all((tmp_path / name).exists() for name in ('begun', 'compiling')):
        assert made.poll() is None, made.communicate()
    os.killpg(made.pid, signal.SIGINT)  # as a terminal does
    out, _ = made.communicate(timeout=90)
    assert 'Error 130' in out
    assert 'Traceback' not in out


@pytest.mark.parametrize('name', ['dmeo', 'survey.yaml', ''])
def test_make_demo_refuses_an_unknown_scenario_before_it_builds(name):
    process = subprocess.run(['make', '--no-print-directory', '-n', 'demo', f'SCENARIO={name}'],
                             cwd=ROOT, text=True, capture_output=True, check=False)
    assert process.returncode == 2
    assert f'SCENARIO = {name}: expected one of' in process.stderr
    assert ' demo ' in process.stderr
    assert process.stdout == ''
