# SPDX-License-Identifier: Apache-2.0
"""The live page in a real browser: answers, panels and the pixels of the map."""
import io

import matplotlib.image
import numpy as np
import pytest
from chromium import WAIT, wait
from small_run import (
    BEGIN,
    FIRST,
    LATER,
    Run,
    announced,
    held,
    listed,
    planned,
    state,
    statuses,
    uavs,
    zones,
)

HOSTILE = '<img src=x onerror="window.hacked=1">'


def text(page, where):
    return page.inner_text(where).replace('\xa0', ' ')


def find(page, task, expected):
    page.fill('#find', task)
    wait(page, '#answer', expected)
    return text(page, '#answer')


def pixels(page, where):
    """(height, width, 3) in 0..1 of the visible part of a node."""
    return matplotlib.image.imread(io.BytesIO(page.locator(where).screenshot()))[..., :3]


def near(image, colour, tolerance=0.06):
    """Where an image has a colour #rrggbb."""
    wanted = np.array([int(colour[k:k + 2], 16) / 255 for k in (1, 3, 5)])
    return np.abs(image - wanted).max(axis=2) < tolerance


def share(image, colour):
    """The share of an image that has a colour #rrggbb."""
    return float(np.mean(near(image, colour)))


def test_which_uav_serves_a_task_next(view, run):
    page = view(run.snapshots)
    assert find(page, 't3', 'u2 flies t3 next; it gets there in about 0:10 min.')
    assert find(page, 't2', 'u2 flies t2 as number 3 of its list, after t3, t4;')
    assert find(page, 't1', 't1 is done: u1 completed it.')
    assert find(page, 'T4', 'u2 flies t4')
    assert find(page, 't', 'Which one: t1, t2, t3, t4, t5?')
    assert find(page, 'toString', 'There is no task toString.')
    page.click('#uavs details:nth-child(2) summary')
    wait(page, '#uavs details:nth-child(2) ol', 't2')
    assert ' '.join(text(page, '#uavs details:nth-child(2) ol').split()) == (
        't3 in 0:10 t4 in 0:20 t2 in 0:30')
    page.click('#uavs button.task >> nth=0')
    wait(page, '#answer', 'u2 flies t3 next')


def test_authority_is_shown_with_its_time_its_reason_and_what_gives_it_back(view):
    why = f'AUTO -> LOITER {HOSTILE}'
    run = Run().add(
        state(BEGIN, 'u1', (0.0, 0.0), authority='LOST', available=False,
              reason=f'authority LOST: {why}; given back by ~/hand_over'),
        state(BEGIN, 'u2', (0.0, 0.0), authority='HELD', available=False, reason='no position'),
        held(BEGIN, 'u1', 'LOST', why, 65.0, '~/hand_over'),
        held(BEGIN, 'u2', 'HELD', 'takeoff is true', 5.0))
    page = view(run.snapshots)
    wait(page, '#uavs', 'Authority LOST since')
    shown = text(page, '#uavs details:nth-child(1) .authority')
    assert shown.endswith(f'(1:05): {why}. Given back by ~/hand_over.')
    assert text(page, '#uavs details:nth-child(2) .authority').endswith(
        '(0:05): takeoff is true. Not available: no position.')
    assert page.locator('img').count() == 0
    assert page.evaluate('window.hacked') is None


def test_why_a_task_is_unassigned(view, run):
    page = view(run.snapshots)
    assert text(page, '#left') == 't5: inside zone z1'
    assert find(page, 't5', 'No UAV flies t5: it is left out. Why: inside zone z1.')


def test_what_the_last_replan_changed(view, run):
    page = view(run.snapshots)
    shown = text(page, '#replan')
    assert 'Plan 2, 0:20, solved in 22 ms. Because: new task t4.' in shown
    assert 'u1: − t2 (now u2)' in shown
    assert 'u2: + t4 (new in the plan), + t2 (from u1)' in shown
    run.add(*uavs(BEGIN + 25), planned(BEGIN + 25, 3, 'background', u1=[],
                                        u2=['t2', 't4', 't3']))
    wait(page, '#replan', 'u2: ↻ order changed')
    run.add(*uavs(BEGIN + 30), planned(BEGIN + 30, 4, 'u1 silent', u1=[],
                                        u2=['t2', 't4', 't3']))
    wait(page, '#replan', 'Since then 1 plan changed nothing, the last at 0:30.')
    assert 'Plan 3, 0:25' in text(page, '#replan')
    assert '2 re-plans' in text(page, '#counts')
    assert 'plan 4' not in text(page, '#events')
    page.click('#replan-box summary')
    assert 'plan 4' not in text(page, '#replans')


