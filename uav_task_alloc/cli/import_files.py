# SPDX-License-Identifier: Apache-2.0
"""The command `import`: a scenario file from the files of maps and ground stations."""
from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from uav_task_alloc.atomic_files import replace_file
from uav_task_alloc.cli.options import OptionParser, one_of
from uav_task_alloc.cli.outputs import check_file, naming
from uav_task_alloc.cli.progress import log_line
from uav_task_alloc.errors import InvalidValue, first_of
from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.map_files.read import read_map_file
from uav_task_alloc.map_files.scenario_rows import ImportChoices, to_scenario
from uav_task_alloc.scenario.read import load

_SUFFIXES = '.yaml', '.yml'
_MOST_NOTES = 20


def main(argv: Sequence[str]) -> int:
    """Run `import FILE...`: read map files, write one scenario file.

    Returns:
        The exit status 0.

    Raises:
        AllocError: a file cannot be read, a value in it is refused, or the output cannot be
            written.
    """
    args = _make_parser().parsed(argv)
    for path in args.files:
        if path.is_dir():
            raise InvalidValue('FILE', str(path), 'a file, and this is a folder')
    if args.fleet and args.uavs is not None:
        raise InvalidValue('--uavs', args.uavs, 'either it or --fleet, whose UAVs are taken')
    out = args.output or args.files[0].with_suffix('.yaml')
    if out.exists():
        raise InvalidValue('--output', str(out), 'a file that does not exist yet')
    check_file('--output', out, _SUFFIXES, [*args.files, *([args.fleet] if args.fleet else [])])
    made = to_scenario([read_map_file(path) for path in args.files], ImportChoices(
        args.origin, args.height, args.altitudes or '', args.polygons == 'zones',
        args.lines == 'vertices', args.strip_width or 0.0, args.uavs or 1, _fleet(args.fleet)),
        out.stem)
    with naming('--output', out):
        replace_file(out, made.text)
    for note in made.notes[:_MOST_NOTES]:
        log_line(f'Warning: {note}')
    if len(made.notes) > _MOST_NOTES:
        log_line(f'Warning: and {len(made.notes) - _MOST_NOTES} more of this kind')
    counts = first_of(f'{count} {kind}' for kind, count in made.counts.items())
    origin = made.origin
    print(f'{out}: {counts.replace("uavs", "UAVs")}; origin {origin.latitude:.6f}, '
          f'{origin.longitude:.6f}, {origin.altitude_amsl:g} m AMSL')
    return 0


def _make_parser() -> OptionParser:
    parser = OptionParser(
        'import', 'Make a scenario file of map files: points and lines become tasks, polygons '
        'areas with --strip-width, or no-fly zones where they are in a folder of zones or have '
        'the property kind: zone '
        '(docs/map_files.md). What is not imported is named.')
    parser.add_argument('files', nargs='+', type=Path, metavar='FILE',
                        help='.kml, .kmz, .geojson, .json, .plan (QGroundControl), '
                             '.waypoints or .txt (Mission Planner), or .csv')
    parser.add_argument('--output', type=Path, metavar='SCENARIO.yaml',
                        help='the scenario, a new file (default: the name of the first file with '
                             '.yaml)')
    parser.add_argument('--origin', type=_origin, metavar='LAT,LON,ALT',
                        help='the place of the launch in degrees, and its altitude in m AMSL '
                             '(default: that of the fleet, or the planned home of a .plan)')
    parser.add_argument('--fleet', type=Path, metavar='SCENARIO.yaml',
                        help='a scenario with UAVs, to which tasks and zones are added (default: '
                             'none)')
    parser.number('--uavs', 1, 250, 'at the origin, where there is no fleet',
                  default_text='1', whole=True)
    parser.number('--height', -1000.0, 10000.0, 'of tasks whose file has no altitude, above the '
                  'origin', unit='m', default=50.0)
    parser.add_argument('--altitudes', type=one_of('amsl', 'origin', 'ignore'),
                        metavar='{amsl,origin,ignore}',
                        help='what altitudes refer to where a file does not say, as GeoJSON '
                             '(default: such a file is refused)')
    parser.add_argument('--polygons', type=one_of('zones'), metavar='zones',
                        help='every polygon is a zone (default: those that the file calls so)')
    parser.add_argument('--lines', type=one_of('vertices'), metavar='vertices',
                        help='a task at each vertex of a line (default: a line is one task, flown '
                             'along it)')
    parser.number('--strip-width', 0.1, 10000.0, 'that one pass over an area covers, of polygons '
                  'whose file does not say it', unit='m', default_text='they are left out')
    return parser


def _origin(text: str) -> Origin:
    try:
        latitude, longitude, altitude = (float(part) for part in text.split(','))
        return Origin(latitude, longitude, altitude)
    except ValueError as error:
        reason = f': {error}' if isinstance(error, InvalidValue) else ''
        raise argparse.ArgumentTypeError(
            f'{text!r}: expected LAT,LON,ALT as 47.397742,8.545594,488{reason}') from None


def _fleet(path: Path | None) -> Mapping[str, Any]:
    """The document of a scenario that is valid. Raises ScenarioError."""
    if path is None:
        return {}
    load(path)
    document: Mapping[str, Any] = yaml.safe_load(path.read_text(encoding='utf-8'))
    return document
