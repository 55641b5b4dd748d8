# SPDX-License-Identifier: Apache-2.0
"""Work in pieces: cut once, done when all pieces are, cut again around zones; nothing twice."""
import math
from dataclasses import replace

import pytest
from allocation import AllocatorDriver, as_plan

from uav_task_alloc.allocator.persistence.restore import restored_state
from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.allocator.state.stop_times import way_ahead
from uav_task_alloc.allocator.status import health_values, status_of_work
from uav_task_alloc.model import Leg, Task, ThreatZone
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.recut import FlownWays
from uav_task_alloc.work.values import Kind

# six strips from west to east, 20 m apart, of 200 m each
FIELD = Work(Task('field', (100.0, 0.0, 50.0), value=6.0), Kind.AREA, tuple(
    (x, y, 50.0) for x, y in ((100, 0), (300, 0), (300, 120), (100, 120))), strip_width=20.0,
    direction=math.pi)
MIDDLE = ThreatZone.cylinder('tower', (200.0, 60.0), 15.0)


def shares(uavs, tasks, zones=(), *, locked=None, route_end='hold', warm=None, **_):
    """Each task to the UAV whose part of the field it is in, from the south to the north."""
    place = {task.id: task for task in tasks}
    routes = {uav.id: [t for t in (locked or {}).get(uav.id, ()) if t in place] for uav in uavs}
    given, left_out = {t for route in routes.values() for t in route}, {}
    for task in sorted(tasks, key=lambda each: each.position[1]):
        able = [uav for uav in uavs if task.allowed_uavs is None or uav.id in task.allowed_uavs]
        if task.id not in given and able:
            uav = able[min(len(able) - 1, int(task.position[1] * len(able) / 120.0))]
            routes[uav.id].append(task.id)
        elif task.id not in given:
            left_out[task.id] = 'no UAV can'
    return as_plan(uavs, place, zones, routes, left_out, route_end, warm)


def fleet(saved=None, **params):
    driver = AllocatorDriver(saved, shares, **params)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 0.0, 120.0, 50.0)
    return driver


def route(driver, uav_id):
    return driver.world.list_of(uav_id).task_ids


def pieces(driver):
    return driver.world.works.records['field'].pieces


def status(driver):
    world = driver.world
    return status_of_work(world.works, world.works.records['field'], world.deadlines.expected)


def fly(driver, uav_id, count=1):
    """Let a UAV complete its next pieces; returns their ways."""
    ways = []
    for _ in range(count):
        stop = driver.world.list_of(uav_id).stops[0]
        driver.uav(uav_id, *stop.exit)
        assert driver.event('COMPLETED', stop.task.id, uav_id) == ''
        ways.append(stop.way)
        driver.settle(report=False)
    return ways


def unflown_parts(way, flown):
    return FlownWays(flown).unflown_parts(way)


def test_an_area_is_flown_in_strips_by_all_uavs_and_done_when_all_are():
    driver = fleet()
    assert [verdict.accepted for verdict in driver.add(FIELD)] == [True]
    driver.settle()
    assert len(pieces(driver)) == 6
    assert {*route(driver, 'a'), *route(driver, 'b')} == set(pieces(driver))
    found = status(driver)
    assert (found.state.name, found.pieces_done, found.pieces) == ('ASSIGNED', 0, 6)
    first = len(driver.world.list_of('a').stops)
    fly(driver, 'a', first)
    found = status(driver)
    assert found.state.name == 'ASSIGNED'
    assert found.pieces_done == first
    assert found.reason.startswith(f'{first} of 6 strips')
    fly(driver, 'b', 6 - first)
    found = status(driver)
    assert (found.state.name, found.pieces_done, found.reason) == ('COMPLETED', 6, '6 of 6 strips')
    assert health_values(driver.world, False)['tasks COMPLETED'] == 1
    assert driver.add(FIELD)[0].unchanged


def test_a_lost_uav_leaves_only_its_unflown_strips_to_the_others():
    driver = fleet(uav_timeout=3.0)
    driver.add(FIELD)
    driver.settle()
    flown = fly(driver, 'a', 2)
    driver.now += 10.0
    driver.uav('b', 0.0, 120.0, 50.0)  # `a` is silent
    driver.settle(report=False)
    rest = len(driver.world.list_of('b').stops)
    assert rest == 4
    assert not driver.world.list_of('a').stops
    flown += fly(driver, 'b', rest)
    assert status(driver).state.name == 'COMPLETED'
    assert len({frozenset((way[0], way[-1])) for way in flown}) == 6  # each once