def test_the_state_of_a_task_that_the_last_replan_removed_is_the_present_one(view, run):
    page = view(run.add(planned(BEGIN + 25, 3, 'background', u1=[], u2=['t3', 't4'])).snapshots)
    wait(page, '#replan', '− t2 (assigned)')
    run.add(statuses(BEGIN + 26, t2='UNASSIGNED  too far'))
    wait(page, '#replan', '− t2 (unassigned)')


def test_the_map_shows_zones_routes_and_tasks(view, run):
    page = view(run.snapshots)
    wait(page, '#map', 'z1')
    image = pixels(page, '#map')
    # the fill of a zone is a quarter of its colour on white
    for what, colour, least in (('zone', '#f5d7bf', 0.004), ('outline', '#d55e00', 0.0003),
                                ('route of u2', '#d08700', 0.0005), ('u1', '#0072b2', 0.0001),
                                ('left out', '#b34700', 0.0001), ('paper', '#ffffff', 0.5),
                                ('given by the last re-plan', '#7a3ea1', 0.0001)):
        assert share(image, colour) > least, what
    chart = pixels(page, '#chart')
    assert share(chart, '#0072b2') > 0.001
    assert share(chart, '#d08700') > 0.001
    fills = 'lines => lines.map(each => getComputedStyle(each).fill)'
    assert page.eval_on_selector_all('#chart polyline', fills) == ['none', 'none']


def test_it_fits_on_a_phone_and_on_a_projector(view, run):
    page = view(run.snapshots, scheme='dark')
    for width, height in ((390, 844), (1024, 768), (1920, 1080)):
        page.set_viewport_size({'width': width, 'height': height})
        page.wait_for_function(  # nothing is wider than the screen, once plotly has followed
            'width => document.documentElement.scrollWidth === width', arg=width, timeout=WAIT)
        for where in ('#find', '#map', '#live'):
            box = page.locator(where).bounding_box()
            assert box['x'] >= 0
            assert box['x'] + box['width'] <= width
    assert share(pixels(page, '#map'), '#191f25') > 0.5


def test_a_moment_of_the_past_is_shown_and_then_the_present_again(view, run):
    page = view(run.snapshots)
    page.locator('#scrub').fill(str(BEGIN + 10))
    wait(page, '#moment', '0:10, 0:10 ago')
    wait(page, '#counts', '0 of 3 tasks done')
    assert find(page, 't2', 'u1 flies t2 as number 2 of its list, after t1')
    assert 'Plan 1' in text(page, '#replan')
    assert 'z1' not in text(page, '#map')
    run.add(statuses(BEGIN + 21, t1='COMPLETED u1', t2='COMPLETED u2'), *uavs(BEGIN + 21))
    wait(page, '#moment', '0:10, 0:11 ago')
    assert 'u1 flies t2' in text(page, '#answer')
    page.click('#live')
    wait(page, '#moment', 'now')
    wait(page, '#counts', '2 of 5 tasks done')


def test_a_silent_uav_is_marked(view, run):
    page = view(run.snapshots)
    assert 'link good' in text(page, '#uavs')
    assert page.is_hidden('#alarm')
    run.add(uavs(BEGIN + 30)[0])
    wait(page, '#counts', '2 UAVs, 1 silent')
    assert 'silent for 0:10' in text(page, '#uavs [data-uav=u2]')
    assert text(page, '#alarm') == '▲ u2: silent'
    page.click('#alarm')
    page.wait_for_selector('#uavs [data-uav=u2][open]')
    run.add(*uavs(BEGIN + 31))
    page.wait_for_selector('#alarm', state='hidden')


def test_a_page_says_that_it_is_stale_and_reconnects_automatically(view, run, serve):
    page, server = view(run.snapshots), serve(run.snapshots)
    page.goto(server.address)
    wait(page, '#counts', '1 of 5 tasks done')
    assert page.is_hidden('#banner')
    assert text(page, '#state') == '● live'
    cut(server)
    wait(page, 'body', 'No data from live_view for 0:0')
    assert page.get_attribute('#banner', 'role') == 'alert'
    assert 'u2' in text(page, '#uavs')  # the last that was known
    server.stop()
    serve(Run().add(*FIRST).snapshots, server.port)
    page.wait_for_selector('#banner', state='hidden', timeout=WAIT)
    wait(page, '#counts', '0 of 3 tasks done')


def test_a_page_of_a_node_that_hangs_says_so_though_its_server_lives(view, run):
    page = view(run.snapshots)
    run.clock['beat'] = 1
    run.add(*uavs(BEGIN + 21))  # the stream goes on with this
    wait(page, '#banner', 'No data from live_view for 0:0')
    assert text(page, '#state') == '✕ no data'
    run.clock['beat'] = 2
    run.add(*uavs(BEGIN + 22))
    page.wait_for_selector('#banner', state='hidden')


def cut(server):
    """End all streams of a server as a broken connection does, without the last event."""
    def broken(_):
        raise ConnectionResetError
    server.snapshots.updates_since = broken


