# SPDX-License-Identifier: Apache-2.0
"""Fences of random zones: they cover the zones, fit the store, and leave the plan free."""
import math
import random

import pytest

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.geometry.polygon import contains_point, edges, is_simple, signed_area
from uav_task_alloc.geometry.polyline import segment_distance
from uav_task_alloc.mavlink.fence.choice import FlightSpace, choose_fence
from uav_task_alloc.mavlink.fence.rings import enlarged, rings_of_fewer_corners
from uav_task_alloc.mavlink.fence.shapes import (
    FenceShape,
    fence_items,
    fences_alike,
    shapes_of_items,
)
from uav_task_alloc.model import ThreatZone

ORIGIN = Origin(47.4, 8.5, 450.0)


def random_corners(rng, x=0.0, y=0.0, size=100.0, most=25):
    """A polygon with notches around (x, y)."""
    while True:
        count = rng.randint(3, most)
        corners = tuple((x + r * math.cos(a), y + r * math.sin(a)) for a, r in (
            (2 * math.pi * (k + 0.8 * rng.random()) / count, size * rng.uniform(0.2, 1.0))
            for k in range(count)))
        if is_simple(corners):
            return corners


@pytest.mark.parametrize('seed', range(40))
def test_a_ring_keeps_its_distance_and_each_simpler_ring_contains_the_one_before(seed):
    rng = random.Random(seed)
    corners, distance = random_corners(rng), rng.choice([0.05, 3.0, 40.0])
    ring = enlarged(corners, distance)
    assert is_simple(ring)
    assert signed_area(ring) > 0.0
    assert all(contains_point(ring, corner) for corner in corners)
    assert min(segment_distance(a, *edge) for a in corners for edge in edges(ring)) > (
        distance - 1e-5)
    before = ring
    for simpler in list(rings_of_fewer_corners(ring))[1:]:
        assert len(simpler) < len(before)
        assert is_simple(simpler)
        inner = [((9 * x + cx) / 10, (9 * y + cy) / 10) for (x, y), (cx, cy) in zip(
            before, before[1:] + before[:1], strict=True)]
        for point in inner:  # on its edges
            assert contains_point(simpler, point) or min(
                segment_distance(point, *edge) for edge in edges(simpler)) < 1e-6
        before = simpler
    assert len(before) <= 4


@pytest.mark.parametrize('count', [500, 1000])
def test_a_polygon_of_many_corners_is_covered_by_few(count):
    rng = random.Random(count)
    rough = tuple((r * math.cos(a), r * math.sin(a)) for a, r in (
        (2 * math.pi * k / count, rng.uniform(80.0, 100.0)) for k in range(count)))
    smooth = tuple((100 * math.cos(2 * math.pi * k / count), 60 * math.sin(
        2 * math.pi * k / count)) for k in range(count))
    for corners in (rough, smooth):
        ring = enlarged(corners, 5.0)
        assert len(ring) <= 4 * 120
        assert all(contains_point(ring, corner) for corner in corners)


