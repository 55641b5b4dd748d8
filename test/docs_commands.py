# SPDX-License-Identifier: Apache-2.0
"""Check of commands in the docs: whether the program, its parameters and its options exist."""
import contextlib
import importlib.util
import io
import re
import shlex
from dataclasses import fields
from functools import cache
from itertools import pairwise
from pathlib import Path
from unittest import mock

import launch_stand_in
import yaml

from uav_task_alloc import __main__ as cli, parameter_field, params

ROOT = Path(__file__).parent.parent
# programs of other packages
FOREIGN = {'.', 'cd', 'source', 'export', 'git', 'rosdep', 'colcon', 'mkdir', 'ls', 'cat',
           'sim_vehicle.py', 'px4', 'arducopter', 'rviz2', 'xdg-open', 'pytest', 'dask', 'sudo'}


def commands(text):
    """The commands of a block as lists of words, without variables set before them."""
    for line in text.replace('\\\n', ' ').splitlines():
        words = shlex.split(line, comments=True)
        for part in _parts(words):
            while part and re.match(r'[A-Za-z_]\w*=', part[0]):
                part = part[1:]
            if part:
                yield part


def _parts(words):
    part = []
    for word in [*words, '&&']:
        if word in ('&&', '||', '|', ';', '&'):
            yield part
            part = []
        else:
            part.append(word)


def error_in(words):
    """The error in a command; '' where there is none."""
    name, *rest = words
    if name == 'make':
        return _make(rest)
    if name in ('python', 'python3'):
        return _python(rest)
    if name == 'uav_task_alloc':
        return _command(rest)
    if name == 'pip':
        return _pip(rest)
    if name == 'ros2':
        return _ros2(rest)
    return '' if Path(name).name in FOREIGN else f'{name}: expected a known program'


def _make(rest):
    goals = re.findall(r'^([\w./]+):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
    missing = [word for word in rest if word not in goals and '=' not in word]
    return f'make {missing[0]}: expected one of {goals}' if missing else ''


def _python(rest):
    if rest[:2] == ['-m', 'uav_task_alloc']:
        return _command(rest[2:])
    if rest[:1] == ['-m']:
        return '' if importlib.util.find_spec(rest[1]) else f'python -m {rest[1]}: no such module'
    if (ROOT / rest[0]).suffix == '.py' and '/' in rest[0] and not (ROOT / rest[0]).exists():
        return f'{rest[0]}: no such file'
    return ''


def _pip(rest):
    extras = re.findall(r"'(\w+)': \[", (ROOT / 'setup.py').read_text())
    for word in rest:
        own = re.fullmatch(r'\.\[(.+)\]', word)
        for extra in own[1].split(',') if own else ():
            if extra not in extras:
                return f'pip: no extra {extra}'
        if word.endswith('.txt') and not (ROOT / word).exists():
            return f'{word}: no such file'
    return ''


def _command(rest):
    if not rest or rest[0] not in cli.COMMANDS:
        return f'{rest}: expected one of {list(cli.COMMANDS)}'
    place = next((i for i, word in enumerate(rest) if word.startswith('-')), len(rest))
    text = help_of(*rest[:place])
    options = [word.split('=')[0] for word in rest if re.match(r'--?[a-z]', word)]
    missing = [word for word in options if not re.search(rf'{re.escape(word)}\b', text)]
    return f'{rest[0]}: no option {missing[0]}' if missing else ''


@cache
def help_of(*words):
    """The output of these words followed by `-h`."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out), contextlib.suppress(
            SystemExit):
        cli.main([*words, '-h'])
    return out.getvalue()


def _ros2(rest):
    if rest[:2] == ['run', 'uav_task_alloc']:
        return _run(rest[2], rest[3:])
    if rest[:2] == ['launch', 'uav_task_alloc']:
        return _launch(rest[2], rest[3:])
    known = ('run', 'launch', 'topic', 'service', 'param', 'node', 'bag', 'doctor', 'interface')
    return '' if rest[0] in known else f'ros2 {rest[0]}: expected one of {known}'


def _run(name, rest):
    if not (ROOT / 'uav_task_alloc/nodes' / f'{name}.py').exists():
        return f'ros2 run uav_task_alloc {name}: no such executable'
    known = {parameter_field.ros_name(spec): spec for spec in fields(params.NODES[name])} if (
        name in params.NODES) else {}
    for flag, word in pairwise(rest):
        if flag != '-p':
            continue
        key, _, value = word.partition(':=')
        if key == 'use_sim_time' and value in ('true', 'false'):  # of ROS itself
            continue
        if key not in known:
            return f'{name}: no parameter {key}'
        parameter_field.check(known[key], yaml.safe_load(value))
    return ''


def _launch(name, rest):
    path = ROOT / 'launch' / name
    if not path.exists():
        return f'{path.name}: no such launch file'
    if rest == ['--show-args']:
        return ''
    try:
        with mock.patch.object(launch_stand_in, 'INSTALLED', {'rviz2', 'tf2_ros'}):
            nodes = launch_stand_in.commands(path, dict(word.split(':=', 1) for word in rest))
    except KeyError as error:
        return str(error.args[0])
    errors = [_run(node[1], node[2:]) for node in nodes if node[0] == 'uav_task_alloc']
    return next(filter(None, errors), '')
