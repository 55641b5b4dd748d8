# SPDX-License-Identifier: Apache-2.0
"""Which reader reads a file: by the end of its name."""
from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from uav_task_alloc.map_files.elements import LARGEST_FILE, MapFile, MapFileError
from uav_task_alloc.map_files.geojson import read_geojson
from uav_task_alloc.map_files.kml import read_kml, read_kmz
from uav_task_alloc.map_files.qgc_plan import read_plan
from uav_task_alloc.map_files.table import read_table
from uav_task_alloc.map_files.waypoints import read_waypoints


def read_map_file(path: Path) -> MapFile:
    """Read a file of a map or a ground station.

    Args:
        path: ends with .kml, .kmz, .geojson, .json, .plan, .waypoints, .txt or .csv.

    Returns:
        Its elements, in the order of the file.

    Raises:
        MapFileError: it cannot be read, or is not what its name says.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise MapFileError(f'{path}: expected a name that ends with {", ".join(_READERS)}')
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise MapFileError(f'{path}: {path.stat().st_size} bytes: expected at most '
                               f'{LARGEST_FILE}')
        data = path.read_bytes()
    except OSError as error:
        raise MapFileError(f'{path}: {error.strerror}: expected a file') from None
    return reader(data, path.name)


def _text(data: bytes, file: str) -> str:
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        raise MapFileError(f'{file}: byte {data[error.start]:#04x} at {error.start}: expected '
                           'UTF-8 text') from None


def _json(data: bytes, file: str) -> Any:
    text = _text(data, file)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise MapFileError(f'{file}:{error.lineno}: {error.msg}: expected JSON') from None
    except ValueError:
        raise MapFileError(f'{file}: a number of thousands of digits: expected a map') from None
    except RecursionError:
        raise MapFileError(f'{file}: nested too deep: expected a map') from None


def _any_json(data: bytes, file: str) -> MapFile:
    document = _json(data, file)
    plan = isinstance(document, dict) and document.get('fileType') == 'Plan'
    return read_plan(document, file) if plan else read_geojson(document, file)


_READERS: dict[str, Callable[[bytes, str], MapFile]] = {
    '.kml': read_kml,
    '.kmz': read_kmz,
    '.geojson': lambda data, file: read_geojson(_json(data, file), file),
    '.json': _any_json,
    '.plan': lambda data, file: read_plan(_json(data, file), file),
    '.waypoints': lambda data, file: read_waypoints(_text(data, file), file),
    '.txt': lambda data, file: read_waypoints(_text(data, file), file),
    '.csv': lambda data, file: read_table(_text(data, file), file),
}
