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
    'pymavlink': ('mavlink/', 'sim/'),
    'matplotlib': ('plots', 'cli/report', 'cli/study', 'study/'),
    'mavsdk': (),
    'mcap': ('record/',),
    'mcap_ros2': ('record/',),
    'plotly': ('flight_report/',),
    'aiohttp': ('live/',),
    'pymap3d': ('geometry/',),
    'rasterio': ('terrain',),
    'numba': ('geometry/', 'solver/', 'kernel'),
}
ROS = {'rclpy', 'rcl_interfaces', 'builtin_interfaces', 'geometry_msgs', 'std_msgs', 'std_srvs',
       'diagnostic_msgs', 'nav_msgs', 'rosgraph_msgs', 'visualization_msgs', 'uav_task_alloc_msgs',
       'ament_index_python'}
# a room, or a file beside rooms, imports from lower levels and from itself only
LEVELS = {
    'errors': 0,
    'checks': 0,
    'actions': 0,
    'timetable': 0,
    'atomic_files': 0,
    'model': 1,
    'palette': 0,
    'piece_ids': 0,
    'quick_import': 0,
    'parameter_field': 1,
    'params': 1,
    'parameter_texts': 2,
    'journal': 1,
    'journal_recovery': 2,
    'key_ranges': 0,
    'kernel_arguments': 0,
    'kernel_cache': 1,
    'kernel': 1,
    'kernel_inner': 1,
    'kernel_shortcuts': 1,
    'zone_codec': 1,
    'geometry.polygon': 0,  # `checks` checks polygons with it
    'geometry.polyline': 0,  # the model has paths
    'geometry': 2,
    'terrain': 2,
    'terrain_legs': 3,
    'objective': 2,
    'separation.rule': 0,  # the model has its conflicts
    'separation': 3,
    'work': 3,
    'solver': 3,
    'anticipation': 4,
    'scenario': 3,
    'map_files': 5,
    'record': 4,
    'live': 5,
    'plots': 5,
    'flight_report': 5,
    'study': 6,
    'mavlink': 2,
    'mavlink.transport': 3,
    'mavlink.autopilots': 4,
    'mavlink.mission': 5,
    'mavlink.fence': 6,
    'mavlink.gcs': 7,
    'sim': 4,
    'allocator.order_records': 3,
    'allocator.work_records': 3,
    'allocator.records': 3,
    'allocator.list_records': 3,
    'allocator.replan_records': 4,  # with flights of the state
    'allocator.state': 4,
    'allocator.replanning': 5,
    'allocator.persistence': 6,
    'allocator': 7,
    'cli': 7,
    '__main__': 8,
    'nodes.conversions': 8,
    'nodes.ros': 9,
    'nodes.rviz': 10,
    'nodes': 11,
}
# of the package, what a room may import at most
ONLY = {'sim': ('sim', 'mavlink.transport.codec', 'geometry', 'scenario', 'model', 'errors')}


def imports(path):
    """Absolute names of what a file imports, at any depth."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import'
            yield node.module
            yield from (f'{node.module}.{alias.name}' for alias in node.names)


def module(path):
    """Of a file, below the package: geometry.detour"""
    return '.'.join(path.relative_to(ROOT).with_suffix('').parts).removesuffix('.__init__')


def room(name):
    """The longest entry of LEVELS that a module belongs to; '' for none."""
    parts = name.split('.')
    return next((room for n in range(len(parts), 0, -1)
                 if (room := '.'.join(parts[:n])) in LEVELS), '')


def breaches(path, names):
    here = path.relative_to(ROOT).as_posix()
    for name in names:
        library = name.split('.')[0]
        library = 'rclpy' if library in ROS else library
        if library in ROOMS and not here.startswith(ROOMS[library]):
            yield f'{here} uses {name}'
        own = room(module(path))
        if library == 'uav_task_alloc' and '.' in name and own:
            other = name.split('.', 1)[1]
            if LEVELS.get(room(other), -1) > LEVELS[own]:
                yield f'{here} ({LEVELS[own]}) imports upwards: {other} ({LEVELS[room(other)]})'
            if not f'{other}.'.startswith(tuple(f'{room}.' for room in ONLY.get(own, (other,)))):
                yield f'{here} may not import {other}'


def modules_imported(path):
    """Modules of the package that a file imports, by their names below it."""
    names = {name.removeprefix('uav_task_alloc.') for name in imports(path)}
    return names & set(MODULES)


MODULES = {module(path): path for path in FILES if path.parent != ROOT or path.stem != '__init__'}


def test_every_file_belongs_to_a_level():
    assert [name for name in MODULES if not room(name)] == []


def test_no_modules_import_each_other_in_a_circle():
    ahead = {name: modules_imported(path) for name, path in MODULES.items()}
    while any(bottom := {name for name, wanted in ahead.items() if not wanted & set(ahead)}):
        ahead = {name: wanted for name, wanted in ahead.items() if name not in bottom}
    assert ahead == {}


def test_a_file_imports_only_what_its_room_may():
    assert len(FILES) > 300
    assert [breach for path in FILES for breach in breaches(path, imports(path))] == []


@pytest.mark.parametrize(('where', 'name'), [
    ('model/task.py', 'rclpy.node'), ('allocator.py', 'std_msgs.msg'),
    ('solver/solve.py', 'pymavlink'),
    ('nodes/allocator.py', 'matplotlib.pyplot'), ('geometry/detour.py', 'uav_task_alloc.solver'),
    ('mavlink/transport/link.py', 'uav_task_alloc.mavlink.gcs.policy'),
    ('sim/vehicle.py', 'uav_task_alloc.mavlink.transport.link'),
])
def test_a_breach_is_seen(where, name):
    assert list(breaches(ROOT / where, [name]))


def test_a_file_says_what_it_is():
    texts = {path: path.read_text() for path in FILES}
    assert [path for path, text in texts.items()
            if not text.startswith('# SPDX-License-Identifier: Apache-2.0\n')
            or not ast.get_docstring(ast.parse(text))] == []
