# SPDX-License-Identifier: Apache-2.0
"""Refused messages in the log: one line for each name and reason, few for any flood."""
from uav_task_alloc.nodes.ros.refusal_log import RefusalLog


class Log:
    """A log of refusals over virtual time."""

    def __init__(self):
        self.lines, self.now = [], 1000.0
        self.refusals = RefusalLog(self.lines.append, lambda: self.now)

    def zones(self, count, reason='radius = nan'):
        for k in range(count):
            self.refusals.report('threat_zones', f'z{k}', f'zone z{k}: {reason}')
        lines, self.lines[:] = [*self.lines], []
        return lines


def test_a_reason_is_logged_once_until_a_valid_message_comes():
    log = Log()
    assert log.zones(1) == ['threat_zones: zone z0: radius = nan: ignored; logged once']
    assert log.zones(1) == []
    assert len(log.zones(1, 'margin = -1')) == 1
    log.refusals.report('threat_zones', 'z0', '')
    assert len(log.zones(1)) == 1


def test_more_names_than_are_remembered_are_not_logged_again_with_each_message():
    log = Log()
    first = log.zones(1005)
    assert len(first) == 1001
    assert first[-1] == ('threat_zones: zone z1000: radius = nan: ignored; messages of more '
                         'than 1000 names are: the other names are not logged')
    for _ in range(59):
        log.now += 1.0
        assert log.zones(1005) == []
    log.now += 1.0
    assert len(log.zones(1005)) == 1


def test_a_name_that_is_refused_no_more_makes_room():
    log = Log()
    log.zones(1000)
    log.now += 60.0
    log.refusals.report('uav_states', '9', 'uav_id')
    assert log.lines == ['uav_states: uav_id: ignored; logged once']
