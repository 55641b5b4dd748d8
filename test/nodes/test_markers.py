# SPDX-License-Identifier: Apache-2.0
"""Markers and paths: sound whatever the world is, and true to it; of a running allocator too."""
import math

import pytest
from allocation import AllocatorDriver
from geometry_msgs.msg import Point
from hypothesis import given, settings, strategies as st
from nav_msgs.msg import Path
from picture_checks import check_markers, check_path, points, texts
from uav_task_alloc_msgs import msg as m
from visualization_msgs.msg import Marker, MarkerArray

from uav_task_alloc.allocator.list_records import ListStop, UavList
from uav_task_alloc.allocator.records import Outbox, TaskRecord, TaskState, UavReport
from uav_task_alloc.allocator.state.fleet import UavRecord
from uav_task_alloc.geometry.zones import inside
from uav_task_alloc.model import Leg, Task, ThreatZone
from uav_task_alloc.nodes.conversions.messages import (
    ANNOUNCEMENTS,
    LATCHED,
    STATES,
    announcement,
    from_zones,
)
from uav_task_alloc.nodes.conversions.path_messages import path_message
from uav_task_alloc.nodes.rviz import marker_publisher, zone_markers
from uav_task_alloc.nodes.rviz.markers import MOST_STOPS, MOST_TEXTS, MarkerScene, markers

AT = 5.0
NOTCHED = ThreatZone.polygon('p', [(0, 0), (90, 0), (90, 90), (45, 20), (0, 90)], 5.0, 60.0, 4.0)


def uav(uav_id, *position, home=(0.0, 0.0, 0.0), **more):
    return UavRecord(UavReport(uav_id, position), 0.0, home, **more)


def stop(name, *position, via=()):
    return ListStop(Task(name, position), Leg(via, 1.0), 0.0)


def record(name, *position, state=TaskState.PENDING, **more):
    task = Task(name, position, **more)
    return TaskRecord(task, task, state, reason='because')


coordinates = st.floats(-1e8, 1e8) | st.integers(-3, 3).map(float)
places = st.tuples(coordinates, coordinates, coordinates)
heights = st.sampled_from([(-math.inf, math.inf), (0.0, 50.0), (-math.inf, -20.0), (7.0, math.inf),
                           (-1e300, 1e300), (2e8, 3e8), (-3e8, -2e8)])
corners = st.sampled_from([[(0, 0), (9, 0), (9, 9)], [(0, 0), (0, 9), (9, 9), (1, 8)],
                           NOTCHED.vertices, [(0, 0), (1e-3, 0), (1e5, 1e-3)]])
sizes, margins = st.floats(1e-3, 1e7), st.floats(0.0, 1e6)
zones = (st.builds(lambda c, r, g: ThreatZone.hemisphere('z', c, r, g), places, sizes, margins)
         | st.builds(lambda c, r, h, g: ThreatZone.cylinder('z', c, r, *h, g), places, sizes,
                     heights, margins)
         | st.builds(lambda v, h, g: ThreatZone.polygon('z', v, *h, g), corners, heights, margins))
records = st.builds(lambda p, s, v: record('t', *p, state=s, value=v), places,
                    st.sampled_from(TaskState), st.floats(5e-324, 1e200))
lists = st.builds(
    lambda ways, returns: UavList('u1', 1, tuple(
        stop(f't{k}', *p, via=tuple(via)) for k, (p, via) in enumerate(ways)), returns),
    st.lists(st.tuples(places, st.lists(places, max_size=2)), max_size=4), st.booleans())
uavs = st.just({}) | st.builds(lambda p, silent: {'u1': uav('u1', *p, silent=silent)}, places,
                               st.booleans())


@given(st.lists(zones, max_size=3), st.lists(records, max_size=5), lists, uavs,
       st.sets(st.sampled_from(['t0', 't1', 't2'])))
@settings(max_examples=150, deadline=None)
def test_the_markers_of_any_world_are_valid(zones, tasks, one, uavs, changed):
    check_markers(markers(MarkerScene(
        AT, [one], tasks, uavs, zones, frozenset(changed), 'x' * 99)))
    check_path(path_message(one, uavs.get('u1')))


def test_an_empty_world_only_deletes():
    assert check_markers(markers(MarkerScene(AT))) == {}


def test_a_route_shows_its_order_its_arrows_its_detours_and_the_way_home():
    one = UavList('u1', 3, (stop('a', 100.0, 0.0, 5.0, via=((50.0, 20.0, 5.0),)),
                            stop('b', 200.0, 0.0, 5.0)), returns=True)
    left = check_markers(markers(MarkerScene(AT, [one], uavs={'u1': uav('u1', 0.0, 0.0, 5.0)})))
    assert texts(left, 'order') == ['1: a', '2: b']
    assert texts(left, 'uav_labels') == ['u1']
    assert points(left, 'routes') == [(0, 0, 5), (50, 20, 5), (100, 0, 5), (200, 0, 5), (0, 0, 0)]
    assert points(left, 'arrows') == [(50, 20, 5), (100, 0, 5), (100, 0, 5), (200, 0, 5)]
    assert points(left, 'detour_points') == [(50, 20, 5)]


