# SPDX-License-Identifier: Apache-2.0
"""What the diagnostics and the log of a bridge say of its links, without a bridge."""
from types import SimpleNamespace

import pytest

from uav_task_alloc.nodes.conversions.diagnostics import DiagnosticLevel
from uav_task_alloc.nodes.ros.bridge_diagnostics import BridgeDiagnostics
from uav_task_alloc.nodes.ros.leveled_log import LeveledLog

pytestmark = pytest.mark.ros
GARBLED, SILENT = 'what is received is no MAVLink', 'no MAVLink message received'


class Bridge:
    """Links and their traffic, the rows of the diagnostics, and what was logged."""

    def __init__(self):
        self.links = [SimpleNamespace(name=name, trouble='') for name in 'ab']
        self.traffic = [SimpleNamespace(warning='', is_garbled=False) for _ in 'ab']
        self.refusals = SimpleNamespace(count=0, last='', notes=[])
        self.signing, self.record_error, self.errors = None, '', lambda: 0
        self.logged = []
        log = LeveledLog.__new__(LeveledLog)
        log._troubles = {}
        log.levels = {level: lambda text, level=level: self.logged.append((level, text))
                      for level in ('info', 'warning', 'error')}
        heartbeat = SimpleNamespace(trouble='', sent=1, restarts=0)
        self.report = BridgeDiagnostics('/bridge', SimpleNamespace(refusals=self.refusals), self,
                                        heartbeat, log)

    def rows(self):
        """(level, summary) by the name of each row."""
        return {row.name.rpartition(': ')[2]: (row.level, row.message)
                for row in self.report.part_rows('')}


@pytest.fixture
def bridge():
    return Bridge()


def test_a_garbled_link_is_a_warning_and_logged_once(bridge):
    bridge.traffic[1] = SimpleNamespace(warning=GARBLED, is_garbled=True)
    for _ in range(3):
        rows = bridge.rows()
    assert rows['a'] == (DiagnosticLevel.OK, 'open')
    assert rows['b'] == (DiagnosticLevel.WARN, GARBLED)
    assert bridge.logged == [('warning', f'b: {GARBLED}')]
    bridge.traffic[1] = SimpleNamespace(warning='', is_garbled=False)
    assert bridge.rows()['b'] == (DiagnosticLevel.OK, 'open')
    assert bridge.logged[1:] == [('info', 'b: works')]


def test_a_silent_link_is_a_warning_and_no_line_of_the_log(bridge):
    bridge.traffic[0] = SimpleNamespace(warning=SILENT, is_garbled=False)
    assert bridge.rows()['a'] == (DiagnosticLevel.WARN, SILENT)
    assert bridge.logged == []


def test_why_a_link_is_closed_comes_first(bridge):
    bridge.links[0].trouble = 'Connection refused'
    bridge.traffic[0] = SimpleNamespace(warning=GARBLED, is_garbled=True)
    assert bridge.rows()['a'] == (DiagnosticLevel.ERROR, 'Connection refused')
    assert bridge.logged == [('error', 'a: Connection refused')]


def test_a_recording_that_has_ended_is_a_warning(bridge):
    assert 'tlog' not in bridge.rows()
    bridge.record_error = 'No space left on device: no more frames are recorded'
    assert bridge.rows()['tlog'] == (DiagnosticLevel.WARN, bridge.record_error)
    assert bridge.logged == [('warning', f'tlog: {bridge.record_error}')]
