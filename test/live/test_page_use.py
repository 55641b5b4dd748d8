# SPDX-License-Identifier: Apache-2.0
"""The live page by keyboard and screen reader, with long names, many UAVs, and later ones."""
import pytest
from chromium import open_page, wait
from small_run import BEGIN, FIRST, Run, announced, state, statuses

LONG = 'mast_of_the_northern_line_' * 7


@pytest.mark.parametrize('width', [390, 1600])
def test_a_long_name_of_a_uav_leaves_the_page_as_wide_as_the_window(view, width):
    lost = state(BEGIN, LONG, (300.0, 300.0), mode='FAULT')
    page = view(Run().add(*FIRST, lost).snapshots)
    page.set_viewport_size({'width': width, 'height': 844})
    wait(page, '#alarm', f'{LONG}: fault')
    assert page.evaluate('document.documentElement.scrollWidth') == width


@pytest.mark.parametrize(('count', 'scrolls'), [(50, True), (2, False)])
def test_a_phone_shows_the_map_on_its_first_screen_and_each_uav(view, count, scrolls):
    page = view(Run().add(*FIRST, *(
        state(BEGIN, f'u{k}', (20.0 * k, 0.0)) for k in range(1, count + 1))).snapshots)
    page.set_viewport_size({'width': 390, 'height': 844})
    wait(page, '#uav-count', str(count))
    assert page.locator('#map').bounding_box()['y'] < 744
    box = page.locator('#uav-box')
    assert box.evaluate('box => box.scrollHeight > box.clientHeight') == scrolls
    page.locator('#uavs details').last.scroll_into_view_if_needed()
    outer, inner = box.bounding_box(), page.locator('#uavs details').last.bounding_box()
    assert outer['y'] <= inner['y']
    assert inner['y'] + inner['height'] <= outer['y'] + outer['height']


def test_a_uav_with_a_problem_is_announced_to_screen_readers(view):
    page = view(Run().add(*FIRST, state(BEGIN, 'u9', (300.0, 300.0), mode='FAULT')).snapshots)
    wait(page, '[role=alert] #alarm', 'u9: fault')


def test_an_open_card_stays_open_with_its_focus_where_another_uav_comes(view):
    run = Run().add(*FIRST)
    page = view(run.snapshots)
    page.click('#uavs [data-uav=u2] summary')
    run.add(state(BEGIN + 1, 'u10', (300.0, 300.0)), state(BEGIN + 1, 'u0', (300.0, 300.0)))
    wait(page, '#uav-count', '4')
    assert page.locator('#uavs details[open]').evaluate_all(
        'nodes => nodes.map(node => node.dataset.uav)') == ['u2']
    assert page.evaluate('document.activeElement.parentNode.dataset.uav') == 'u2'


def test_the_focus_stays_on_a_task_where_a_list_with_it_changes(view):
    run = Run().add(*FIRST, announced(BEGIN, ['t4', 't5']),
                    statuses(BEGIN, t4='UNASSIGNED  too far', t5='UNASSIGNED  too far'))
    page = view(run.snapshots)
    page.focus('#left button:has-text("t5")')
    run.add(statuses(BEGIN + 1, t4='UNASSIGNED  too far', t5='UNASSIGNED  inside zone z1'))
    wait(page, '#left', 'inside zone z1')
    assert page.evaluate('document.activeElement.textContent') == 't5'


def test_the_time_of_day_has_its_zone_as_reasons_are_in_utc(tab, serve):
    page = tab(timezone_id='America/St_Johns')
    open_page(page, serve(Run().add(*FIRST).snapshots).address)
    wait(page, '#clock', '0:00 (04:30:00 GMT-3:30)')


def test_the_keyboard_reaches_a_uav_with_a_problem_first_and_keeps_the_focus(view):
    run = Run().add(*FIRST)
    page = view(run.snapshots)
    page.click('#uavs [data-uav=u1] summary')
    run.add(state(BEGIN + 1, 'u1', (300.0, 300.0)),
            state(BEGIN + 1, 'u2', (300.0, 300.0), mode='FAULT'))
    wait(page, '#uavs details:first-child', 'u2')
    assert page.evaluate('document.activeElement.parentNode.dataset.uav') == 'u1'
    assert page.locator('#uavs [data-uav=u1]').evaluate('node => node.open')
    page.keyboard.press('Shift+Tab')
    assert page.evaluate('document.activeElement.parentNode.dataset.uav') == 'u2'


def test_after_a_restart_of_live_view_the_names_of_its_tasks_are_offered(tab, serve):
    page, server = tab(), serve(Run().add(*FIRST).snapshots)
    open_page(page, server.address)
    server.stop()
    serve(Run().add(announced(BEGIN, ['a1', 'a2', 'a3'])).snapshots, server.port)
    wait(page, '#counts', '0 of 3 tasks done, 0 to fly')
    names = page.locator('#names option').evaluate_all('nodes => nodes.map(node => node.value)')
    assert names == ['a1', 'a2', 'a3']


def test_every_task_that_is_left_out_can_be_seen_under_its_reason(view):
    names = [f'x{k}' for k in range(30)]
    states = dict.fromkeys(names, 'UNASSIGNED  too far')
    run = Run().add(*FIRST, announced(BEGIN, names), statuses(BEGIN, **states))
    page = view(run.snapshots)
    wait(page, '#left summary', '18 more')
    page.focus('#left summary')
    page.keyboard.press('Enter')
    wait(page, '#left', 'x29')
    run.add(statuses(BEGIN + 1, **{**states, 'x1': 'COMPLETED u1'}))
    wait(page, '#left summary', '17 more')
    assert page.locator('#left button').count() == 29
    assert page.evaluate('document.activeElement.textContent') == '17 more'
    page.click('#left button:has-text("x29")')
    wait(page, '#answer', 'No UAV flies x29')
