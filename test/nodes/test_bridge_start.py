# SPDX-License-Identifier: Apache-2.0
"""The start of the bridge as a process: what it refuses, and what it logs."""
import signal

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

pytestmark = pytest.mark.ros


@pytest.mark.parametrize('entry', ['uav_1', 'uav_1:', ':5', 'uav_1:far', 'uav_1:-1', 'uav_1:nan',
                                   'uav_1:1e8'])
def test_a_bad_range_ends_the_bridge_with_a_reason(start, entry):
    bridge = start('mavlink_bridge', '-p', f"full_ranges:=['{entry}']", '-p',
                   "connections:=['udpin:127.0.0.1:0']")
    bridge.popen.wait(90)
    assert bridge.stop() == (1, f"full_ranges = '{entry}': expected `UAV_ID:METRES` with metres "
                                'in [0, 1e+07], a UAV once\n')


@pytest.mark.parametrize('entry', ['uav_1', ':turnaround=5', 'uav_1:turnaround', 'uav_1:range=5',
                                   'uav_1:turnaround=0', 'uav_1:turnaround=nan',
                                   'uav_1:turnaround=5,turnaround=6'])
def test_a_bad_limit_ends_the_bridge_with_a_reason(start, entry):
    bridge = start('mavlink_bridge', '-p', f"uav_limits:=['{entry}']", '-p',
                   "connections:=['udpin:127.0.0.1:0']")
    bridge.popen.wait(90)
    status, text = bridge.stop()
    assert status == 1
    assert text.startswith(f"uav_limits = '{entry}': expected `UAV_ID:NAME=NUMBER,...`")


def test_finding_13_a_corrupt_signing_timestamp_ends_the_start_with_a_reason(start, tmp_path):
    tmp_path.joinpath('key').write_bytes(bytes(32))
    tmp_path.joinpath('key.timestamp').write_text('soon')
    process = start('mavlink_bridge', '-p', "connections:=['udpin:127.0.0.1:0']", '-p',
                    f'signing_key_file:={tmp_path}/key')
    process.popen.wait(90)
    code, out = process.stop()
    assert code == 1, out
    assert f"signing timestamp in {tmp_path}/key.timestamp = 'soon': expected a whole" in out
    assert 'Traceback' not in out


@pytest.mark.parametrize(('given', 'text'), [
    ("connections:=['udp:1']", "connections = 'udp:1': expected udpin:HOST:PORT"),
    ("connections:=['udpin:127.0.0.1:x']", "'udpin:127.0.0.1:x': expected udpin:HOST:PORT"),
    ('system_ids:=[300]', 'system_ids = 300.0: expected a number in [1, 255]'),
    ('uav_id_pattern:=one', "uav_id_pattern = 'one': expected a text with {sysid}"),
    ('uav_id_pattern:="{sysid}"', 'expected a ROS name'),
    ('uav_id_pattern:="u{sysid[0]}"', "'u{sysid[0]}': expected a text with {sysid}"),
    ('uav_id_pattern:="u{sysid.x}"', "'u{sysid.x}': expected a text with {sysid}"),
    ('signing_key_file:=/nowhere', "signing_key_file = '/nowhere': expected a readable file"),
    ('state_dir:=/dev/null/x', "state_dir = '/dev/null/x': expected a folder that can be writt"),
    ('relaunch:=never', "relaunch = 'never': expected one of operator, automatic"),
    ("capabilities:=['camera']", "capabilities = 'camera': expected `UAV_ID:WORD,WORD`"),
])
def test_a_bad_parameter_is_refused_with_a_reason(start, given, text):
    process = start('mavlink_bridge', '-p', "connections:=['udpin:127.0.0.1:0']", '-p', given)
    process.popen.wait(90)
    code, out = process.stop()
    assert code == 1, out
    assert text in out
    assert 'Traceback' not in out


def test_a_link_that_cannot_be_opened_is_logged_once_and_in_diagnostics(start, probe):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    bridge = start('mavlink_bridge', '-p', "connections:=['/dev/ttyNOPE:57600']")
    words = '/dev/ttyNOPE:57600: No such file or directory'
    probe.until(lambda: words in bridge.output())
    probe.until(lambda: len(health) > 2)
    assert health[-1].status[0].message == 'No such file or directory'
    assert bridge.output().count(words) == 1


def test_diagnostics_of_a_bridge_say_that_simulated_time_stands_still(start, probe):
    health = probe.collect(DiagnosticArray, '/diagnostics', 10)
    start('mavlink_bridge', '-p', 'use_sim_time:=true', '-p',
          "connections:=['udpin:127.0.0.1:0']")
    probe.until(lambda: any('nothing publishes /clock: waiting for it' in row.message
                            and row.level == DiagnosticStatus.WARN
                            and row.hardware_id == 'clock'
                            for msg in health for row in msg.status))


def test_a_bridge_logs_what_it_listens_to_and_that_it_finds_no_vehicle(start, probe):
    bridge = start('mavlink_bridge', '-p', 'system_ids:=[7, 9]', '-p',
                   "connections:=['udpin:127.0.0.1:0', 'tcp:127.0.0.1:1']")
    probe.until(lambda: 'no vehicle found' in bridge.output())
    code, out = bridge.stop()
    assert code == 0
    lines = [line.split(']')[0] + line.split(']', 2)[2] for line in out.splitlines()]
    for line in ('[INFO [mavlink_bridge]: listens on udpin:127.0.0.1:0 for systems 7, 9',
                 '[INFO [mavlink_bridge]: connects to tcp:127.0.0.1:1 for systems 7, 9',
                 '[WARN [mavlink_bridge]: no vehicle found for 10 s: expected the heartbeat of an '
                 'autopilot on udpin:127.0.0.1:0, tcp:127.0.0.1:1'):
        assert lines.count(line) == 1


def test_a_second_bridge_with_the_state_dir_of_one_that_runs_does_not_start(
        start, probe, tmp_path):
    given = ('-p', "connections:=['udpin:127.0.0.1:0']", '-p', f'state_dir:={tmp_path}/bridge')
    first = start('mavlink_bridge', *given, '-r', '__ns:=/one')
    probe.until(lambda: 'listens on' in first.output())
    second = start('mavlink_bridge', *given, '-r', '__ns:=/two')
    second.popen.wait(90)
    code, out = second.stop()
    assert code == 1, out
    assert f"state_dir = '{tmp_path}/bridge': expected a folder of its own" in out
    first.stop(signal.SIGKILL)
    third = start('mavlink_bridge', *given, '-r', '__ns:=/two')
    probe.until(lambda: 'listens on' in third.output())
