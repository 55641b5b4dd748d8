# SPDX-License-Identifier: Apache-2.0
"""Work that is cut again in flight: what was withdrawn or flown stays so, and nothing is lost."""
import math
from dataclasses import replace

import pytest
from test_works import FIELD, fleet, fly, route, status

from uav_task_alloc.allocator.records import AnnouncementAction
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task, ThreatZone
from uav_task_alloc.work.pieces import Work, pieces_of
from uav_task_alloc.work.recut import FlownWays, main_direction, way_key
from uav_task_alloc.work.values import Kind


def cut_by_a_zone():
    """A fleet with a zone over the first piece of `a`; the piece, and the list of `a` before."""
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    hit, revision = route(driver, 'a')[0], driver.world.list_of('a').revision
    across = driver.world.tasks.records[hit].task.path[0][1]
    driver.world.set_zones([ThreatZone.cylinder('z', (200.0, across), 15.0)], (), driver.now)
    driver.settle()
    return driver, hit, revision


def test_work_that_was_cancelled_stays_so_when_a_piece_of_an_earlier_cut_is_flown():
    driver, hit, revision = cut_by_a_zone()
    assert driver.cancel('field')[0].accepted
    assert driver.event('COMPLETED', hit, 'a', revision) == ''
    driver.settle()
    assert (status(driver).state.name, status(driver).pieces_done) == ('CANCELLED', 1)
    assert route(driver, 'a') == route(driver, 'b') == ()


def test_work_that_is_completed_stays_so_when_a_piece_of_an_earlier_cut_is_flown():
    driver = fleet()
    driver.add(FIELD)
    driver.settle()
    hit, revision = route(driver, 'a')[-1], driver.world.list_of('a').revision
    driver.world.set_zones([ThreatZone.cylinder('z', (200.0, 60.0), 25.0)], (), driver.now)
    driver.settle()
    assert driver.state(hit) == 'CANCELLED'
    while routes := [each for each in 'ab' if route(driver, each)]:
        fly(driver, routes[0])
    assert status(driver).state.name == 'COMPLETED'
    driver.world.set_zones([], (), driver.now)
    driver.settle()
    assert driver.event('COMPLETED', hit, 'a', revision) == ''
    driver.settle()
    assert status(driver).state.name == 'COMPLETED'
    assert route(driver, 'a') == route(driver, 'b') == ()


def test_a_piece_flown_while_it_was_cut_again_counts_where_no_new_cut_is_possible(monkeypatch):
    driver, hit, revision = cut_by_a_zone()

    def too_many(*_):
        raise InvalidValue('strip_width', 20.0, 'wider strips')
    monkeypatch.setattr(driver.world.works, '_cut', too_many)
    assert driver.event('COMPLETED', hit, 'a', revision) == ''
    assert status(driver).pieces_done == 1


def test_strips_keep_their_direction_after_a_part_across_them_is_flown():
    driver = fleet()
    driver.add(replace(FIELD, direction=None))
    driver.settle()
    hit, revision = route(driver, 'a')[0], driver.world.list_of('a').revision
    across = driver.world.tasks.records[hit].task.path[0][1]
    tower, other = (ThreatZone.cylinder('z', (200.0, y), 15.0) for y in (across, 110.0))
    driver.world.set_zones([tower], (), driver.now)
    driver.settle()
    assert driver.event('COMPLETED', hit, 'a', revision) == ''
    driver.settle()
    # from the flown strip along the tower: it begins across the strips
    beside = next(each for each in route(driver, 'a')
                  if len(driver.world.tasks.records[each].task.path) == 3)
    while beside in route(driver, 'a'):
        fly(driver, 'a')
    for zones in ((), (other,)):
        driver.world.set_zones(zones, (), driver.now)
        driver.settle()
        assert driver.state(beside) == 'COMPLETED'
        for each in (*route(driver, 'a'), *route(driver, 'b')):
            a, b = driver.world.tasks.records[each].task.path[:2]
            assert a[1] == pytest.approx(b[1])


def orbit(turns):
    return Work(Task('mast', (0.0, 200.0, 50.0)), Kind.ORBIT, radius=50.0, turns=turns)


def open_length(driver, task_id):
    return sum(driver.world.tasks.records[each].task.path_length
               for each in driver.world.works.open_pieces(task_id))