def test_a_restart_in_mid_survey_goes_on_with_the_same_pieces():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    flown = fly(driver, 'a', 2)
    saved = restored_state(driver.core.rows())
    assert saved.unreadable == []
    again = fleet(saved)
    again.settle()
    again.settle(wait=5.0)  # the hold after a restart
    assert again.world.works.records == driver.world.works.records
    assert {**again.world.tasks.records}.keys() == {**driver.world.tasks.records}.keys()
    assert status(again).pieces_done == 2
    assert {task_id for uav_id in 'ab' for task_id in route(again, uav_id)} == {
        task_id for task_id in pieces(again) if again.state(task_id) != 'COMPLETED'}
    assert all(again.state(task_id) == driver.state(task_id) for task_id in pieces(again))
    assert flown
    assert again.add(FIELD)[0].unchanged


def test_pieces_without_their_work_are_dropped_and_lost_pieces_are_cut_again():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    rows = driver.core.rows()
    orphans = restored_state([row for row in rows if row.kind != 'work'])
    assert AllocatorDriver(orphans).world.tasks.records == {}
    lacking = restored_state([row for row in rows if row.id not in ('field#2', 'field#5')])
    again = fleet(lacking)
    again.settle(wait=5.0)
    ways = {again.world.tasks.records[each].task.path for each in pieces(again)}
    assert ways == {driver.world.tasks.records[each].task.path for each in pieces(driver)}


def test_cancelling_withdraws_what_is_not_flown():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    fly(driver, 'a')
    assert driver.cancel('field')[0].accepted
    driver.settle()
    assert not route(driver, 'a')
    assert not route(driver, 'b')
    found = status(driver)
    assert (found.state.name, found.pieces_done) == ('CANCELLED', 1)
    assert found.reason == '1 of 6 strips; cancelled'
    assert driver.cancel('field')[0].unchanged
    assert not driver.add(FIELD, action=AnnouncementAction.UPDATE)[0].accepted


def test_an_update_changes_the_pieces_that_are_not_flown():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    first = route(driver, 'a')[0]
    fly(driver, 'a')
    only_b = replace(FIELD, task=replace(FIELD.task, allowed_uavs=frozenset({'b'})))
    assert driver.add(only_b, action=AnnouncementAction.UPDATE)[0].accepted
    driver.settle()
    assert not route(driver, 'a')
    assert set(route(driver, 'b')) == set(pieces(driver)) - {first}
    assert driver.world.tasks.records[first].task.allowed_uavs is None
    # twice as wide: what is flown of it is not flown again
    wide = replace(FIELD, path=tuple((x, y if y == 0 else 240.0, z) for x, y, z in FIELD.path))
    assert driver.add(wide, action=AnnouncementAction.UPDATE)[0].accepted
    driver.settle()
    assert len(pieces(driver)) == 12
    assert status(driver).pieces_done == 1


def test_a_zone_over_strips_cuts_those_that_are_not_flown_and_they_come_back():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    flown = fly(driver, 'a')
    whole = {driver.world.tasks.records[each].task.path for each in pieces(driver)}
    driver.world.set_zones([MIDDLE], (), driver.now)
    driver.settle()
    ways = [driver.world.tasks.records[each].task.path for each in pieces(driver)]
    assert flown[0] in ways
    assert all(MIDDLE.radius < math.dist(point[:2], MIDDLE.center[:2])
               for way in ways for point in way)
    assert {*route(driver, 'a'), *route(driver, 'b')} == {
        each for each in pieces(driver) if driver.state(each) != 'COMPLETED'}
    driver.world.set_zones([], (), driver.now)
    driver.settle()
    assert {driver.world.tasks.records[each].task.path for each in pieces(driver)} == whole
    assert status(driver).pieces_done == 1
    fly(driver, 'a', len(route(driver, 'a')))
    fly(driver, 'b', len(route(driver, 'b')))
    assert status(driver).state.name == 'COMPLETED'


