# SPDX-License-Identifier: Apache-2.0
"""Writes the index of rooms and files in docs/architecture.md from the docstrings of the modules.

Usage: python tools/docs/file_index.py
"""
import ast
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE, PAGE = ROOT / 'uav_task_alloc', ROOT / 'docs' / 'architecture.md'
HEADING = '## Rooms and files\n'  # the index is all below it
# in the order of the layers
ROOMS = ('.', 'model', 'geometry', 'solver', 'solver/baselines', 'solver/timed', 'separation',
         'work', 'anticipation', 'scenario', 'map_files', 'mavlink', 'mavlink/transport',
         'mavlink/mission', 'mavlink/fence', 'mavlink/gcs', 'sim', 'sim/ardupilot', 'sim/px4',
         'allocator', 'allocator/state', 'allocator/replanning', 'allocator/persistence',
         'record', 'live', 'flight_report', 'plots', 'study', 'cli', 'nodes',
         'nodes/conversions', 'nodes/ros', 'nodes/rviz')


def sentence(path):
    """The first paragraph of a module's docstring in one line."""
    text = ast.get_docstring(ast.parse(path.read_text())) or ''
    return ' '.join(text.partition('\n\n')[0].split())


def index_text():
    """The index: a table for each room.

    Raises:
        SystemExit: a room is not in ROOMS.
    """
    rooms = {path.parent.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob('*.py')}
    if rooms - set(ROOMS):
        sys.exit(f'rooms {sorted(rooms - set(ROOMS))}: expected in ROOMS of {Path(__file__).name}')
    parts = []
    for room in ROOMS:
        title = 'Ground floor' if room == '.' else f'{room}/'
        about = sentence(PACKAGE / room / '__init__.py')
        rows = [f'| `{path.relative_to(PACKAGE).as_posix()}` | {sentence(path)} |\n'
                for path in sorted((PACKAGE / room).glob('*.py')) if path.stem != '__init__']
        parts.append(f'### {title}\n\n{about}\n\n| file | what it is |\n|---|---|\n'
                     + ''.join(rows))
    return '\n'.join(parts)


def page_text():
    """The page with a new index."""
    return PAGE.read_text().partition(HEADING)[0] + HEADING + '\n' + index_text()


if __name__ == '__main__':
    PAGE.write_text(page_text())
