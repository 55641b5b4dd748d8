# SPDX-License-Identifier: Apache-2.0
"""The ground truth on a disk that is full: the vehicles fly on, and one line says so."""
import json
import os
import subprocess
import sys

from vehicle_bench import ORIGIN

from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.udp_fleet import UdpFleet

LIMIT = 5000  # [B]
FULL = """
import resource, sys
from test_full_disk import LIMIT, fly
resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, resource.RLIM_INFINITY))
for line in fly(sys.argv[1]):
    print(line)
"""


def fly(log_file, until=120.0):
    """What is reported while three vehicles stand for a while."""
    said = []
    fleet = UdpFleet([(VehicleConfig(f'uav_{n}', n, ORIGIN, (10.0 * n, 0.0, 0.0), floods=False),
                       'px4') for n in (1, 2, 3)], ('127.0.0.1', 9), log_file=log_file,
                     report=said.append)
    for k in range(int(until)):
        fleet._step_to(float(k))
    fleet.close()
    assert fleet._stepped == until - 1.0
    return said


def test_a_full_disk_ends_the_log_with_one_line():
    said = fly('/dev/full')
    assert said == ['log_file /dev/full: No space left on device: the flight goes on, and no more '
                    'of it is recorded there']


def test_what_has_room_is_whole_lines(tmp_path):
    log = tmp_path / 'truth.jsonl'
    done = subprocess.run([sys.executable, '-c', FULL, str(log)], text=True, check=True,
                          stdout=subprocess.PIPE,
                          env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    assert done.stdout.splitlines() == [f'log_file {log}: File too large: the flight goes on, and '
                                        'no more of it is recorded there']
    written = log.read_text()
    assert LIMIT - 1000 < len(written) <= LIMIT
    assert written.endswith('\n')
    assert {json.loads(line)['uav'] for line in written.splitlines()} == {
        'uav_1', 'uav_2', 'uav_3'}


def test_with_room_nothing_is_said(tmp_path):
    assert fly(tmp_path / 'truth.jsonl', 10.0) == []
    lines = (tmp_path / 'truth.jsonl').read_text().splitlines()
    assert len([line for line in lines if 'mode' in json.loads(line)]) >= 30