def test_each_turn_of_an_orbit_is_flown_when_it_is_cut_again():
    driver, beside = fleet(), ThreatZone.cylinder('z', (50.0, 200.0), 15.0)
    driver.add(orbit(3.0))
    driver.world.set_zones([beside], (), driver.now)
    driver.settle()
    cut = driver.world.works.records['mast'].pieces
    assert len(set(cut)) == 3
    a_turn = driver.world.tasks.records[cut[0]].task.path_length
    uav_id = next(each for each in 'ab' if cut[0] in route(driver, each))
    fly(driver, uav_id)
    driver.world.set_zones([replace(beside, margin=1.0)], (), driver.now)
    driver.settle()
    assert 1.9 * a_turn < open_length(driver, 'mast') < 2.1 * a_turn
    driver.world.set_zones([], (), driver.now)
    driver.settle()
    around = 2 * math.pi * 50.0
    assert open_length(driver, 'mast') == pytest.approx(3 * around - a_turn, rel=0.01)


def test_a_part_that_is_left_is_not_taken_for_an_equal_one_that_is_flown():
    driver = fleet()
    driver.add(orbit(2.5))
    works, tasks = driver.world.works, driver.world.tasks.records

    def fly_all(pieces):
        for each in pieces:
            uav_id = next(name for name in 'ab' if each in route(driver, name))
            assert driver.event('COMPLETED', each, uav_id) == ''
            driver.settle()

    def cut(*zones):
        driver.world.set_zones(zones, (), driver.now)
        driver.settle()
        return works.open_pieces('mast')

    fly_all(cut(ThreatZone.cylinder('z', (-43.0, 175.0), 15.0))[:-1])
    ways = {each: way_key(tasks[each].task.path, False) for each in cut()}
    alike = [each for each, way in ways.items() if list(ways.values()).count(way) > 1]
    fly_all(alike[:1])
    left = open_length(driver, 'mast')
    cut(ThreatZone.cylinder('z', (900.0, 0.0), 15.0))
    assert len(alike) > 1
    assert open_length(driver, 'mast') == pytest.approx(left)


def test_a_line_that_leads_there_and_back_keeps_all_of_its_pieces():
    driver = fleet()
    points = [(x, 0.0, 50.0) for x in (100.0, 200.0, 300.0, 200.0, 100.0)]
    driver.add(Work(Task('cable', points[0]), Kind.LINE, points, divisible=True))
    driver.settle()
    driver.world.set_zones([ThreatZone.cylinder('z', (900.0, 0.0), 15.0)], (), driver.now)
    driver.settle()
    assert set(driver.world.works.records['cable'].pieces) == {f'cable#{k}' for k in range(1, 5)}
    assert open_length(driver, 'cable') == pytest.approx(400.0)


def test_an_update_turns_an_orbit_the_other_way_round():
    driver = fleet()
    driver.add(orbit(1.0))
    assert driver.add(orbit(-1.0), action=AnnouncementAction.UPDATE)[0].accepted
    driver.settle()
    task_id, = driver.world.works.open_pieces('mast')
    assert driver.world.tasks.records[task_id].task.path == pieces_of(orbit(-1.0))[0].path


def test_a_flown_way_counts_once():
    way = ((0.0, 0.0, 50.0), (100.0, 0.0, 50.0))
    flown = FlownWays([((70.0, 0.0, 50.0), (20.0, 0.0, 50.0)), ((50.0, 0.0, 50.0), way[1])])
    assert flown.unflown_parts(way) == [(way[0], (20.0, 0.0, 50.0))]
    assert flown.unflown_parts(way) == [(way[0], (50.0, 0.0, 50.0)), ((70.0, 0.0, 50.0), way[1])]
    assert flown.unflown_parts(way) == [way]


def test_the_direction_of_ways_is_that_of_most_of_their_length():
    way = ((0.0, 0.0, 50.0), (0.0, 30.0, 50.0), (-20.0, 30.0, 50.0), (-60.0, 30.0, 50.0))
    assert main_direction([way[:3]]) == pytest.approx(1.5707963)
    assert main_direction([way]) == pytest.approx(0.0)
    assert main_direction([way[::-1], ((0.0, 0.0, 50.0), (0.0, 40.0, 50.0))]) == pytest.approx(
        1.5707963)
