# SPDX-License-Identifier: Apache-2.0
"""Reader of waypoint files of Mission Planner, MAVProxy and others, which begin with QGC WPL.

The format: https://mavlink.io/en/file_formats/
"""
from __future__ import annotations

from uav_task_alloc.errors import shown
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.map_files.elements import AMSL, Element, MapFile, MapFileError, check_place
from uav_task_alloc.map_files.qgc_plan import ITEM_FRAMES, TASK_COMMANDS, why_no_task

_HEAD = 'QGC WPL'
_VERSIONS = '110', '120'
_WAYPOINT = 16  # MAV_CMD_NAV_WAYPOINT
_COLUMNS = 12  # index, current, frame, command, 4 parameters, latitude, longitude, altitude, auto
_TERRAIN = 10, 11  # MAV_FRAME_GLOBAL_TERRAIN_ALT and its _INT form


def read_waypoints(text: str, file: str) -> MapFile:
    """Read a waypoint file.

    Args:
        text: of the file.
        file: its name, for messages.

    Returns:
        A point for each waypoint; `origin` is its first item where that is home: a waypoint above
        mean sea level. Files of QGroundControl for PX4 begin without it.

    Raises:
        MapFileError: it is no such file, or a value is no number or out of range.
    """
    lines = text.splitlines()
    words = lines[0].split() if lines else []
    if ' '.join(words[:2]) != _HEAD or words[2:] not in ([each] for each in _VERSIONS):
        raise MapFileError(f'{file}:1: {shown(lines[0] if lines else "")}: expected {_HEAD} 110')
    read, first = MapFile(), True
    for number, line in enumerate(lines[1:], 2):
        if line.strip():
            _read_item(line.split(), f'{file}:{number}', first, read)
            first = False
    return read


def _read_item(words: list[str], where: str, first: bool, read: MapFile) -> None:
    try:
        if len(words) != _COLUMNS:
            raise ValueError
        frame, command, hold = int(words[2]), int(words[3]), float(words[4])
    except ValueError:
        raise MapFileError(f'{where}: {shown(" ".join(words))}: expected {_COLUMNS} numbers, as '
                           'index, current, frame, command, 4 parameters, latitude, longitude, '
                           'altitude, autocontinue') from None
    home = first and command == _WAYPOINT and ITEM_FRAMES.get(frame) == AMSL
    if not home and command not in TASK_COMMANDS:
        read.left_out.append(f'{where}: {why_no_task(command)}')
        return
    place = check_place(where, (words[9], words[8], words[10]))
    if home:
        read.origin = Origin(place.latitude, place.longitude, place.altitude or 0.0)
        return
    terrain = frame in _TERRAIN
    if frame not in ITEM_FRAMES and not terrain:
        raise MapFileError(f'{where}: frame {frame}: expected '
                           f'{", ".join(map(str, (*ITEM_FRAMES, *_TERRAIN)))}')
    reference = ITEM_FRAMES[3 if terrain else frame]
    read.elements.append(Element(
        where, f'wp{words[0]}', 'point', (place,), reference,
        {**({'service_time': hold} if hold > 0.0 else {}),
         **({'vertical': 'terrain'} if terrain else {})}))
