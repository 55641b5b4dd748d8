# SPDX-License-Identifier: Apache-2.0
"""Simulated vehicles on UDP, a socket each, served by one thread; their ground truth in a log."""
from __future__ import annotations

import contextlib
import json
import select
import socket
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.transport.codec import Codec, Message
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.mission_server import AUTOPILOT_COMPONENT
from uav_task_alloc.sim.vehicle import AUTOPILOTS, Vehicle

UdpAddress = tuple[str, int]
_TICK = 0.02  # [s] wall time between steps
_SAMPLE = 0.5  # [s] vehicle time between ground-truth samples
_MOST_STATIONS = 16  # that a vehicle speaks to besides its target; the latest are kept


def to_address(target: str) -> UdpAddress:
    """`HOST:PORT` or `udpout:HOST:PORT`; raise InvalidValue otherwise."""
    host, _, port = target.removeprefix('udpout:').rpartition(':')
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise InvalidValue('target', target, 'HOST:PORT')
    return host, int(port)


class UdpFleet:
    """`spin` serves until `stop`; vehicle time is wall time since the start x speedup."""

    def __init__(self, vehicles: Iterable[tuple[VehicleConfig, str]], target: UdpAddress,
                 speedup: float = 1.0, log_file: str | Path = '') -> None:
        self.speedup = speedup
        self._began = time.monotonic()
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._stations = {config.uav: _Station(Vehicle(config, AUTOPILOTS[autopilot]), target)
                          for config, autopilot in vehicles}
        self._log = _Log(log_file) if log_file else None
        self._sample_at = 0.0

    @property
    def vehicles(self) -> dict[str, Vehicle]:
        """By uav id. Touch them only while nobody spins."""
        return {name: station.vehicle for name, station in self._stations.items()}

    @property
    def ports(self) -> dict[str, int]:
        """On which each hears any station, by uav id."""
        return {name: int(station.socket.getsockname()[1])
                for name, station in self._stations.items()}

    def now(self) -> float:
        """Vehicle time [s]."""
        return (time.monotonic() - self._began) * self.speedup

    def set_alive(self, uav: str, alive: bool) -> str:
        """Let a vehicle die, or reboot it where it fell; returns what is wrong, '' if nothing."""
        with self._lock:
            station = self._stations.get(uav)
            if station is None:
                return f'uav {uav!r} is unknown: expected one of {", ".join(self._stations)}'
            if not alive:
                station.vehicle.kill()
            elif not station.vehicle.alive:
                station.vehicle.revive(self.now())
        return ''

    def spin(self) -> None:
        """Serve the sockets and let time pass until `stop` is called."""
        sockets = {station.socket: station for station in self._stations.values()}
        due = time.monotonic()
        while not self._stopping.is_set():
            ready, _, _ = select.select(list(sockets), [], [], max(0.0, due - time.monotonic()))
            with self._lock:
                for one in ready:
                    sockets[one].hear(self.now())
                if time.monotonic() >= due:
                    due = time.monotonic() + _TICK
                    self._step(self.now())

    def _step(self, now: float) -> None:
        for station in self._stations.values():
            station.step(now)
        if self._log is None:
            return
        for name, station in self._stations.items():
            self._log.events(name, station.vehicle)
            if now >= self._sample_at:
                self._log.sample(name, station.vehicle, now)
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
        """Give the sockets and the log back; after `spin` has ended."""
        for station in self._stations.values():
            station.socket.close()
        if self._log is not None:
            self._log.close()


class _Station:
    """One vehicle behind its socket; it speaks to the target and to whoever has spoken to it."""

    def __init__(self, vehicle: Vehicle, target: UdpAddress) -> None:
        self.vehicle = vehicle
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('', 0))
        self.socket.setblocking(False)
        self._codec = Codec(vehicle.config.system_id, AUTOPILOT_COMPONENT)
        self._target = target
        self._parsers = {target: Codec(vehicle.config.system_id, AUTOPILOT_COMPONENT)}  # last heard last

    def hear(self, now: float) -> None:
        """Answer every datagram that waits."""
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
            if len(self._parsers) > 1 + _MOST_STATIONS:
                del self._parsers[next(a for a in self._parsers if a != self._target)]
            for message in parser.parse(data):
                self._say(self.vehicle.receive(message, now))
            parser.drop()

    def step(self, now: float) -> None:
        """Let time pass, and tell what is due."""
        self._say(self.vehicle.step(now))

    def _say(self, messages: list[Message]) -> None:
        for message in messages:
            frame = self._codec.pack(message)
            for address in self._parsers:
                with contextlib.suppress(BlockingIOError, ConnectionError):
                    self.socket.sendto(frame, address)  # a radio loses what does not fit


class _Log:
    """The ground truth, one JSON object a line."""

    def __init__(self, path: str | Path) -> None:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        self._file = open(path, 'w', encoding='utf-8')  # noqa: SIM115 - closed by close()

    def sample(self, uav: str, vehicle: Vehicle, now: float) -> None:
        """Where it is and what it does."""
        x, y, z = vehicle.flight.body.position
        self._write({'t': round(now, 3), 'wall': round(time.time(), 3), 'uav': uav,
                     'x': round(x, 3), 'y': round(y, 3), 'z': round(z, 3),
                     'mode': vehicle.mode.value, 'alive': vehicle.alive})

    def events(self, uav: str, vehicle: Vehicle) -> None:
        """What happened since the last time."""
        for event in vehicle.take_events():
            x, y, z = event.point
            line: dict[str, Any] = {
                't': round(event.t, 3), 'wall': round(time.time(), 3), 'uav': uav,
                'event': event.name, 'x': round(x, 3), 'y': round(y, 3), 'z': round(z, 3)}
            more = {'seq': event.seq, 'mode': event.mode, 'cause': event.cause or None,
                    'command': event.command or None}
            self._write(line | {key: value for key, value in more.items() if value is not None})

    def _write(self, line: dict[str, Any]) -> None:
        self._file.write(json.dumps(line) + '\n')

    def flush(self) -> None:
        """Let a reader see what was written."""
        self._file.flush()

    def close(self) -> None:
        """No more lines."""
        self._file.close()
