# SPDX-License-Identifier: Apache-2.0
"""What task lists say of legs, places and ways, over lists that follow one another."""
from uav_task_alloc.record.reported_lists import ReportedLists


def row(name, leg=100.0, **more):
    return {'id': name, 'leg_distance': leg, 'via': [], **more}


def line(*rows, uav='u1', distance=0.0):
    return {'kind': 'list', 'wall': 0.0, 'uav': uav, 'distance': distance, 'tasks': list(rows)}


def after(*lines, mode='ON_MISSION'):
    lists = ReportedLists()
    for each in lines:
        lists.apply(each, mode)
    return lists


def test_the_leg_to_a_task_is_that_of_the_list_in_which_it_became_the_first():
    lists = after(line(row('a'), row('b', 50.0)), line(row('a', 40.0), row('b', 50.0)),
                  line(row('b', 70.0)), line(row('c', 30.0), uav='u2'))
    assert lists.legs == {('u1', 'a'): 100.0, ('u1', 'b'): 70.0, ('u2', 'c'): 30.0}


def test_a_leg_leads_along_the_way_of_its_piece():
    way = [[0.0, 0.0, 50.0], [30.0, 40.0, 50.0]]
    lists = after(line(row('f#1', way=way)))
    assert (lists.legs, lists.ways) == ({('u1', 'f#1'): 150.0}, {'f#1': way})


def test_a_list_begins_a_leg_where_its_first_task_is_another():
    lists = after(line(row('a'), row('b')))
    assert lists.begins_leg(line(row('b')))
    assert lists.begins_leg(line(row('a'), uav='u2'))
    assert not lists.begins_leg(line(row('a')))
    assert not lists.begins_leg(line())


def test_places_and_ways_stay_known_when_their_tasks_are_in_no_list_any_more():
    lists = after(line(row('a', position=[1.0, 2.0, 3.0]), row('f#1', way=[[0.0, 0.0, 1.0]]),
                       row('b', position=[1.0, None, 3.0])), line())
    assert lists.places == {'a': (1.0, 2.0, 3.0)}
    assert lists.ways == {'f#1': [[0.0, 0.0, 1.0]]}
    assert lists.newest == {'u1': line()}


def test_a_wait_is_at_its_task_and_at_the_stop_before():
    assert after(line(row('a', wait=0.0), row('b', wait=12.0), row('c'))).waited == {'a', 'b'}
    assert after(line(row('a', wait=12.0))).waited == {'a'}


def test_the_way_home_is_that_of_the_list_without_tasks():
    lists = after(line(row('a'), distance=180.0), line(distance=80.0))
    assert lists.ways_home.total() == 80.0
    lists = after(line(row('a'), distance=180.0), line(), mode='STANDBY')
    assert lists.ways_home.total() == 0.0
