# SPDX-License-Identifier: Apache-2.0
"""The map of the live page fits what is near, and names what is far away."""
import math

import pytest
from chromium import wait
from small_run import BEGIN, FIRST, Run, announced, listed, state, statuses, zones

NEAR = 400.0  # [m] that the tasks and UAVs of `FIRST` take
FAR = '▲ Far away, outside of the map:'


def width(page):
    """[m] that the map shows from west to east."""
    x, y, scale = map(float, page.get_attribute('#map', 'data-view').split())
    assert not math.isnan(x + y)
    return page.locator('#map').bounding_box()['width'] / scale


def task(name, position):
    return {**announced(BEGIN, []), 'tasks': [{'id': name, 'position': [*position, 40.0]}]}


def test_a_uav_that_is_far_away_is_named_and_does_not_shrink_the_map(view):
    page = view(Run().add(*FIRST, state(BEGIN, 'u3', (-200_000.0, 0.0))).snapshots)
    wait(page, '#map-box .far', f'{FAR} u3, 200 km west.')
    assert width(page) < 10 * NEAR
    page.click('#uavs [data-uav=u3] summary')
    page.click('#uavs [data-uav=u3] button:has-text("on the map")')
    page.wait_for_selector('#map-box .far', state='hidden')
    page.click('#map .fit')
    wait(page, '#map-box .far', 'u3')


def test_of_two_uavs_without_tasks_the_one_near_the_origin_is_shown(view):
    page = view(Run().add(state(BEGIN, 'u1', (150_000.0, 150_000.0)),
                          state(BEGIN, 'u2', (100.0, 100.0))).snapshots)
    wait(page, '#map-box .far', f'{FAR} u1, 210 km north-east.')
    assert page.locator('.label:has-text("u2")').count() == 1


def test_tasks_and_zones_that_are_far_away_are_named_until_they_are_cancelled(view):
    run = Run().add(*FIRST, task('t9', (0.0, -90_000.0)),
                    zones(BEGIN, ('near', 300.0, 300.0, 60.0), ('all', 0.0, 0.0, 300e3),
                          ('away', 50_000.0, 0.0, 100.0)))
    page = view(run.snapshots)
    wait(page, '#map-box .far', f'{FAR} task t9, 90 km south; zone away, 50 km east.')
    assert width(page) < 10 * NEAR
    run.add(statuses(BEGIN + 1, t9='CANCELLED'), zones(BEGIN + 1))
    page.wait_for_selector('#map-box .far', state='hidden')


@pytest.mark.parametrize('tasks', [['t1', 't2'], []])
def test_a_uav_on_its_way_to_tasks_far_from_it_is_not_far_away(view, tasks):
    run = Run().add(announced(BEGIN, ['t1', 't2']), state(BEGIN, 'u1', (-30_000.0, 400.0)),
                    state(BEGIN, 'u2', (0.0, 0.0)), state(BEGIN, 'u3', (10.0, 0.0)),
                    listed(BEGIN, 'u1', 1, tasks), statuses(BEGIN, t1='PENDING', t2='PENDING'))
    page = view(run.snapshots)
    assert page.locator('#map-box .far').is_visible() == (not tasks)
    assert (width(page) > 30_000.0) == bool(tasks)


@pytest.mark.parametrize(('fleet', 'tasks'), [(1, 1), (3, 1), (1, 5), (3, 5)])
@pytest.mark.parametrize('away', [15_000.0, 150_000.0])
def test_a_base_away_from_all_tasks_is_shown_with_them(view, fleet, tasks, away):
    names = [f't{k + 1}' for k in range(tasks)]
    page = view(Run().add(announced(BEGIN, names), statuses(BEGIN, **dict.fromkeys(
        names, 'PENDING')), *(state(BEGIN, f'u{k}', (-away, 10.0 * k)) for k in range(fleet)))
        .snapshots)
    assert page.locator('#map-box .far').is_visible() == (away > 100_000.0)
    assert (width(page) > away) == (away < 100_000.0)


def test_a_fleet_that_is_spread_evenly_over_far_places_is_shown_whole(view):
    fleet = [state(BEGIN, f'u{k}', (2000.0 * k, 500.0 * k * k)) for k in range(12)]
    page = view(Run().add(*fleet).snapshots)
    assert page.locator('#map-box .far').is_hidden()
    assert width(page) > 20_000.0
