# SPDX-License-Identifier: Apache-2.0
"""Invariants of paths: symmetry, triangle inequality, more zones, scale, rotation."""
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scenes import CLEARANCE, random_point, random_zones, violations

from uav_task_alloc.geometry.detour import detour, find_detour
from uav_task_alloc.model import Shape, ThreatZone

RUNS = settings(derandomize=True, deadline=None, max_examples=40)
TOLERANCE = 0.02  # of the length; benchmarks/detours.py measures what it is


@st.composite
def scenes(draw, points=2):
    """A few zones of all shapes, apart or not, and points outside them."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    zones = random_zones(rng, draw(st.integers(1, 5)), draw(st.booleans()), 900.0, 200.0)
    return zones, [random_point(rng, zones, 900.0) for _ in range(points)]


def safe_path(a, b, zones, **more):
    return detour(a, b, zones, clearance=CLEARANCE, **more)


@RUNS
@given(scenes())
def test_there_and_back_is_the_same_path(scene):
    zones, (a, b) = scene
    there, back = safe_path(a, b, zones), safe_path(b, a, zones)
    assert there == (back[0], tuple(reversed(back[1])))


@RUNS
@given(scenes())
def test_a_path_is_never_inside_an_enlarged_zone_and_its_length_is_that_of_the_polyline(scene):
    zones, (a, b) = scene
    length, points = safe_path(a, b, zones)
    if math.isinf(length):
        return
    assert violations([a, *points, b], zones) == 0
    line = np.array([a, *points, b])
    assert length == pytest.approx(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


@RUNS
@given(scenes(points=3))
def test_a_stop_in_between_never_makes_a_path_shorter(scene):
    zones, (a, b, c) = scene
    straight, first, second = (safe_path(*ends, zones)[0] for ends in ((a, c), (a, b), (b, c)))
    assert straight <= (first + second) * (1 + TOLERANCE)


@RUNS
@given(scenes())
def test_more_zones_never_make_a_path_shorter(scene):
    zones, (a, b) = scene
    lengths = [safe_path(a, b, zones[:count])[0] for count in range(len(zones) + 1)]
    for fewer, more in pairwise(lengths):
        assert more >= fewer * (1 - TOLERANCE)


@st.composite
def special_scenes(draw):
    """Zones that touch, nest, hang and are tiny, also far away; ends anywhere, also inside."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    east, north = draw(st.sampled_from([(0.0, 0.0), (1e5, -7e4)]))
    low, high = draw(st.sampled_from([(-math.inf, math.inf), (5.0, 90.0)]))
    zones = []
    for k in range(draw(st.integers(1, 3))):
        x, y = rng.uniform(0, 500, 2) + (east, north)
        r, margin = float(rng.choice([0.1, 40.0, 120.0])), float(rng.choice([0.0, 5.0]))
        zones += [
            ThreatZone.cylinder(f'c{k}', (x, y), r, 30.0, 60.0, margin),
            ThreatZone.cylinder(f'touching{k}', (x + 2 * r + 2 * margin, y), r, margin=margin),
            ThreatZone.hemisphere(f'nested{k}', (x, y, 20.0), 0.5 * r, margin),
            ThreatZone.polygon(f'concave{k}', [(x, y), (x + r, y - r), (x + r, y + r),
                                              (x + 0.8 * r, y)], -math.inf, 50.0, margin)]
    ends = [(float(rng.uniform(-50, 550) + east), float(rng.uniform(-50, 550) + north),
             float(rng.uniform(5, 90))) for _ in range(2)]
    return zones, ends, low, high


@RUNS
@given(special_scenes())
def test_a_path_in_any_scene_is_clear_once_outside_and_keeps_the_limits(scene):
    zones, (a, b), low, high = scene
    result = find_detour(a, b, zones, altitude_min=low, altitude_max=high)
    if math.isinf(result.length):
        assert result.goal_inside or result.closed_off
        return
    line = [*result.points, b] if result.start_inside else [a, *result.points, b]
    assert violations(line, zones, 0.0) == 0
    assert all(low <= z <= high for _, _, z in result.points)
    assert result.length >= math.dist(a, b) * (1 - 1e-9)


@RUNS
@given(scenes())
def test_a_path_to_the_start_itself_has_no_length(scene):
    zones, (a, _) = scene
    assert safe_path(a, a, zones) == (0.0, ())


def changed(zone, scale=1.0, turn=0.0):
    """The zone scaled and turned about the z axis."""
    def move(x, y):
        return (scale * (x * math.cos(turn) - y * math.sin(turn)),
                scale * (x * math.sin(turn) + y * math.cos(turn)))
    x, y, z = zone.center
    if zone.shape is Shape.HEMISPHERE:
        return ThreatZone.hemisphere(zone.id, (*move(x, y), scale * z), scale * zone.radius,
                                     scale * zone.margin)
    rest = scale * zone.z_min, scale * zone.z_max, scale * zone.margin
    if zone.shape is Shape.CYLINDER:
        return ThreatZone.cylinder(zone.id, move(x, y), scale * zone.radius, *rest)
    return ThreatZone.polygon(zone.id, [move(*v) for v in zone.vertices], *rest)


@RUNS
@given(scenes(), st.floats(0.1, 10.0), st.floats(-3.0, 3.0))
def test_scale_and_rotation_only_scale_the_length(scene, scale, turn):
    zones, ends = scene
    here = safe_path(*ends, zones)[0]
    moved = [changed(ThreatZone.hemisphere('p', p, 1.0), scale, turn).center for p in ends]
    there = detour(*moved, [changed(zone, scale, turn) for zone in zones],
                   clearance=scale * CLEARANCE)[0]
    assert math.isinf(here) == math.isinf(there)
    if math.isfinite(here):
        assert there == pytest.approx(scale * here, rel=TOLERANCE)
