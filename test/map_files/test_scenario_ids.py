# SPDX-License-Identifier: Apache-2.0
import pytest

from uav_task_alloc.map_files.scenario_ids import ScenarioIds


def ids(*tasks):
    return ScenarioIds({'tasks': tasks, 'zones': (), 'uavs': ()})


@pytest.mark.parametrize(('kind', 'name', 'expected'), [
    ('tasks', 'mast_7', 'mast_7'), ('tasks', 'Mast 7 / north', 'Mast_7_north'),
    ('tasks', '7', 't7'), ('zones', '7', 'z7'), ('tasks', '', 'task'), ('uavs', '', 'uav'),
    ('zones', 'Höhe', 'H_he'), ('tasks', '###', 'task')])
def test_an_id_is_the_name_as_scenarios_allow_it(kind, name, expected):
    assert ids().take(kind, name, 'a.kml: 1') == expected


def test_nothing_else_of_its_kind_has_an_id():
    made = ids('mast', 'mast_2')
    assert [made.take('tasks', 'mast', 'x') for _ in range(2)] == ['mast_3', 'mast_4']
    assert made.take('zones', 'mast', 'x') == 'mast'


def test_of_changed_names_the_first_is_named_and_the_others_are_counted():
    made = ids()
    for name in ('mast', ''):
        made.take('tasks', name, 'a.kml: 1')
    assert made.notes() == []
    made.take('tasks', 'Mast 7', 'a.kml: 2')
    assert made.notes() == ['a.kml: 2: its id is Mast_7']
    made.take('tasks', 'Mast 8', 'a.kml: 3')
    assert made.notes() == ['a.kml: 2: its id is Mast_7; 1 more name is changed']
    made.take('tasks', 'Mast 9', 'a.kml: 4')
    assert made.notes() == ['a.kml: 2: its id is Mast_7; 2 more names are changed']