@pytest.mark.parametrize('seed', range(15))
def test_the_fence_of_a_random_picture_covers_its_zones_within_its_budget(seed):
    rng = random.Random(seed)
    zones = [ThreatZone.polygon(f'p{k}', random_corners(
        rng, 300.0 * (k % 5), 300.0 * (k // 5)), margin=rng.choice([0.0, 10.0]))
        for k in range(12)] + [ThreatZone.hemisphere('dome', (1500.0, 0.0, 0.0), 150.0, 5.0)]
    path = ((-150.0, -200.0, 50.0), (-150.0, 800.0, 50.0), (1300.0, 900.0, 50.0))
    space = FlightSpace((path,), 50.0, 60.0)
    budget = rng.choice([40, 64, 70])
    fence = choose_fence(zones, None, space, budget, ORIGIN)
    items = fence_items(fence.shapes, ORIGIN)
    assert len(items) == fence.points <= budget
    read = shapes_of_items(items, ORIGIN)
    for shape, held in zip(fence.shapes, read, strict=True):
        zone = next(zone for zone in zones if zone.id == shape.zone)
        for point in zone.vertices or [zone.center]:
            assert held.contains(point)
            assert held.distance(point) > zone.margin + zone.radius
        assert not space.enters(held)
    assert {zone.id for zone in zones} == (
        {shape.zone for shape in fence.shapes} | set(fence.no_space) | set(fence.waiting))


def test_polygons_come_before_circles_which_px4_needs():
    zones = [ThreatZone.cylinder('c', (300.0, 0.0), 20.0),
             ThreatZone.polygon('p', [(0, 0), (50, 0), (0, 50)])]
    fence = choose_fence(zones, None, FlightSpace(), 70, ORIGIN)
    assert [shape.zone for shape in fence.shapes] == ['p', 'c']


def test_a_polygon_over_the_plan_is_never_the_price_of_simplification():
    comb = [(0, 0), (100, 0), (100, 100), (60, 100), (60, 20), (40, 20), (40, 100), (0, 100)]
    zone = ThreatZone.polygon('comb', comb)
    task = FlightSpace((((50.0, 200.0, 50.0), (50.0, 60.0, 50.0)),), 50.0, 50.0)
    assert choose_fence([zone], None, task, 70, ORIGIN).shapes
    fence = choose_fence([zone], None, task, 4, ORIGIN)
    assert fence.no_space == ('comb',)
    assert choose_fence([zone], None, FlightSpace(), 4, ORIGIN).shapes


@pytest.mark.parametrize(('heights', 'carried'), [
    ((30.0, 60.0), True), ((30.0, 130.0), False), ((5.0, 60.0), False)])
def test_a_zone_with_heights_is_carried_where_its_free_side_cannot_be_used(heights, carried):
    zone = ThreatZone.cylinder('z', (500.0, 0.0), 50.0, 10.0, 120.0)
    fence = choose_fence([zone], None, FlightSpace(((), ), *heights), 70, ORIGIN)
    assert bool(fence.shapes) is carried
    assert ('z' in fence.free_side) is not carried


def test_the_area_is_an_inclusion_and_waits_for_a_plan_inside():
    area = FenceShape('', corners=((-100.0, -100.0), (900.0, -100.0), (900.0, 900.0),
                                   (-100.0, 900.0)), inclusion=True)
    inside = FlightSpace((((0.0, 0.0, 50.0), (800.0, 800.0, 50.0)),), 50.0, 50.0)
    fence = choose_fence([], area, inside, 70, ORIGIN)
    assert fence.shapes == (area,)
    outside = FlightSpace((((0.0, 0.0, 50.0), (1000.0, 800.0, 50.0)),), 50.0, 50.0)
    assert 'fence_area' in choose_fence([], area, outside, 70, ORIGIN).waiting


def test_an_area_of_more_corners_than_the_store_has_is_named_and_the_zones_are_carried():
    corners = tuple((900.0 * math.cos(k * math.tau / 20), 900.0 * math.sin(k * math.tau / 20))
                    for k in range(20))
    area = FenceShape('', corners=corners, inclusion=True)
    zone = ThreatZone.cylinder('z', (500.0, 0.0), 50.0)
    fence = choose_fence([zone], area, FlightSpace(), 15, ORIGIN)
    assert [shape.zone for shape in fence.shapes] == ['z']
    assert fence.no_space == ('fence_area',)
    assert choose_fence([zone], area, FlightSpace(), 21, ORIGIN).no_space == ()
    assert choose_fence([zone], area, FlightSpace(), 20, ORIGIN).no_space == ('z',)


def test_a_circle_that_is_read_back_smaller_is_not_alike():
    items = fence_items([FenceShape('c', (10.0, 20.0), 35.25)], ORIGIN)
    assert fences_alike(items, items)
    smaller = fence_items([FenceShape('c', (10.0, 20.0), 35.0)], ORIGIN)
    assert not fences_alike(items, smaller)