def test_a_uav_that_waits_for_tasks_shows_where_and_its_way_there():
    one = UavList('u1', 3, end_via=((50.0, 20.0, 5.0), (90.0, 0.0, 5.0)))
    left = check_markers(markers(MarkerScene(AT, [one], uavs={'u1': uav('u1', 0.0, 0.0, 5.0)})))
    assert points(left, 'routes') == [(0, 0, 5), (50, 20, 5), (90, 0, 5)]
    assert texts(left, 'waiting_labels') == ['u1 waits here']
    place = left['waiting_places', 0].pose.position
    assert (place.x, place.y, place.z) == (90.0, 0.0, 5.0)
    assert check_path(path_message(one, uav('u1', 0.0, 0.0, 5.0))) == [
        (0.0, 0.0, 5.0), (50.0, 20.0, 5.0), (90.0, 0.0, 5.0)]


def test_tasks_are_coloured_by_state_and_sized_by_value():
    left = check_markers(markers(MarkerScene(AT, tasks=[
        record('a', 1.0, 0.0, 0.0, value=10.0), record('b', 2.0, 0.0, 0.0, value=1.0),
        record('c', 3.0, 0.0, 0.0, value=1.0, state=TaskState.UNASSIGNED),
        record('d', 4.0, 0.0, 0.0, value=1.0, state=TaskState.COMPLETED),
        record('e', 5.0, 0.0, 0.0, value=1.0, state=TaskState.CANCELLED)])))
    by_x = {each.points[0].x: each for (ns, _), each in left.items() if ns == 'tasks'}
    assert sorted(by_x) == [1, 2, 3, 4]
    assert by_x[1].color == by_x[2].color != by_x[3].color != by_x[4].color
    assert by_x[1].scale.x > by_x[2].scale.x == by_x[3].scale.x
    assert texts(left, 'left_out') == ['c: because']


def test_what_the_last_plan_changed_is_highlighted():
    one = UavList('u1', 3, (stop('a', 100.0, 0.0, 5.0), stop('b', 200.0, 0.0, 5.0)))
    scene = MarkerScene(AT, [one], changed=frozenset({'b'}), trigger='ADD b')
    left = check_markers(markers(scene))
    halo, leg = (each for (ns, _), each in left.items() if ns == 'replan')
    assert [p.x for p in halo.points] == [200.0]
    assert [p.x for p in leg.points] == [100.0, 200.0]
    assert texts(left, 'replan_label') == ['ADD b: 1 changed']


def test_a_silent_uav_is_labelled_and_grey():
    left = check_markers(markers(MarkerScene(AT, uavs={
        'u1': uav('u1', 0.0, 0.0, 0.0), 'u2': uav('u2', 9.0, 0.0, 0.0, silent=True)})))
    assert texts(left, 'uav_labels') == ['u1', 'u2 silent']
    assert left['uavs', 0].color != left['uavs', 1].color


def test_the_number_of_markers_is_bounded_for_thousands_of_tasks():
    tasks = [record(f't{k}', float(k), 0.0, 0.0, state=TaskState.UNASSIGNED) for k in range(3000)]
    one = UavList('u1', 1, tuple(stop(f's{k}', float(k), 9.0, 0.0) for k in range(2000)))
    left = check_markers(markers(MarkerScene(AT, [one], tasks)))
    assert len(points(left, 'tasks')) == 3000
    assert len(points(left, 'routes')) == 2000
    assert len(texts(left, 'order')) == MOST_STOPS
    assert len(left) < 2 * MOST_STOPS + MOST_TEXTS + 10


def test_a_dome_is_half_a_ball_with_its_margin():
    marker = Marker()
    zone_markers.set_volume(marker, ThreatZone.hemisphere('z', (7.0, 8.0, 9.0), 20.0, 5.0))
    assert marker.scale.x == marker.scale.y == marker.scale.z == 25.0
    assert (marker.pose.position.x, marker.pose.position.z) == (7.0, 9.0)
    assert all(p.z >= 0.0 and math.isclose(math.hypot(p.x, p.y, p.z), 1.0)
               for p in marker.points)


@pytest.mark.parametrize('zone', [
    NOTCHED, ThreatZone.polygon('q', [(0, 0), (0, 9), (9, 9), (9, 0)], margin=1.0)])
