# SPDX-License-Identifier: Apache-2.0
"""What the page says of nodes: one that has ended, warnings that are of no UAV."""
from chromium import wait
from small_run import BEGIN, FIRST, Run, state


def report(wall, health, warnings):
    return {'kind': 'uploads', 'wall': wall, 'uploads': {}, 'health': health,
            'uav_warnings': warnings}


def allocator(wall, level=0, text='running'):
    return report(wall, {'/allocator: allocation': [level, text, '']},
                  {'/allocator: allocation': {}})


def bridge(wall):
    return report(wall, {'/bridge: udp': [2, 'closed', 'udp']}, {})


def test_an_allocator_that_has_ended_is_named_with_what_that_means(view):
    run = Run().add(*FIRST, allocator(BEGIN))
    page = view(run.snapshots)
    assert not page.is_visible('#nodes')
    run.add(state(BEGIN + 11, 'u1', (100.0, 100.0)))
    wait(page, '#nodes', 'The allocator has not reported since 0:00')
    run.add(allocator(BEGIN + 12))
    page.wait_for_selector('#nodes', state='hidden')


def test_the_end_of_an_allocator_after_the_run_is_no_alarm():
    run = Run().add(*FIRST, allocator(BEGIN))
    run.clock['ended'] = True
    run.add(state(BEGIN + 11, 'u1', (100.0, 100.0)))
    assert 'nodes' not in run.snapshots.parts


def reports_on_u1(wall):
    return {'kind': 'uploads', 'wall': wall, 'uploads': {'/bridge: u1': 1}, 'health': {
        '/bridge: u1': [0, '', 'u1']}}


def test_a_bridge_that_has_ended_is_named_with_what_that_means(view):
    run = Run().add(*FIRST, allocator(BEGIN), reports_on_u1(BEGIN))
    page = view(run.snapshots)
    assert not page.is_visible('#nodes')
    run.add(allocator(BEGIN + 11))
    wait(page, '#nodes', '▲ /bridge has not reported since 0:00')
    run.add(reports_on_u1(BEGIN + 12))
    page.wait_for_selector('#nodes', state='hidden')


def test_the_end_of_a_bridge_after_the_run_is_no_alarm():
    run = Run().add(*FIRST, allocator(BEGIN), reports_on_u1(BEGIN))
    run.clock['ended'] = True
    run.add(allocator(BEGIN + 11))
    assert 'nodes' not in run.snapshots.parts


def test_warnings_that_are_of_no_uav_are_shown(view):
    run = Run().add(*FIRST, allocator(BEGIN, 1, 'zones refused: dome'), bridge(BEGIN))
    page = view(run.snapshots)
    wait(page, '#nodes', '▲ /allocator: allocation: zones refused: dome')
    wait(page, '#nodes', '▲ /bridge: udp: closed')
    run.add(allocator(BEGIN + 1), bridge(BEGIN + 1))
    page.wait_for_function('() => document.querySelectorAll("#nodes li").length == 1')
