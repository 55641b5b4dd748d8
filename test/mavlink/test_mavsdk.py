# SPDX-License-Identifier: Apache-2.0
"""The bridge with independent autopilots: MAVSDK, in a process of its own."""
import importlib.util
import json
import random
import select
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mission_bench import ORIGIN, task_list
from piece_bench import list_of, piece, strip

from uav_task_alloc.actions import Action
from uav_task_alloc.geometry.frames import to_geodetic
from uav_task_alloc.mavlink.autopilots import PX4
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityState
from uav_task_alloc.mavlink.gcs.ground_station import GcsConfig, GroundStation
from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.gcs.status import UavMode, state_of
from uav_task_alloc.mavlink.mission.items import mission_items
from uav_task_alloc.mavlink.transport.connections import Connections
from uav_task_alloc.mavlink.transport.link import open_link

SCRIPT = Path(__file__).with_name('mavsdk_autopilot.py')
pytestmark = pytest.mark.skipif(importlib.util.find_spec('mavsdk') is None,
                                reason='mavsdk is not installed')


MISSION = {*range(39, 52), 73}  # ids of the messages of a transfer


class Proxy:
    """A UDP proxy that loses a share of the datagrams in both directions.

    Missions have a random generator of their own: the amount of telemetry in between, which
    depends on the load of the machine, does not change which mission messages are lost.
    """

    def __init__(self, port, loss):
        self.loss, self.to = loss, ('127.0.0.1', port)
        self.dice = {True: random.Random(1), False: random.Random(2)}
        self.front = self.socket()
        self.back, self.remotes = {}, {}  # a socket towards the bridge for each remote
        self.lost = 0

    @staticmethod
    def socket():
        one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        one.bind(('127.0.0.1', 0))
        one.setblocking(False)
        return one

    def step(self):
        for one in select.select([self.front, *self.remotes], [], [], 0.0)[0]:
            data, address = one.recvfrom(65536)
            if one is self.front and address not in self.back:
                self.back[address] = self.socket()
                self.remotes[self.back[address]] = address
            of_mission = int.from_bytes(data[7:10], 'little') in MISSION
            if self.dice[of_mission].random() < self.loss:
                self.lost += 1
            elif one is self.front:
                self.back[address].sendto(data, self.to)
            else:
                self.front.sendto(data, self.remotes[one])

    def close(self):
        for one in (self.front, *self.remotes):
            one.close()