def test_a_prism_is_closed_to_its_top_and_covers_the_polygon_once(zone):
    marker = zone_markers.set_volume(Marker(), zone)
    low, high = zone_markers.height_span(zone)
    at = marker.pose.position
    corners = [(at.x + p.x, at.y + p.y, at.z + p.z) for p in marker.points]
    assert {z for _, _, z in corners} == {low, high}
    top = [corners[k:k + 3] for k in range(0, len(corners), 3)
           if all(z == high for _, _, z in corners[k:k + 3])]
    area = sum(((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2
               for a, b, c in top)
    rim = [(x, y) for x, y, z in corners if z == low]
    assert all(not inside((x, y, (low + high) / 2), zone) for x, y in rim)
    shoelace = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(
        rim[0::3], rim[1::3], strict=True)) / 2
    assert area == pytest.approx(shoelace)
    assert area > 0.0


@pytest.mark.ros
def test_nothing_is_published_without_subscribers_or_changes(probe, monkeypatch):
    drawn = []
    monkeypatch.setattr(marker_publisher, 'markers', lambda scene: drawn.append(scene) or markers(
        scene))
    monkeypatch.setattr(marker_publisher, '_PAUSE_FACTOR', 0.0)
    driver = AllocatorDriver()
    publisher = marker_publisher.MarkerPublisher(probe.node, driver.world)
    driver.uav('u1', 0.0, 0.0, 50.0)
    driver.add(('t1', 100.0, 0.0))
    publisher.update(Outbox(statuses=True))
    publisher.on_timer()
    assert drawn == []
    probe.collect(MarkerArray, 'allocation_markers', LATCHED)
    probe.until(lambda: publisher.publisher.get_subscription_count())
    publisher.on_timer()
    publisher.on_timer()
    assert [len(scene.tasks) for scene in drawn] == [1]
    driver.uav('u1', 9.0, 0.0, 50.0)
    publisher.on_timer()
    assert len(drawn) == 1  # it moved, but the markers are less than a second old
    publisher.published_at -= marker_publisher.POSITION_PERIOD
    publisher.on_timer()
    publisher.published_at -= marker_publisher.POSITION_PERIOD
    publisher.on_timer()
    assert len(drawn) == 2  # and then it did not move
    driver.world.set_zones([NOTCHED], {}, driver.now)
    publisher.on_timer()
    assert [len(scene.zones) for scene in drawn] == [0, 0, 1]


@pytest.mark.ros
def test_a_running_allocator_draws_what_exists_and_deletes_what_was_removed(start, probe):
    start('allocator', '-p', 'route_end:=hold')
    pictures = probe.collect(MarkerArray, 'allocation_markers', LATCHED)
    paths = probe.collect(Path, 'u1/path', LATCHED)
    states = probe.publisher(m.UavState, 'uav_states', STATES)
    tasks = probe.publisher(m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS)
    there = probe.publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)

    def shows(condition):
        def look():
            states.publish(m.UavState(uav_id='u1', available=True, battery=math.nan,
                                      position=Point(z=50.0), home=Point(x=math.nan),
                                      range_remaining=math.nan, cruise_speed=math.nan))
            return pictures and condition(check_markers(pictures[-1]))
        probe.until(look)

    far = ThreatZone.polygon('p', [(0, 500), (90, 500), (90, 590)])
    there.publish(from_zones([ThreatZone.cylinder('hut', (50.0, 0.0), 10.0), far], 0.0))
    both = [Task('t1', (100.0, 0.0, 50.0)), Task('t2', (200.0, 0.0, 50.0))]
    tasks.publish(announcement(m.TaskAnnouncement.ADD, both, 0.0))
    shows(lambda left: texts(left, 'order') == ['1: t1', '2: t2'])
    shows(lambda left: texts(left, 'zone_labels') == ['hut', 'p'])
    probe.until(lambda: paths and check_path(paths[-1])[-1] == (200.0, 0.0, 50.0))
    assert check_path(paths[-1])[0] == (0.0, 0.0, 50.0)
    there.publish(from_zones([far], 0.0))
    tasks.publish(announcement(m.TaskAnnouncement.CANCEL, both[1:], 0.0))
    shows(lambda left: texts(left, 'order') == ['1: t1'] and texts(left, 'zone_labels') == ['p'])
    assert (200.0, 0.0, 50.0) not in points(check_markers(pictures[-1]), 'tasks')
    late = probe.collect(MarkerArray, 'allocation_markers', LATCHED)
    probe.until(lambda: late)
    assert texts(check_markers(late[0]), 'order') == ['1: t1']
    count = len(paths)
    tasks.publish(announcement(m.TaskAnnouncement.CANCEL, both[:1], 0.0))
    probe.until(lambda: len(paths) > count)
    assert check_path(paths[-1]) == []
