# SPDX-License-Identifier: Apache-2.0
"""Simulated vehicles on UDP, a socket each, served by one thread; writes their ground truth."""
from __future__ import annotations

import contextlib
import json
import math
import os
import select
import socket
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TextIO

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.codec import Codec, Message
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.mission_server import AUTOPILOT_COMPONENT
from uav_task_alloc.sim.separation_judge import Loss, SeparationJudge, TrueState
from uav_task_alloc.sim.vehicle import AUTOPILOTS, Vehicle

UdpAddress = tuple[str, int]
_TICK = 0.02  # [s] wall time between steps
_SAMPLE = 0.5  # [s] vehicle time between ground-truth samples
_LONGEST = 0.25  # [s] vehicle time of one step, where a tick is not longer
_MAX_REMOTES = 16  # that a vehicle sends to besides its target; the latest are kept


def to_address(target: str) -> UdpAddress:
    """Parse `HOST:PORT` or `udpout:HOST:PORT`.

    Args:
        target: of a station.

    Returns:
        (host, port).

    Raises:
        InvalidValue: it is neither.
    """
    host, _, port = target.removeprefix('udpout:').rpartition(':')
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise InvalidValue('target', target, 'HOST:PORT')
    return host, int(port)


class UdpFleet:
    """Simulated vehicles, each on a UDP socket of its own; `spin` serves until `stop`.

    Args:
        vehicles: configuration and autopilot (a key of AUTOPILOTS) of each.
        target: address to which all of them send unasked.
        speedup: vehicle time per wall time.
        log_file: of the ground truth, JSON lines; '': none.
        separation: horizontal and vertical distance [m] that UAVs in the air have to keep, for
            the ground truth; 0: no loss is judged.
        report: called once, with why no more of the ground truth can be written.
    """

    def __init__(self, vehicles: Iterable[tuple[VehicleConfig, str]], target: UdpAddress,
                 speedup: float = 1.0, log_file: str | Path = '',
                 separation: tuple[float, float] = (0.0, 0.0),
                 report: Callable[[str], object] = print) -> None:
        self.speedup = speedup
        self._start, self._epoch = time.monotonic(), time.time()
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._endpoints = {config.uav: _Endpoint(Vehicle(config, AUTOPILOTS[autopilot]), target)
                           for config, autopilot in vehicles}
        self._log = _Log(log_file, self._epoch, report) if log_file else None
        self.judge = SeparationJudge(*separation)
        self._sample_at = self._stepped = 0.0

    @property
    def vehicles(self) -> dict[str, Vehicle]:
        """By uav id; do not access them while `spin` runs."""
        return {name: endpoint.vehicle for name, endpoint in self._endpoints.items()}

    @property
    def ports(self) -> dict[str, int]:
        """The UDP port of each vehicle, by uav id."""
        return {name: int(endpoint.socket.getsockname()[1])
                for name, endpoint in self._endpoints.items()}

    def now(self) -> float:
        """Vehicle time [s]."""
        return (time.monotonic() - self._start) * self.speedup

    def clock(self) -> float:
        """Simulated time [unix s]: vehicle time from the wall time of the start on."""
        return self._epoch + self.now()

    def set_alive(self, uav: str, alive: bool) -> str:
        """Kill a vehicle, or reboot it on the ground; returns an error text, '' on success.

        Args:
            uav: id.
            alive: False: it is lost and sends nothing.
        """
        with self._lock:
            endpoint = self._endpoints.get(uav)
            if endpoint is None:
                return f'uav {uav!r} is unknown: expected one of {", ".join(self._endpoints)}'
            if not alive:
                endpoint.vehicle.kill()
            elif not endpoint.vehicle.alive:
                endpoint.vehicle.revive(self._stepped)
        return ''

    def spin(self) -> None:
        """Serve the sockets and step the vehicles until `stop` is called."""
        sockets = {endpoint.socket: endpoint for endpoint in self._endpoints.values()}
        due = time.monotonic()
        while not self._stopping.is_set():
            ready, _, _ = select.select(list(sockets), [], [], max(0.0, due - time.monotonic()))
            with self._lock:
                if time.monotonic() >= due:
                    due = time.monotonic() + _TICK
                    self._step_to(self.now())
                for one in ready:
                    sockets[one].receive(self._stepped)

    def _step_to(self, now: float) -> None:
        """Step to `now` as if the process had not stalled: real vehicles fly and send on."""
        steps = max(1, math.ceil((now - self._stepped) / max(_LONGEST, _TICK * self.speedup)))
        for left in reversed(range(steps)):
            self._step(now - left * (now - self._stepped) / steps)
        self._stepped = now

    def _step(self, now: float) -> None:
        for endpoint in self._endpoints.values():
            endpoint.step(now)
        if self._log is None:
            return
        begun, ended = self.judge.step(now, {
            name: TrueState(flight.body.position, flight.home,
                            not flight.landed and not endpoint.vehicle.silent)
            for name, endpoint in self._endpoints.items()
            for flight in (endpoint.vehicle.flight,)})
        self._log.losses('separation_lost', begun)
        self._log.losses('separation_regained', ended)
        for name, endpoint in self._endpoints.items():
            self._log.events(name, endpoint.vehicle)
            if now >= self._sample_at:
                self._log.sample(name, endpoint.vehicle, now)
        if now >= self._sample_at:
            self._sample_at = now + _SAMPLE
            self._log.flush()

    def start(self) -> threading.Thread:
        """Spin in a thread of its own."""
        thread = threading.Thread(target=self.spin, name='fleet', daemon=True)
        thread.start()
        return thread

    def stop(self) -> None:
        """End `spin` within a tick."""
        self._stopping.set()

    def close(self) -> None:
        """Close the sockets and the log; after `spin` has ended."""
        for endpoint in self._endpoints.values():
            endpoint.socket.close()
        if self._log is not None:
            self._log.losses('least_distance', [
                Loss(pair, nearest, nearest.t) for pair, nearest in self.judge.least.items()])
            self._log.close()