def test_what_was_flown_beside_a_zone_is_not_flown_again_when_it_goes():
    driver = fleet()
    driver.world.set_zones([MIDDLE], (), driver.now)
    driver.add(FIELD)
    driver.settle()
    beside = next(stop for stop in driver.world.list_of('b').stops
                  if stop.task.path_length < 199.0)
    driver.world.lists.lists['b'] = replace(driver.world.list_of('b'), stops=(beside,))
    fly(driver, 'b')
    driver.world.set_zones([], (), driver.now)
    driver.settle()
    flown = [driver.world.tasks.records[each].task.path for each in pieces(driver)
             if driver.state(each) == 'COMPLETED']
    assert flown == [beside.task.path]
    for each in pieces(driver):
        if driver.state(each) != 'COMPLETED':
            way = driver.world.tasks.records[each].task.path
            assert unflown_parts(way, flown) == [way]
    total = sum(driver.world.tasks.records[each].task.path_length for each in pieces(driver))
    assert total == pytest.approx(1200.0, abs=25.0)  # it led around the tower


def test_a_piece_flown_while_it_was_cut_again_counts():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    hit = next(task_id for task_id in route(driver, 'a')
               if driver.world.tasks.records[task_id].task.path[0][1] == pytest.approx(50.0))
    revision = driver.world.list_of('a').revision
    driver.world.set_zones([MIDDLE], (), driver.now)
    driver.settle()
    assert driver.state(hit) == 'CANCELLED'
    for _ in range(2):  # a bridge repeats its events
        assert driver.event('COMPLETED', hit, 'a', revision) == ''
        driver.settle()
    way = driver.world.tasks.records[hit].task.path
    assert status(driver).pieces_done == 1
    for each in pieces(driver):
        path = driver.world.tasks.records[each].task.path
        assert driver.state(each) == 'COMPLETED' or unflown_parts(path, [way]) == [path]


def test_an_order_for_work_is_one_for_all_its_pieces():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    assert driver.order('PIN', 'b', 'field').success
    driver.settle()
    assert not route(driver, 'a')
    assert set(route(driver, 'b')) == set(pieces(driver))
    answer = driver.order('ORDER', 'b', 'field')
    assert not answer.success
    assert 'pin it to b instead' in answer.message
    assert driver.order('PIN', 'b', 'field', clear=True).success
    assert driver.order('FORBID', 'b', 'field').success
    driver.settle()
    assert set(route(driver, 'a')) == set(pieces(driver))
    assert not route(driver, 'b')
    fly(driver, 'a', 6)
    assert not driver.world.orders.in_force


def test_ids_are_of_points_or_of_other_work():
    driver = fleet()
    driver.add(('t1', 10, 10), FIELD)
    point = replace(FIELD, task=replace(FIELD.task, id='t1'))
    for refused in (driver.add(point)[0], driver.add(('field', 1, 1))[0],
                    driver.add(replace(FIELD, strip_width=30.0))[0]):
        assert not refused.accepted
        assert 'duplicate id' in refused.reason
    assert status(driver).state.name == 'PENDING'


def test_a_point_does_not_become_work_by_an_update():
    driver = fleet()
    driver.add(('field', 500, 0))
    driver.settle()
    before = driver.world.tasks.records['field']
    refused = driver.add(FIELD, action=AnnouncementAction.UPDATE)[0]
    assert (refused.accepted, refused.reason) == (
        False, "kind = 'AREA': expected POINT, as it was announced")
    assert driver.world.tasks.records['field'] == before
    assert driver.world.works.records == {}


def test_an_update_with_a_deadline_that_cannot_be_kept_is_refused():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    for latest, text in ((-500.0, '8 min in the past'), (1.0, 'cannot be kept')):
        late = replace(FIELD, task=replace(FIELD.task, latest=driver.now + latest))
        assert text in driver.add(late, action=AnnouncementAction.UPDATE)[0].reason
    driver.settle()
    assert driver.world.works.records['field'].work == FIELD
    assert all(driver.state(each) == 'ASSIGNED' for each in pieces(driver))


def test_work_that_is_too_much_or_late_is_refused():
    driver = fleet()
    late = replace(FIELD, task=replace(FIELD.task, latest=driver.now - 5.0))
    assert 'in the past' in driver.add(late)[0].reason
    narrow = replace(FIELD, strip_width=0.01)
    assert 'strip_width' in driver.add(narrow)[0].reason
    assert driver.world.works.records == {}