def test_a_page_says_that_the_simulated_clock_stands_still(view, run):
    page = view(run.snapshots)
    run.clock['still'] = True
    run.add(*uavs(BEGIN + 20))
    wait(page, '#banner', 'The simulated clock stands still at 0:20')
    assert text(page, '#state') == '✕ clock stands still'
    run.clock['still'] = False
    run.add(*uavs(BEGIN + 21))
    page.wait_for_selector('#banner', state='hidden')


@pytest.mark.parametrize(('ended', 'badge', 'words'), [
    (True, '■ run ended', 'Run ended at 0:20'), (False, '■ stopped', 'UAVs may still be flying')])
def test_the_end_of_the_node_is_no_alarm(tab, run, serve, ended, badge, words):
    page, server = tab(), serve(run.snapshots)
    page.clock.install()
    run.clock['ended'] = ended
    run.add(*uavs(BEGIN + 20))
    page.goto(server.address)
    wait(page, '#counts', '1 of 5 tasks done')
    server.stop()
    wait(page, '#banner', words)
    page.clock.fast_forward(10_000)  # after 3 s a broken connection is an alarm
    assert text(page, '#state') == badge
    assert page.get_attribute('#banner', 'role') == 'status'
    assert 'No data' not in text(page, 'body')
    assert share(pixels(page, '#banner'), '#b34700') < 0.001


def test_after_the_run_only_a_uav_that_did_not_land_is_an_alarm(view):
    run = Run().add(state(BEGIN, 'u1', (0.0, 0.0), mode='STANDBY'),
                    state(BEGIN, 'u2', (90.0, 0.0)), announced(BEGIN, ['t1']))
    run.clock['ended'] = True
    run.add(statuses(BEGIN + 60, t1='COMPLETED u1'))
    page = view(run.snapshots)
    wait(page, '#state', 'run ended')
    assert '2 UAVs, 1 silent' in text(page, '#counts')
    assert page.locator('#uavs .trouble').all_inner_texts()[0].startswith('u2')
    assert page.locator('#uavs .trouble').count() == 1
    assert 'silent for 1:00' in text(page, '#uavs details:nth-child(1)')
    assert 'u2 is silent' in text(page, '#events')
    assert 'u1 is silent' not in text(page, '#events')
    assert page.is_hidden('#banner')


def test_a_reload_keeps_the_theme_and_the_present(view, run):
    page = view(run.snapshots)
    page.click('#theme')
    page.locator('#scrub').fill(str(BEGIN + 10))
    wait(page, '#moment', 'ago')
    page.reload()
    wait(page, '#counts', '1 of 5 tasks done')
    assert page.get_attribute('html', 'data-theme') == 'dark'
    assert text(page, '#moment') == 'now'
    page.click('#theme')


def test_a_hostile_name_is_only_text(view):
    run = Run().add(
        *uavs(BEGIN), announced(BEGIN, [HOSTILE, '__proto__', 'constructor']),
        listed(BEGIN, 'u1', 1, [HOSTILE, 'constructor']),
        planned(BEGIN, 1, f'ADD {HOSTILE}', u1=[HOSTILE, 'constructor']),
        statuses(BEGIN, **{HOSTILE: 'ASSIGNED u1', '__proto__': f'UNASSIGNED  {HOSTILE}'}))
    page = view(run.snapshots)
    wait(page, '#map', HOSTILE)
    assert find(page, HOSTILE, f'u1 flies {HOSTILE} next')
    assert find(page, '__proto__', f'Why: {HOSTILE}.')
    assert find(page, 'constructor', 'u1 flies constructor as number 2')
    assert HOSTILE in text(page, '#events')
    assert page.locator('img').count() == 0
    assert page.evaluate('window.hacked') is None


def test_orders_and_proposals_are_shown_and_not_given(view):
    run = Run().add(
        state(BEGIN, 'u1', (0.0, 0.0)),
        {'wall': BEGIN, 'kind': 'uploads', 'uploads': {}, 'orders': {
            '/allocator': {'o1': f'pin t1 to u1 ({HOSTILE})'}}},
        {'kind': 'proposal', 'wall': BEGIN, 'revision': 7, 'open': True, 'accepted': False,
         'trigger': 'ADD t9', 'deadline': BEGIN + 31.0, 'changes': [f'u1 gains {HOSTILE}']})
    page = view(run.snapshots)
    wait(page, '#orders', 'o1 pin t1 to u1')
    wait(page, '#proposal', 'Plan 7 waits for approval (ADD t9)')
    wait(page, '#proposal', 'it is rejected then')
    assert HOSTILE in text(page, '#proposal')
    assert page.evaluate('window.hacked') is None
    assert page.locator('#order-box button').count() == 0
    wait(page, '#asks', 'Plan 7 waits for approval until 0:31')
    page.click('#asks')
    page.wait_for_function("""() => document.querySelector('#proposal')
        .getBoundingClientRect().top < innerHeight""")


