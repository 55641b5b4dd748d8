# SPDX-License-Identifier: Apache-2.0
"""Heights of map elements above an origin at 488 m AMSL."""
import pytest

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.map_files.altitudes import Altitudes
from uav_task_alloc.map_files.elements import (
    ABOVE_ORIGIN,
    AMSL,
    UNSAID,
    Element,
    MapFileError,
    Place,
)


def height(of_place=None, reference=UNSAID, unsaid='', **properties):
    place = Place(47.4, 8.5, of_place)
    element = Element('job.csv:2', 'mast', 'point', (place,), reference, properties)
    return Altitudes(Origin(47.4, 8.5, 488.0), unsaid).height(element, place, 50.0)


@pytest.mark.parametrize(('reference', 'expected'), [
    (AMSL, 42.0), (ABOVE_ORIGIN, 530.0), ('', 50.0)])  # '': clamped to the ground
def test_an_altitude_refers_to_what_its_file_says(reference, expected):
    assert height(530.0, reference) == expected
    assert height(530.0, reference, unsaid='ignore') == expected


@pytest.mark.parametrize(('unsaid', 'expected'), [
    ('amsl', 42.0), ('origin', 530.0), ('ignore', 50.0)])
def test_an_altitude_of_which_the_file_does_not_say_above_what_is_as_the_user_says(
        unsaid, expected):
    assert height(530.0, unsaid=unsaid) == expected


def test_where_nobody_says_above_what_only_zero_is_taken_for_none():
    assert height(0.0) == 50.0
    assert height(0.0, unsaid='origin') == 0.0
    with pytest.raises(MapFileError, match=r'^job\.csv:2: altitude 530, and the file does not'):
        height(530.0)


def test_a_place_without_an_altitude_has_the_height_of_the_user():
    assert height(None, AMSL) == height(None) == 50.0


@pytest.mark.parametrize(('properties', 'expected'), [
    ({'altitude': '30'}, 30.0), ({'altitude_amsl': 520}, 32.0), ({'altitude': ' '}, 42.0)])
def test_properties_come_before_the_altitude_of_the_place(properties, expected):
    assert height(530.0, AMSL, **properties) == expected


@pytest.mark.parametrize(('properties', 'text'), [
    ({'altitude': 'high'}, "altitude = 'high': expected a number"),
    ({'altitude': 'nan'}, "altitude = 'nan': expected a number"),
    ({'altitude_amsl': 1e7}, 'altitude_amsl = 10000000.0: expected a number'),
    ({'altitude': 1, 'altitude_amsl': 2}, 'altitude and altitude_amsl: expected one of them')])
def test_what_is_wrong_with_a_property_is_named(properties, text):
    with pytest.raises(MapFileError, match=rf'^job\.csv:2: {text}'):
        height(**properties)
