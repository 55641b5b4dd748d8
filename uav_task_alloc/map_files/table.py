# SPDX-License-Identifier: Apache-2.0
"""Reader of tables of points: CSV with a line of column names."""
from __future__ import annotations

import csv
import re

from uav_task_alloc.errors import shown
from uav_task_alloc.map_files.elements import (
    ABOVE_ORIGIN,
    AMSL,
    UNSAID,
    Element,
    MapFile,
    MapFileError,
    check_place,
)

_NAMES = 'id', 'name'
_ABOVE_GROUND = '1'
_LATITUDE, _LONGITUDE = ('latitude', 'lat', 'y'), ('longitude', 'lon', 'lng', 'long', 'x')
_MODE = 'altitudemode'  # column of Litchi: 0 above take-off, 1 above ground
_ALTITUDES = {'altitude_amsl': AMSL, 'altitude': ABOVE_ORIGIN, 'alt': UNSAID, 'z': UNSAID,
              'elevation': UNSAID, 'height': UNSAID}


def read_table(text: str, file: str) -> MapFile:
    """Read points from CSV, separated by commas, semicolons or tabs.

    Args:
        text: the first line has the names of the columns.
        file: its name, for messages.

    Raises:
        MapFileError: a column is missing, or a value is no number.
    """
    lines = text.splitlines()
    head = next((line for line in lines if line.strip()), '')
    reader = csv.DictReader(lines, delimiter=max(',;\t', key=head.count), strict=True)
    try:
        return _read_rows(reader, file)
    except csv.Error as error:
        raise MapFileError(f'{file}:{max(1, reader.line_num)}: {error}: expected CSV') from None


def _read_rows(reader: csv.DictReader[str], file: str) -> MapFile:
    names = [str(name).strip().lower() for name in reader.fieldnames or ()]
    reader.fieldnames = names
    twice = next((name for name in names if name and names.count(name) > 1), '')
    if twice:
        raise MapFileError(f'{file}:1: two columns {twice}: expected each name once')
    latitude, longitude = (_column(names, wanted, file) for wanted in (_LATITUDE, _LONGITUDE))
    altitude = next((name for name in names if _quantity(name) in _ALTITUDES), '')
    if {'altitude', 'altitude_amsl'} <= set(map(_quantity, names)):
        raise MapFileError(f'{file}:1: columns altitude and altitude_amsl: expected one of them')
    odd = next((name for name in names if not altitude
                and re.split(r'[(\[]', name)[0].strip() in _ALTITUDES), '')
    if odd:
        raise MapFileError(f'{file}:1: column {odd}: expected metres, as altitude(m)')
    unsaid = _ALTITUDES.get(_quantity(altitude), UNSAID)
    label = next((name for name in _NAMES if name in names), '')
    read = MapFile()
    for row in reader:
        where = f'{file}:{reader.line_num}'
        if None in row or None in row.values():
            raise MapFileError(f'{where}: expected {len(names)} columns: {", ".join(names)}')
        if not any(value.strip() for value in row.values()):
            continue  # as spreadsheets write below their last row
        mode = _mode(row.get(_MODE), where)
        numbers = [row[longitude], row[latitude]] + (
            [row[altitude]] if altitude and row[altitude].strip() else [])
        read.elements.append(Element(
            where, row[label].strip() if label else '', 'point',
            (check_place(where, numbers),), ABOVE_ORIGIN if mode else unsaid,
            {**{name: value.strip() for name, value in row.items()
                if value.strip() and name not in (latitude, longitude, altitude, label)},
             **({'vertical': 'terrain'} if mode == _ABOVE_GROUND else {})}))
    return read


def _quantity(name: str) -> str:
    """The name of a column without its unit: `altitude` of `altitude(m)`; other units stay."""
    return name.removesuffix('(m)').removesuffix('[m]').strip()


def _mode(given: str | None, where: str) -> str:
    """What Litchi says of an altitude; '' where there is no such column. Raises MapFileError."""
    if given is None or not given.strip():
        return ''
    if given.strip() not in ('0', _ABOVE_GROUND):
        raise MapFileError(f'{where}: {_MODE} = {shown(given)}: expected 0 (above take-off) or 1 '
                           '(above ground)')
    return given.strip()


def _column(names: list[str], wanted: tuple[str, ...], file: str) -> str:
    found = next((name for name in wanted if name in names), None)
    if found is None:
        raise MapFileError(f'{file}:1: columns {shown(", ".join(names))}: expected one named '
                           f'{wanted[0]}')
    return found