def test_the_page_sends_nothing_but_get(view, run):
    requests = []
    page = view(run.snapshots)
    page.on('request', lambda request: requests.append((request.method, request.url)))
    page.reload()
    page.wait_for_selector('#map[data-drawn]', timeout=WAIT)
    for button in page.locator('button:visible').all():
        button.click()
    page.locator('#scrub').fill(str(BEGIN + 10))
    wait(page, '#moment', 'ago')
    assert {method for method, _ in requests} == {'GET'}
    assert all(url.startswith((view.server.address, 'data:')) for _, url in requests)


def test_the_end_of_the_fleet_and_of_each_uav_and_the_services_are_shown(view, run):
    page = view(run.snapshots)
    wait(page, '#finish', 'The fleet is done at 0:55, in 0:35: u2 at 0:55.')
    bars = page.locator('#gantt rect')
    assert sorted(bars.evaluate_all('all => all.map(bar => [bar.dataset.task, '
                                    'bar.getAttribute("class")].join(" "))')) == [
        't1 flown', 't1 planned', 't2 planned', 't3 planned', 't4 planned']
    titles = bars.locator('title').all_text_contents()
    assert 't1 planned: 0:12 to 0:15' in titles
    assert 't3 planned: 0:32 to 0:35' in titles
    done = Run().add(*FIRST).add(*LATER).add(listed(BEGIN + 60, 'u2', 3, []), statuses(
        BEGIN + 60, t1='COMPLETED u1', t2='COMPLETED u2', t3='COMPLETED u2'))
    page = view(done.snapshots)
    wait(page, '#finish', 'Nothing is left to fly; the last task was done at 1:00.')


def test_the_head_counts_pieces_and_one_of_each_as_one(view):
    names = ['line#1', 'line#2']
    ends = [[0.0, 0.0, 40.0], [200.0, 0.0, 40.0]]
    line = {'id': 'line', 'position': ends[0], 'work': 'LINE', 'path': ends, 'holes': []}
    rows = [{'task': name, 'state': 'ASSIGNED', 'uav': 'u1', 'reason': '', 'done': 0, 'pieces': 2}
            for name in ('line', *names)]
    listed_ways = listed(BEGIN, 'u1', 1, names)
    listed_ways['tasks'] = [{**row, 'way': ends} for row in listed_ways['tasks']]
    page = view(Run().add(
        {'kind': 'announcement', 'wall': BEGIN, 'action': 'ADD', 'tasks': [line]},
        zones(BEGIN, ('z', 90.0, 90.0, 20.0)), listed_ways,
        {'kind': 'statuses', 'wall': BEGIN, 'statuses': rows},
        state(BEGIN, 'u1', (0.0, 0.0))).snapshots)
    assert text(page, '#counts') == (
        '0 of 1 task done, 2 pieces to fly; 1 UAV; 1 zone; 0 re-plans')


def test_pieces_that_no_uav_has_are_not_flown_by_another(view):
    line = {'id': 'line', 'position': [0.0, 0.0, 40.0], 'work': 'LINE', 'holes': [],
            'path': [[0.0, 0.0, 40.0], [200.0, 0.0, 40.0]]}
    whole = {'task': 'line', 'state': 'ASSIGNED', 'uav': 'u1', 'reason': '', 'done': 1,
             'pieces': 6}
    run = Run().add({'kind': 'announcement', 'wall': BEGIN, 'action': 'ADD', 'tasks': [line]},
                    listed(BEGIN, 'u1', 1, ['line#2', 'line#3']),
                    {'kind': 'statuses', 'wall': BEGIN, 'statuses': [whole]})
    page = view(run.snapshots)
    page.fill('#find', 'line')
    wait(page, '#answer',
         '1 of 6 pieces of line are flown; u1 flies 2 more; no UAV has the other 3.')
    run.add(listed(BEGIN + 1, 'u1', 2, [f'line#{k}' for k in range(2, 7)]))
    wait(page, '#answer', '1 of 6 pieces of line are flown; u1 flies the rest.')


def test_the_hint_of_the_search_fits(view):
    page = view(Run().add(*FIRST).snapshots)
    page.set_viewport_size({'width': 1440, 'height': 900})
    assert page.evaluate("""() => {
        const node = document.querySelector('#find'), style = getComputedStyle(node);
        const context = document.createElement('canvas').getContext('2d');
        context.font = `${style.fontSize} ${style.fontFamily}`;
        return context.measureText(node.placeholder).width + parseFloat(style.paddingLeft)
            + parseFloat(style.paddingRight) - node.clientWidth; }""") <= -48.0  # its buttons
