# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from uav_task_alloc.map_files.property_values import number_in, property_value


@pytest.mark.parametrize(('key', 'value', 'expected'), [
    ('value', '2.5', 2.5), ('value', 3, 3), ('service_time', ' soon ', 'soon'),
    ('capabilities', 'camera, lidar;zoom', ['camera', 'lidar', 'zoom']),
    ('capabilities', ['camera'], ['camera']), ('allowed_uavs', 7, ['7']),
    ('camera', '{"width": 3}', {'width': 3}), ('camera', 'wide', 'wide'),
    ('actions', [1, 2], [1, 2]), ('value', [1, 2], '[1, 2]'), ('value', {'a': 1}, '{"a": 1}')])
def test_a_property_is_what_scenarios_expect_for_its_key(key, value, expected):
    assert property_value(key, value) == expected


@pytest.mark.parametrize(('text', 'number'), [
    ('7', 7), ('7.0', 7), ('-1e3', -1000), (' 0.5 ', 0.5), ('1e15', 1e15), ('inf', math.inf)])
def test_a_text_is_the_number_that_it_is(text, number):
    got = number_in(text)
    assert (got, type(got)) == (number, type(number))


@pytest.mark.parametrize('value', [None, True, 2.5, 'T1', '1,5'])
def test_all_else_stays(value):
    assert number_in(value) == value
