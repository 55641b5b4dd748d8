# SPDX-License-Identifier: Apache-2.0
"""`plan` cuts work into pieces and names them in short."""
import json

import pytest

from uav_task_alloc.cli.commands import main
from uav_task_alloc.cli.plan_pieces import piece_kinds, short_names, with_pieces
from uav_task_alloc.geometry.frames import Origin, to_enu
from uav_task_alloc.geometry.polyline import polyline_length
from uav_task_alloc.scenario import parse

SCENARIO = """
uavs:
  - {id: uav_1, position: [0, 0, 0]}
tasks:
  - {id: mast, position: [10, 20, 40]}
  - {id: field, kind: area, strip_width: 50, altitude: 50, at: 3,
     path: [[0, 0], [300, 0], [300, 200], [0, 200]]}
  - {id: cable, kind: line, altitude: 50, path: [[0, -50], [300, -50], [300, -90]]}
zones:
  - {id: z, shape: cylinder, center: [150, -50], radius: 20, z_max: 100}
"""


def test_a_scenario_is_cut_around_its_zones():
    cut = with_pieces(parse(SCENARIO))
    assert [timed.task.id for timed in cut.tasks] == [
        'mast', 'cable#1', 'cable#2', 'field#1', 'field#2', 'field#3', 'field#4']
    assert {timed.at for timed in cut.tasks if timed.task.id.startswith('field')} == {3.0}
    assert piece_kinds(cut) == {'field': 'strip', 'cable': 'part'}


def test_lengths_and_times_of_a_plan_have_the_ways_of_pieces(tmp_path, capsys):
    scenario, out = tmp_path / 'job.yaml', tmp_path / 'plan.json'
    scenario.write_text(SCENARIO)
    assert main(['plan', str(scenario), '--budget', '0.1', '--times', '--json', str(out)]) == 0
    printed, written = capsys.readouterr().out, json.loads(out.read_text())
    assert f'uav_1: {written["distance"]:.0f} m' in printed
    assert 'cable parts' in printed
    assert written['distances'] == {'uav_1': pytest.approx(written['distance'])}
    legs = sum(leg['length'] for leg in written['legs']['uav_1'])
    assert written['distance'] - legs == pytest.approx(  # two parts of the cable, four strips
        sum(length(rows) for rows in written['paths'].values()), rel=1e-3)
    ways = {name: [(row['latitude'], row['longitude']) for row in rows]
            for name, rows in written['paths'].items()}
    for name in written['reversed']:
        ways[name].reverse()
    stops = [name for name in written['routes']['uav_1'] if name in ways]
    flown = [row for row in written['waypoints']['uav_1'] if row['task'] in ways]
    assert [(row['latitude'], row['longitude']) for row in flown] == [
        place for name in stops for place in ways[name]]
    row = next(line for line in printed.splitlines() if line.startswith('field#2')).split()
    assert float(row[6]) - float(row[5]) == pytest.approx(20.0, abs=0.11)  # 300 m at 15 m/s


def length(rows):
    """Length [m] of a level way given in degrees."""
    origin = Origin(rows[0]['latitude'], rows[0]['longitude'], 0.0)
    return polyline_length([to_enu(origin, row['latitude'], row['longitude'], 0.0)
                            for row in rows])


@pytest.mark.parametrize(('names', 'text'), [
    (['mast'], 'mast'),
    (['field#1', 'field#2', 'field#3'], 'field strips 1-3'),
    (['field#3', 'field#2', 'field#1', 'mast', 'field#4'], 'field strips 3-1; mast; '
                                                           'field strip 4'),
    (['field#1', 'field#2', 'field#5', 'field#7', 'field#6', 'field#5'],
     'field strips 1, 2, 5, 7-5'),
    (['cable#2', 'field#2', 'field#1', 'field#2'], 'cable part 2; field strips 2, 1, 2'),
])
def test_pieces_in_a_row_are_one_text(names, text):
    assert '; '.join(short_names(names, {'field': 'strip', 'cable': 'part'})) == text
