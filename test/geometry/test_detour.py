# SPDX-License-Identifier: Apache-2.0
"""Single zones against their closed forms, and special starts, goals and pockets."""
import math
from itertools import pairwise

import pytest
from dense import Dense
from scenes import violations

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.detour import detour, find_detour
from uav_task_alloc.geometry.zones import inside, is_clear
from uav_task_alloc.model import ThreatZone

FENCE = [ThreatZone.cylinder(f'c{i}', (300 * math.cos(i * math.pi / 6),
                                       300 * math.sin(i * math.pi / 6)), 90.0)
         for i in range(12)]  # a closed ring, without top or bottom


def arc(d, r):
    """Length of tangent, arc, tangent between opposite points at distance d from the centre."""
    return 2 * math.sqrt(d * d - r * r) + r * (math.pi - 2 * math.acos(r / d))


def test_without_zones_the_path_is_straight():
    assert detour((0, 0, 0), (3, 4, 12), []) == (13.0, ())


def test_a_zone_aside_changes_nothing():
    zone = ThreatZone.hemisphere('z', (0, 500, 0), 100)
    assert detour((-300, 0, 10), (300, 0, 10), [zone]) == (600.0, ())


def test_a_path_to_the_start_itself_has_no_length():
    assert detour((1, 2, 3), (1, 2, 3), [ThreatZone.cylinder('z', (50, 0), 10)]) == (0.0, ())


def test_level_paths_pass_a_dome_like_a_circle():
    zone = ThreatZone.hemisphere('z', (0, 0, 0), 80)
    length, points = detour((-250, 0, 0), (250, 0, 0), [zone])
    assert length == pytest.approx(arc(250, 80), rel=2e-3)
    assert 1 <= len(points) <= 8


def test_over_the_dome_is_taken_where_it_is_shorter():
    zone = ThreatZone.hemisphere('z', (0, 0, 0), 80)
    length, points = detour((-250, 0, 60), (250, 0, 60), [zone])
    assert max(z for _, _, z in points) > 80
    d = math.hypot(250, 60)
    over = 2 * math.sqrt(d * d - 80 * 80) + 80 * (
        math.pi - 2 * math.atan2(60, 250) - 2 * math.acos(80 / d))
    assert length == pytest.approx(over, rel=2e-3)


def test_no_path_leads_under_a_dome_unless_an_end_is_below_its_base():
    zone = ThreatZone.hemisphere('z', (0, 0, 0), 80)
    _, points = detour((-100, 0, 5), (100, 0, 5), [zone])
    assert min(z for _, _, z in points) >= 0
    assert detour((-100, 0, -5), (100, 0, -5), [zone]) == (200.0, ())


def test_around_a_tall_cylinder_the_height_changes_evenly():
    zone = ThreatZone.cylinder('z', (0, 0), 80)
    length, points = detour((-250, 0, 0), (250, 0, 100), [zone])
    assert length == pytest.approx(math.hypot(arc(250, 80), 100), rel=2e-3)
    assert [z for _, _, z in points] == sorted(z for _, _, z in points)


@pytest.mark.parametrize(('low', 'high', 'z'), [(-math.inf, 60.0, 60.0), (40.0, math.inf, 40.0)])
def test_over_or_under_a_low_or_a_hanging_cylinder(low, high, z):
    zone = ThreatZone.cylinder('z', (0, 0), 80, low, high)
    length, points = detour((-250, 0, 50), (250, 0, 50), [zone])
    assert length == pytest.approx(160 + 2 * math.hypot(170, 10), rel=2e-3)
    assert all(abs(p[2] - z) < 0.1 for p in points)


def test_a_prism_is_passed_at_its_nearer_corners():
    zone = ThreatZone.polygon('z', [(200, -100), (300, -100), (300, 90), (200, 90)])
    length, points = detour((0, 0, 50), (500, 0, 50), [zone])
    assert length == pytest.approx(100 + 2 * math.hypot(200, 90), rel=2e-3)
    assert len(points) == 2
    assert all(y > 90 for _, y, _ in points)


def test_a_notch_can_be_flown_into_and_out_of():
    zone = ThreatZone.polygon('z', [(0, 0), (300, 0), (300, 300), (200, 300), (200, 100),
                                    (100, 100), (100, 300), (0, 300)])
    length, points = detour((150, 150, 10), (-100, 150, 10), [zone])
    assert length == pytest.approx(math.hypot(50, 150) + 100 + math.hypot(100, 150), rel=2e-3)
    assert violations([(150, 150, 10), *points, (-100, 150, 10)], [zone], 0.0) == 0