class _Endpoint:
    """One vehicle and its socket; it sends to the target and to every remote that sent to it."""

    def __init__(self, vehicle: Vehicle, target: UdpAddress) -> None:
        self.vehicle = vehicle
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('', 0))
        self.socket.setblocking(False)
        self._codec = Codec(vehicle.config.system_id, AUTOPILOT_COMPONENT)
        self._target = target
        # by remote, the latest to send last
        self._parsers = {target: Codec(vehicle.config.system_id, AUTOPILOT_COMPONENT)}

    def receive(self, now: float) -> None:
        """Answer every datagram received."""
        while True:
            try:
                data, address = self.socket.recvfrom(4096)
            except BlockingIOError:
                return
            except ConnectionError:  # the other side is not there (yet)
                continue
            parser = self._parsers.pop(address, None) or Codec(
                self.vehicle.config.system_id, AUTOPILOT_COMPONENT)
            self._parsers[address] = parser
            if len(self._parsers) > 1 + _MAX_REMOTES:
                del self._parsers[next(a for a in self._parsers if a != self._target)]
            for message in parser.parse(data):
                self._send(self.vehicle.receive(message, now))
            parser.drop()

    def step(self, now: float) -> None:
        """Step the vehicle to `now` [s], and send what is due."""
        self._send(self.vehicle.step(now))

    def _send(self, messages: list[Message]) -> None:
        for message in messages:
            frame = self._codec.pack(message)
            for address in self._parsers:
                with contextlib.suppress(OSError):
                    self.socket.sendto(frame, address)  # lost, as on a real link


def _times(now: float, epoch: float) -> dict[str, float]:
    """Vehicle time [s], wall time and time of /clock [unix s] of a line of the log."""
    return {'t': round(now, 3), 'wall': round(time.time(), 3), 'clock': round(epoch + now, 3)}


class _Log:
    """The ground truth as JSON lines, up to the first that cannot be written."""

    def __init__(self, path: str | Path, epoch: float, report: Callable[[str], object]) -> None:
        self._path, self._epoch, self._report = path, epoch, report  # epoch: of /clock [unix s]
        self._file: TextIO | None = None  # None: closed
        self._whole = 0  # [B] of complete lines on disk
        try:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            self._file = open(path, 'w', encoding='utf-8')  # noqa: SIM115 - closed by close()
        except OSError as error:
            raise InvalidValue('log_file', str(path),
                               f'a file that can be written ({error})') from None

    def sample(self, uav: str, vehicle: Vehicle, now: float) -> None:
        """Write position, battery, mode and whether the vehicle is alive."""
        x, y, z = vehicle.flight.body.position
        self._write({**_times(now, self._epoch), 'uav': uav,
                     'x': round(x, 3), 'y': round(y, 3), 'z': round(z, 3),
                     'battery': round(vehicle.flight.body.battery, 4),
                     'mode': vehicle.mode.value, 'alive': not vehicle.silent})

    def events(self, uav: str, vehicle: Vehicle) -> None:
        """Write the events since the last call."""
        for event in vehicle.take_events():
            x, y, z = event.point
            line: dict[str, Any] = {
                **_times(event.t, self._epoch), 'uav': uav, 'event': event.name,
                'x': round(x, 3), 'y': round(y, 3), 'z': round(z, 3)}
            more = {'seq': event.seq, 'mode': event.mode, 'cause': event.cause or None,
                    'command': event.command or None}
            self._write(line | {key: value for key, value in more.items() if value is not None})

    def losses(self, event: str, losses: Iterable[Loss]) -> None:
        """Write how near pairs came, a line each with the time of that."""
        for loss in losses:
            self._write({**_times(loss.nearest.t, self._epoch), 'event': event,
                         'uav': loss.uavs[0], 'other': loss.uavs[1],
                         'since': round(self._epoch + loss.since, 3),
                         'horizontal': round(loss.nearest.horizontal, 3),
                         'vertical': round(loss.nearest.vertical, 3)})

    def _write(self, line: dict[str, Any]) -> None:
        if self._file is None:
            return
        try:
            self._file.write(json.dumps(line) + '\n')
        except OSError as error:  # the vehicles fly on
            self._end(error)

    def flush(self) -> None:
        """Make the lines written so far visible to readers."""
        if self._file is None:
            return
        try:
            self._file.flush()
            self._whole = self._file.tell()
        except OSError as error:
            self._end(error)

    def _end(self, error: OSError) -> None:
        """Close the file without the line that has no room, and report it."""
        with contextlib.suppress(OSError):  # it would write the rest of the line
            self._file and self._file.close()
        self._file = None
        with contextlib.suppress(OSError):
            os.truncate(self._path, self._whole)
        self._report(f'log_file {self._path}: {error.strerror}: the flight goes on, and no more '
                     'of it is recorded there')

    def close(self) -> None:
        """Close the file."""
        self.flush()
        if self._file is not None:
            self._file.close()
            self._file = None
