# SPDX-License-Identifier: Apache-2.0
"""What bridges report of the authority over a UAV, report after report."""
import pytest

from uav_task_alloc.record.bridge_reports import BridgeReports
from uav_task_alloc.record.reported import ReportedAuthority


def since(*reports, second=1.0):
    """Since when authority is as the last report says; each is (wall, state, seconds)."""
    bridges = BridgeReports()
    for wall, state, seconds in reports:
        bridges.apply({'wall': wall, 'kind': 'uploads', 'uploads': {}, 'authority': {
            'u1': {'state': state, 'why': 'why', 'for': seconds, 'back': ''}}}, second)
    return bridges.authority['u1'].since


def test_authority_has_its_state_reason_time_and_what_gives_it_back():
    bridges = BridgeReports()
    assert bridges.authority == {}
    bridges.apply({'wall': 100.0, 'kind': 'uploads', 'uploads': {}, 'authority': {
        'u1': {'state': 'LOST', 'why': 'a mode', 'for': 12.0, 'back': '~/hand_over'}}}, 1.0)
    assert bridges.authority == {'u1': ReportedAuthority('LOST', 'a mode', 88.0, '~/hand_over')}


@pytest.mark.parametrize(('then', 'expected'), [
    ((110.0, 'LOST', 23.5), 88.0),  # whole seconds, and late
    ((110.0, 'LOST', 2.0), 108.0), ((110.0, 'HELD', 22.5), 87.5), ((110.0, 'LOST', None), None)])
def test_the_time_stays_while_the_state_does(then, expected):
    assert since((100.0, 'LOST', 12.0), then) == expected


def test_durations_are_in_seconds_of_real_time():
    assert since((100.0, 'LOST', 12.0), second=5.0) == 40.0
    assert since((100.0, 'LOST', 12.0), (110.0, 'LOST', 12.0), second=5.0) == 40.0
