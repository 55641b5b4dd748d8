# SPDX-License-Identifier: Apache-2.0
"""The walls of the house: who may import what, read from the sources."""
import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent / 'uav_task_alloc'
FILES = sorted(ROOT.rglob('*.py'))
# library -> rooms (paths below uav_task_alloc/) that may use it
ROOMS = {
    'rclpy': ('nodes/',),
    'pymavlink': ('mavlink/',),
    'matplotlib': ('plots', 'report', 'study/'),
    'mavsdk': (),
    'mcap': ('record/',),
    'mcap_ros2': ('record/',),
    'plotly': ('flight_report/', 'live/'),
    'aiohttp': ('live/',),
    'pymap3d': ('geometry/',),
    'numba': ('geometry/', 'solver/'),
}
ROS = {'rclpy', 'rcl_interfaces', 'builtin_interfaces', 'geometry_msgs', 'std_msgs', 'std_srvs',
       'diagnostic_msgs', 'nav_msgs', 'visualization_msgs', 'uav_task_alloc_msgs',
       'ament_index_python'}
# a room knows those of a lower number only, and itself
LEVELS = {
    'errors': 0, 'model': 1, 'params': 1, 'geometry': 2, 'objective': 2, 'solver': 3,
    'scenario': 3, 'record': 4, 'allocator': 4, 'journal': 4, 'mission': 4, 'long_legs': 4,
    'mavlink': 5, 'live': 5, 'plots': 5, 'progress': 5, 'planning': 6, 'study': 6,
    'flight_report': 6, 'report': 6, '__main__': 7,
    'nodes': 8,
}


def imports(path):
    """Absolute names of what a file imports, at any depth."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import'
            yield node.module
            yield from (f'{node.module}.{alias.name}' for alias in node.names)


def room(path):
    return path.relative_to(ROOT).parts[0].removesuffix('.py')


def breaches(path, names):
    here = path.relative_to(ROOT).as_posix()
    for name in names:
        library = name.split('.')[0]
        library = 'rclpy' if library in ROS else library
        if library in ROOMS and not here.startswith(ROOMS[library]):
            yield f'{here} uses {name}'
        if library == 'uav_task_alloc' and '.' in name and room(path) != '__init__':
            other = name.split('.')[1]
            if other in LEVELS and other != room(path) and LEVELS[other] > LEVELS[room(path)]:
                yield f'{here} ({LEVELS[room(path)]}) looks up to {other} ({LEVELS[other]})'


def test_every_room_is_on_the_plan():
    assert {room(path) for path in FILES} - {'__init__'} <= set(LEVELS)


@pytest.mark.parametrize('path', FILES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_a_file_imports_only_what_its_room_may(path):
    assert list(breaches(path, imports(path))) == []


@pytest.mark.parametrize(('where', 'name'), [
    ('model.py', 'rclpy.node'), ('allocator.py', 'std_msgs.msg'), ('solver/solve.py', 'pymavlink'),
    ('nodes/allocator.py', 'matplotlib.pyplot'), ('geometry/detour.py', 'uav_task_alloc.solver'),
])
def test_a_breach_is_seen(where, name):
    assert list(breaches(ROOT / where, [name]))


@pytest.mark.parametrize('path', FILES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_a_file_says_what_it_is(path):
    text = path.read_text()
    assert text.startswith('# SPDX-License-Identifier: Apache-2.0\n')
    assert ast.get_docstring(ast.parse(text))