def test_the_altitude_limit_forces_a_path_around():
    zone = ThreatZone.cylinder('z', (0, 0), 80, -1000.0, 60.0)
    length, points = detour((-250, 0, 50), (250, 0, 50), [zone], altitude_max=55)
    assert length == pytest.approx(arc(250, 80), rel=2e-3)
    assert max(z for _, _, z in points) <= 55


def test_a_dome_under_a_low_ceiling_is_passed_at_the_ceiling():
    zone = ThreatZone.hemisphere('z', (0, 0, 0), 100)
    length, points = detour((-300, 10, 60), (300, 10, 60), [zone], altitude_max=70)
    assert max(z for _, _, z in points) <= 70
    low, high = arc(300, math.sqrt(100 ** 2 - 70 ** 2)), arc(300, 80)
    assert 0.99 * low < length < high
    assert violations([(-300, 10, 60), *points, (300, 10, 60)], [zone], 0.0) == 0


def test_from_just_beside_a_hanging_cylinder_the_path_beneath_is_found():
    zone = ThreatZone.cylinder('z', (0, 0), 230, 40.0, margin=5.0)
    a, b = (235.5, 0.0, 45.0), (-400.0, 50.0, 45.0)
    length, points = detour(a, b, [zone])
    assert max(z for _, _, z in points) < 35
    assert length == pytest.approx(10 + math.hypot(470, 37) + math.hypot(165, 15), rel=1e-2)
    assert violations([a, *points, b], [zone], 0.0) == 0


def test_beneath_a_lower_zone_the_path_stays_low_around_the_next():
    walls = [ThreatZone.cylinder('wall', (300, 0), 100),
             ThreatZone.cylinder('left', (300, 400), 380, 40.0),
             ThreatZone.cylinder('right', (300, -400), 380, 40.0)]
    a, b = (0.0, 0.0, 60.0), (700.0, 0.0, 60.0)
    length, points = detour(a, b, walls, altitude_min=0.0, altitude_max=100.0)
    reference = Dense(walls, low=0.0, high=100.0).length(a, b)
    assert length == pytest.approx(reference, rel=1e-2)
    assert violations([a, *points, b], walls, 0.0) == 0


@pytest.mark.parametrize(('start', 'low', 'high'), [
    ((15.0, 160.0, 80.0), 0.0, 70.0), ((0.0, 160.0, 2.0), 5.0, 70.0)])
def test_waypoints_keep_the_altitude_limits_though_an_end_is_beyond_them(start, low, high):
    zones = [ThreatZone.hemisphere('dome', (44, 195, 80), 39, 5.0),
             ThreatZone.cylinder('tower', (100, 100), 60),
             ThreatZone.hemisphere('sunk', (200, 60, -30), 60)]
    length, points = detour(start, (333, 2, 31), zones, altitude_min=low, altitude_max=high)
    assert length < math.inf
    assert all(low <= z <= high for _, _, z in points)


def test_margin_and_clearance_are_kept():
    zone = ThreatZone.cylinder('z', (0, 0), 80, margin=10.0)
    a, b = (-250.0, 0.0, 50.0), (250.0, 0.0, 50.0)
    length, points = detour(a, b, [zone], clearance=5.0)
    assert length == pytest.approx(arc(250, 95), rel=2e-3)
    assert violations([a, *points, b], [zone], 5.0) == 0


def test_a_start_inside_is_left_by_the_shortest_path_and_reported():
    zone = ThreatZone.polygon('z', [(200, -100), (300, -100), (300, 90), (200, 90)])
    result = find_detour((290, 0, 50), (0, 0, 50), [zone])
    assert result.start_inside == ('z',)
    assert 'start is inside zone z' in result.reason
    assert math.dist((290, 0, 50), result.points[0]) == pytest.approx(10, abs=0.1)
    assert not inside(result.points[0], zone)


def test_a_start_inside_two_zones_leaves_both():
    zones = [ThreatZone.cylinder('a', (0, 0), 100), ThreatZone.cylinder('b', (120, 0), 100)]
    result = find_detour((60, 0, 50), (60, 400, 50), zones)
    assert result.start_inside == ('a', 'b')
    assert math.dist((60, 0, 50), result.points[0]) == pytest.approx(80, rel=0.01)
    assert not any(inside(result.points[0], zone) for zone in zones)


