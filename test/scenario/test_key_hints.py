# SPDX-License-Identifier: Apache-2.0
"""Hints for keys of other programs and for misspelt ones."""
import pytest

from uav_task_alloc.scenario.key_hints import SAME_MEANING, key_hint
from uav_task_alloc.scenario.schema import TABLES


@pytest.mark.parametrize(('table', 'word', 'hint'), [
    ('tasks', 'priority', "nearest is 'value'"), ('tasks', 'lat', "nearest is 'latitude'"),
    ('tasks', 'lng', "nearest is 'longitude'"), ('tasks', 'alt', "nearest is 'altitude'"),
    ('tasks', 'deadline', "nearest is 'latest'"), ('tasks', 'Name', "nearest is 'id'"),
    ('tasks', 'not_before', "nearest is 'earliest'"),
    ('tasks', 'depends_on', 'an order of tasks is not supported'),
    ('tasks', 'time', "nearest is 'at'"),
    ('tasks', 'vlaue', "nearest is 'value'"), ('tasks', 'duration', "nearest is 'service_time'"),
    ('uavs', 'speed', "nearest is 'cruise_speed'"), ('uavs', 'battery', "nearest is 'range'"),
    ('uavs', 'lon', "nearest is 'longitude'"), ('uavs', 'start', "nearest is 'position'"),
    ('zones', 'polygon', "nearest is 'vertices'"), ('zones', 'type', "nearest is 'shape'"),
    ('zones', 'height', "nearest is 'z_max'"), ('zones', 'buffer', "nearest is 'margin'"),
    ('scenario', 'drones', "nearest is 'uavs'"), ('scenario', 'obstacles', "nearest is 'zones'"),
    ('origin', 'altitude', "nearest is 'altitude_amsl'"), ('tasks', 'qqq', 'nearest is '),
])
def test_a_word_of_other_programs_is_answered_by_the_key_that_has_its_meaning(table, word, hint):
    assert key_hint(word, TABLES[table]).startswith(hint)


def test_hints_name_keys_that_exist():
    known = {key for table in TABLES.values() for key in table}
    assert SAME_MEANING.keys() <= known
