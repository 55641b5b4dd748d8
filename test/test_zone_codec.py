# SPDX-License-Identifier: Apache-2.0
"""A zone survives every format; a bad value is refused by its name, wherever it was read."""
import json
import math
from types import SimpleNamespace

import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.zone_codec import (
    JOURNAL_ZONE,
    JSON_ZONE,
    MOST_VERTICES,
    SCENARIO_ZONE,
    decode_zone,
    decode_zone_array,
    encode_zone,
)

ZONES = [
    ThreatZone.hemisphere('dome', (1.0, 2.0, 3.0), 80.0, margin=5.0),
    ThreatZone.cylinder('hut', (1.0, 2.0), 80.0, 0.0, 120.0),
    ThreatZone.cylinder('column', (1.0, 2.0), 80.0),
    ThreatZone.polygon('field', [(0.0, 0.0), (10.0, 0.0), (0.0, 10.0)], z_max=50.0, margin=2.0)]
FORMATS = {'json': JSON_ZONE, 'journal': JOURNAL_ZONE, 'scenario': SCENARIO_ZONE}


@pytest.mark.parametrize('zone', ZONES, ids=lambda zone: zone.id)
@pytest.mark.parametrize('form', FORMATS.values(), ids=FORMATS)
def test_a_zone_survives_each_format(zone, form):
    assert decode_zone(json.loads(json.dumps(encode_zone(zone, form)))) == zone


def test_lines_of_a_record_are_strict_json():
    json.dumps([encode_zone(zone, JSON_ZONE) for zone in ZONES], allow_nan=False)


def test_rows_of_earlier_versions_are_read():
    row = {'id': 'hut', 'shape': 1, 'center': [1.0, 2.0, 9.0], 'radius': 80.0, 'z_min': -math.inf,
           'z_max': 120.0, 'vertices': [], 'margin': 0.0}
    hut = ThreatZone.cylinder('hut', (1.0, 2.0), 80.0, z_max=120.0)
    assert decode_zone(row) == hut
    assert decode_zone({**row, 'shape': 'CYLINDER', 'z_min': None}) == hut


def test_values_that_a_shape_does_not_use_are_ignored():
    row = encode_zone(ZONES[3], JOURNAL_ZONE) | {'radius': math.nan, 'center': None}
    assert decode_zone(row) == ZONES[3]


@pytest.mark.parametrize(('changed', 'text'), [
    ({'id': 'a b'}, "zone_id = 'a b': expected a ROS name"),
    ({'id': 7}, 'zone_id = 7: expected a ROS name'),
    ({'shape': 7}, r'zone hut: shape = 7: expected HEMISPHERE \(0\), CYLINDER \(1\) or POLYGON'),
    ({'shape': []}, r'zone hut: shape = \[\]'),
    ({'radius': -1.0}, r'zone hut: radius = -1.0'),
    ({'radius': None}, r'zone hut: radius = None'),
    ({'z_min': math.nan}, 'zone hut: z_min = nan'),
    ({'z_min': 200.0}, 'zone hut: z_min, z_max'),
    ({'center': 'abc'}, "zone hut: center = 'abc'"),
    ({'center': [1.0]}, 'zone hut: center'),
    ({'margin': -1.0}, 'zone hut: margin = -1.0'),
    ({'shape': 2, 'vertices': [1, 2]}, 'zone hut: vertices'),
    ({'shape': 2, 'vertices': 3}, 'zone hut: vertices = 3'),
    ({'shape': 2, 'vertices': [[0.0, 0.0], [1.0, 1.0]]}, 'zone hut: vertices'),
])
def test_a_bad_value_is_refused_by_its_name(changed, text):
    with pytest.raises(InvalidValue, match=text):
        decode_zone(encode_zone(ZONES[1], JOURNAL_ZONE) | changed)


def message(**changed):
    point = SimpleNamespace(x=1.0, y=2.0, z=3.0)
    return SimpleNamespace(**{
        'zone_id': 'dome', 'shape': 0, 'center': point, 'radius': 80.0, 'z_min': math.nan,
        'z_max': math.nan, 'vertices': [], 'margin': math.nan, **changed})


def test_one_bad_zone_of_a_message_does_not_cost_the_others():
    point = SimpleNamespace(x=0.0, y=0.0, z=0.0)
    valid, invalid = decode_zone_array(SimpleNamespace(zones=[
        message(), message(zone_id='bad', radius=-1.0), message(),
        message(zone_id='long', shape=2, vertices=[point] * (MOST_VERTICES + 1))]))
    assert valid == [ThreatZone.hemisphere('dome', (1.0, 2.0, 3.0), 80.0)]
    assert invalid['dome'] == "zone_id = 'dome': expected each id once"
    assert 'radius = -1.0' in invalid['bad']
    assert f'at most {MOST_VERTICES}' in invalid['long']


@pytest.mark.parametrize('zones', [
    [message()] * 1001, [message(vertices=[None] * 200)] * 26], ids=['zones', 'vertices'])
def test_a_message_with_too_much_is_refused_as_a_whole(zones):
    with pytest.raises(InvalidValue, match='number'):
        decode_zone_array(SimpleNamespace(zones=zones))