def test_the_way_out_of_a_clearance_is_not_through_the_zone():
    above = ThreatZone.cylinder('above', (0.0, 0.0), 60.0, 55.0, 80.0)
    below = ThreatZone.cylinder('below', (0.0, 0.0), 60.0, z_max=45.0)
    start, goal = (0.0, 0.0, 50.0), (300.0, 0.0, 50.0)
    found = find_detour(start, goal, (above, below), clearance=10.0)
    assert math.isclose(found.length, 300.0, abs_tol=1.0)
    for a, b in pairwise((start, *found.points, goal)):
        assert is_clear(a, b, (above, below))


def test_a_goal_inside_is_unreachable_and_reported():
    result = find_detour((-500, 0, 50), (0, 0, 50), [ThreatZone.hemisphere('z', (0, 0, 0), 100)])
    assert (result.length, result.points, result.goal_inside) == (math.inf, (), ('z',))
    assert result.reason == 'the goal is inside zone z'
    assert detour((-500, 0, 50), (0, 0, 50), [ThreatZone.cylinder('z', (0, 0), 9)])[1] == ()


def test_a_closed_pocket_is_unreachable_and_reported():
    result = find_detour((0, 0, 50), (600, 0, 50), FENCE)
    assert (result.length, result.points, result.closed_off) == (math.inf, (), True)
    assert result.reason == 'closed off by zones'


def test_a_pocket_with_a_gap_is_left_by_the_gap():
    zones = FENCE[:6] + FENCE[7:]
    length, points = detour((0, 0, 50), (600, 0, 50), zones)
    assert length == pytest.approx(Dense(zones).length((0, 0, 50), (600, 0, 50)), rel=0.01)
    assert violations([(0, 0, 50), *points, (600, 0, 50)], zones, 0.0) == 0


def test_a_roofless_pocket_is_left_over_its_wall():
    low = [ThreatZone.cylinder(z.id, z.center, z.radius, -1e3, 100.0) for z in FENCE]
    length, _ = detour((0, 0, 50), (600, 0, 50), low)
    assert 600 < length < 640


def test_nested_and_touching_zones_are_one_obstacle():
    outer = ThreatZone.cylinder('outer', (0, 0), 80)
    nested = ThreatZone.hemisphere('nested', (10, 0, 0), 40)
    touching = ThreatZone.cylinder('touching', (0, 160), 80)
    a, b = (-250.0, -1.0, 10.0), (250.0, -1.0, 10.0)
    alone = detour(a, b, [outer])[0]
    assert detour(a, b, [outer, nested, touching])[0] == pytest.approx(alone, rel=2e-3)


def test_an_end_that_touches_a_zone_is_outside_it():
    zone = ThreatZone.cylinder('z', (0, 0), 80)
    length, points = detour((-80.001, 0, 10), (250, 0, 10), [zone])
    half = math.sqrt(250 ** 2 - 80 ** 2) + 80 * (math.pi - math.acos(80 / 250))
    assert length == pytest.approx(half, rel=0.02)
    assert violations([(-80.001, 0.0, 10.0), *points, (250.0, 0.0, 10.0)], [zone], 0.0) == 0


@pytest.mark.parametrize(('call', 'text'), [
    (lambda: detour((0, 0, math.nan), (1, 0, 0)), 'a = .*expected three finite coordinates'),
    (lambda: detour((0, 0, 0), (1, 0)), 'b = .*expected three coordinates'),
    (lambda: detour((0, 0, 0), (1, 0, 0), clearance=-1.0), r'clearance = -1.0: expected'),
    (lambda: detour((0, 0, 0), (1, 0, 0), altitude_min=5, altitude_max=4),
     'expected altitude_min <= altitude_max'),
    (lambda: detour((0, 0, 0), (1, 0, 0), 3), 'zones = 3: expected an iterable of ThreatZone'),
    (lambda: detour((0, 0, 0), (1, 0, 0), ['z']), "zones = 'z': expected a ThreatZone"),
    (lambda: ThreatZone.hemisphere('z', (0, 0, 0), 0.0), 'zone z: radius = 0.0: expected'),
    (lambda: ThreatZone.polygon('z', [(0, 0), (1, 1)]), 'expected at least 3 corners'),
    (lambda: ThreatZone.polygon('z', [(0, 0), (1, 1), (1, 0), (0, 1)]),
     'expected edges that do not cross'),
    (lambda: ThreatZone.polygon('z', [(0, 0), (1, 0), (1, 0), (0, 1)]),
     'expected edges that do not cross'),
    (lambda: ThreatZone.cylinder('z', (0, 0), math.nan), 'zone z: radius = nan: expected'),
])
def test_degenerate_input_is_refused_with_value_and_expectation(call, text):
    with pytest.raises(InvalidValue, match=text):
        call()