def test_ended_work_is_forgotten_as_a_whole():
    driver = fleet(keep_ended=3)
    driver.add(FIELD)
    driver.settle()
    fly(driver, 'a', len(route(driver, 'a')))
    assert status(driver).pieces_done > 0  # of open work nothing is forgotten
    fly(driver, 'b', len(route(driver, 'b')))
    driver.settle(wait=1.0)
    assert driver.world.works.records == {}
    assert driver.world.tasks.records == {}
    rows = {(row.kind, row.id): row.body for row in driver.core.rows()}
    assert rows['work', 'field'] is None
    assert rows['task', 'field#1'] is None


def test_points_are_forgotten_beside_open_work_with_more_flown_pieces():
    driver = fleet(keep_ended=1)
    driver.add(FIELD)
    driver.settle()
    fly(driver, 'a', len(route(driver, 'a')))
    assert status(driver).pieces_done > 1
    for k in range(3):
        driver.add((f't{k}', 0, 0))
        driver.cancel(f't{k}')
    driver.settle()
    assert {name for name in driver.world.tasks.records if name.startswith('t')} == {'t2'}


def test_parts_of_a_way_that_are_flown_are_taken_out():
    way = ((0.0, 0.0, 50.0), (100.0, 0.0, 50.0), (100.0, 50.0, 50.0))
    assert unflown_parts(way, []) == [way]
    assert unflown_parts(way, [((30.0, -20.0, 50.0), (30.0, 20.0, 50.0))]) == [way]  # it crosses
    assert unflown_parts(way, [((30.0, 0.0, 80.0), (60.0, 0.0, 80.0))]) == [way]  # it is above
    assert unflown_parts(way, [((60.0, 0.0, 50.0), (30.0, 0.0, 50.0))]) == [
        ((0.0, 0.0, 50.0), (30.0, 0.0, 50.0)), ((60.0, 0.0, 50.0), *way[1:])]
    assert unflown_parts(way, [way[::-1]]) == []


def test_a_uav_along_its_strip_goes_on_without_detour_points_and_with_the_rest_planned():
    driver = fleet()
    driver.world.set_zones([ThreatZone.cylinder('mast', (60.0, 5.0), 12.0)], (), driver.now)
    driver.add(FIELD)
    driver.settle()
    first = driver.world.list_of('a').stops[0]
    assert first.leg.via
    driver.uav('a', *first.leg.via[0], active_task=first.task.id)  # before its begin
    driver.add(('t1', 90, 30))
    driver.settle(report=False)
    assert driver.world.list_of('a').stops[0].leg.via
    half = tuple((a + b) / 2.0 for a, b in zip(first.entry, first.exit, strict=True))
    driver.uav('a', *half, active_task=first.task.id)
    driver.add(('t2', 90, 50))
    problem = driver.begin()
    rest = next(task for task in problem.tasks if task.id == first.task.id)
    assert rest.path == (half, first.exit)
    assert not rest.reversible
    assert problem.locked['a'] == (first.task.id,)
    driver.finish(problem)
    again = driver.world.list_of('a').stops[0]
    assert (again.task, again.reversed) == (first.task, first.reversed)
    assert again.leg == Leg((), 0.0)
    # a UAV abeam of the strip is not on it
    assert way_ahead((half[0], half[1] - 30.0, half[2]), first) is None


def test_a_path_that_is_flown_backwards_is_planned_as_it_is_flown():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    lists, published = driver.world.lists.lists, driver.world.list_of('a')
    lists['a'] = replace(published, stops=(replace(published.stops[0], reversed=True),
                                           *published.stops[1:]))
    first = driver.world.list_of('a').stops[0]
    assert first.entry == first.task.path[-1]
    near = (first.entry[0] + (20.0 if first.exit[0] > first.entry[0] else -20.0),
            *first.entry[1:])
    driver.uav('a', *near, active_task=first.task.id)
    driver.add(('t2', 90, 50))
    problem = driver.begin()
    assert first.task.id not in problem.published.reversed | problem.warm.reversed
    rest = next(task for task in problem.tasks if task.id == first.task.id)
    assert rest.path == (near, first.task.path[0])
    driver.finish(problem)
    assert driver.world.list_of('a').stops[0].reversed