class Peers:
    """A ground station on a real socket, with MAVSDK as the remote."""

    def __init__(self, *systems, loss=0.0):
        self.connections = Connections([open_link('udpin:127.0.0.1:0')], 245, 190, wall=time.time)
        port = self.connections.links[0].port
        self.proxy = Proxy(port, loss) if loss else None
        self.ground_station = GroundStation(GcsConfig(origin=ORIGIN, autopilot='px4'),
                                            random.Random(1))
        self.events, self.reports, self._half = [], [], ''
        self.process = subprocess.Popen(
            [sys.executable, str(SCRIPT), str(
                self.proxy.front.getsockname()[1] if self.proxy else port), *map(str, systems)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self.until(lambda: set(self.ground_station.sessions) == set(systems))
        self.hand_over()

    def until(self, condition, limit=120.0):
        """Serve until the condition holds; fail after `limit` [s].

        After a silence a link is good again when 10 s have passed without a gap of 2 s.
        """
        end = time.monotonic() + limit
        while not condition():
            assert time.monotonic() < end, 'timed out'
            assert self.process.poll() is None, 'MAVSDK has died'
            self.serve()

    def hand_over(self):
        """Hand over: airborne in Hold at the start, they belong to another party."""
        for session in self.ground_station.sessions.values():
            self.until(lambda session=session: session.executor.telemetry.airborne)
            assert session.executor.authority.state is not AuthorityState.HELD
            assert self.ground_station.hand_over(session.uav_id, 'test', time.monotonic()) == ''

    def serve(self):
        out = []
        if self.proxy:
            self.proxy.step()
        for address, message in self.connections.receive(0.005 if self.proxy else 0.02):
            out += self.ground_station.receive(address, message, time.monotonic())
        out += self.ground_station.step(time.monotonic())
        self.connections.send(out)
        for session in self.ground_station.sessions.values():
            while session.executor.events:
                self.events.append((session.uav_id, session.executor.events.popleft()))
        self.read_reports()

    def read_reports(self):
        while select.select([self.process.stdout], [], [], 0.0)[0]:
            *lines, self._half = (self._half + self.process.stdout.read1(65536).decode()
                                  ).split('\n')
            self.reports += [json.loads(line) for line in lines if line.startswith('{')]
            if self.process.poll() is not None:
                break

    def command(self, *words):
        self.process.stdin.write((' '.join(map(str, words)) + '\n').encode())
        self.process.stdin.flush()

    def assign(self, system, tasks):
        self.connections.send(self.ground_station.assign(f'uav_{system}', tasks, time.monotonic()))

    def onboard(self, system):
        return self.ground_station.sessions[system].executor.onboard

    def state(self, system):
        return state_of(self.ground_station.sessions[system], time.monotonic())

    def missions(self, system):
        """Item lists stored by MAVSDK."""
        return [report['items'] for report in self.reports
                if report['what'] == 'mission' and report['system'] == system]

    def completed(self, system):
        return [e.task for u, e in self.events
                if u == f'uav_{system}' and e.event == 'COMPLETED']

    def fly(self, system, place):
        """Move to a position, and report the current item as reached once the bridge knows it."""
        self.command('move', system, *to_geodetic(ORIGIN, place))
        self.until(lambda: max(abs(a - b) for a, b in zip(
            self.state(system).position, place, strict=True)) < 1.0)
        self.command('reach', system)

    def close(self):
        if self.process.poll() is None:
            self.command('quit')
            try:
                self.process.wait(60)
            except subprocess.TimeoutExpired:
                self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()
        self.connections.close()
        if self.proxy:
            self.proxy.close()


@pytest.fixture
def mavsdk():
    started = []

    def make(*systems, **kwargs):
        started.append(Peers(*systems, **kwargs))
        return started[-1]
    yield make
    for one in started:
        one.close()


def items(tasks):
    """The items to be sent to PX4 for a list."""
    return [(i.command, i.frame, i.x, i.y, i.params[0], i.params[1])
            for i in mission_items(tasks, PX4.rules, ORIGIN)]


def stored(mission):
    return [(c, f, x, y, p1, p2) for c, f, x, y, _, p1, p2, _ in mission]


def flying(peers, system, revision=1):
    peers.until(lambda: peers.onboard(system).revision == revision
                and peers.state(system).mode is UavMode.ON_MISSION)


def test_mavsdk_two_systems_on_one_port_hold_exactly_their_lists(mavsdk):
    peers = mavsdk(1, 2)
    lists = {1: task_list('ABCDE', service=2.5), 2: task_list('FGH')}
    for system, tasks in lists.items():
        peers.assign(system, tasks)
    for system, tasks in lists.items():
        flying(peers, system)
        peers.until(lambda system=system: peers.missions(system))
        assert stored(peers.missions(system)[-1]) == items(tasks)
        assert peers.onboard(system).state is MissionState.VERIFIED


def test_mavsdk_ways_and_actions_are_read_back(mavsdk):
    peers = mavsdk(1)
    way = piece('L', (0, 60), (100, 60), (100, 160), actions=(
        Action('gimbal', {'pitch': -1.5}), Action('roi', {'x': 50.0, 'y': 80.0, 'z': 2.0}),
        Action('photo', {'count': 3, 'interval': 2.0}), Action('gripper', {'release': 1}),
        Action('speed', {'speed': 6.0}), Action('video')))
    tasks = list_of(way, strip(2), turned=('F#2',))
    peers.assign(1, tasks)
    peers.until(lambda: peers.onboard(1).state is MissionState.VERIFIED)
    peers.until(lambda: peers.missions(1))
    held, sent = stored(peers.missions(1)[-1]), items(tasks)
    assert len(held) == len(sent)
    for one, other in zip(held, sent, strict=True):
        assert one == pytest.approx(other, rel=1e-6)
    assert peers.onboard(1).upload.uploads == 1


def test_mavsdk_a_list_is_replaced_while_flying(mavsdk):
    peers = mavsdk(1)
    peers.assign(1, task_list('ABC'))
    flying(peers, 1)
    replaced = task_list('CDA', 2)
    peers.assign(1, replaced)
    flying(peers, 1, 2)
    peers.until(lambda: len(peers.missions(1)) == 2)
    assert stored(peers.missions(1)[-1]) == items(replaced)
    assert [i[-1] for i in peers.missions(1)[-1]] == [1, 0, 0]
    modes = [report['mode'] for report in peers.reports if report['what'] == 'mode']
    assert modes == [3, 4]  # it was never held


def test_mavsdk_progress_and_telemetry_are_right(mavsdk):
    peers = mavsdk(1)
    tasks = task_list('AB')
    peers.assign(1, tasks)
    flying(peers, 1)
    for done, stop in enumerate(tasks.stops, 1):
        peers.fly(1, stop.task.position)
        peers.until(lambda done=done: len(peers.completed(1)) == done)
    assert peers.completed(1) == ['A', 'B']
    state = peers.state(1)
    assert state.position == pytest.approx((100.0, 100.0, 50.0), abs=0.05)
    assert state.velocity == pytest.approx((4.0, 3.0, 1.0))
    assert state.battery == pytest.approx(0.75, abs=0.02)
    assert [(e.task, e.event) for _, e in peers.events] == [
        ('A', 'STARTED'), ('A', 'COMPLETED'), ('B', 'STARTED'), ('B', 'COMPLETED')]


def test_mavsdk_a_loss_of_a_fifth_delays_and_changes_nothing(mavsdk):
    peers = mavsdk(1, loss=0.2)
    for revision, names in enumerate(['ABCDE', 'EDCBA'], 1):
        peers.assign(1, task_list(names, revision))
        peers.until(lambda revision=revision: peers.onboard(1).revision == revision)
        peers.until(lambda: peers.missions(1))
        assert stored(peers.missions(1)[-1]) == items(task_list(names))
    assert peers.proxy.lost > 20


def test_mavsdk_after_a_reboot_the_mission_is_uploaded_again(mavsdk):
    peers = mavsdk(1)
    peers.assign(1, task_list('AB'))
    flying(peers, 1)
    peers.until(lambda: len(peers.missions(1)) == 1)  # a reboot drops what is not reported yet
    peers.command('reboot', 1)
    session = peers.ground_station.sessions[1]
    peers.until(lambda: session.executor.telemetry.restarts == 1)
    # airborne in Hold, which nobody on this side has commanded
    peers.until(lambda: session.executor.authority.state is AuthorityState.LOST)
    assert len(peers.missions(1)) == 1
    peers.until(lambda: not peers.ground_station.hand_over('uav_1', 'test', time.monotonic()))
    peers.until(lambda: len(peers.missions(1)) == 2)
    flying(peers, 1)
    assert stored(peers.missions(1)[-1]) == items(task_list('AB'))
