# SPDX-License-Identifier: Apache-2.0
"""Remotes on real sockets, and what a `Connections` receives."""
import socket

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.mavlink.transport.codec import Codec

WALL = 1.8e9  # [s]


def heartbeat(autopilot=d.MAV_AUTOPILOT_PX4):
    return d.MAVLink_heartbeat_message(d.MAV_TYPE_QUADROTOR, autopilot, 0, 0, 4, 3)


class Remote:
    """A MAVLink remote on UDP."""

    def __init__(self, connections, system=1, signing=None):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', 0))
        self.socket.settimeout(60.0)
        self.codec = Codec(system, 1, signing=signing)
        self.to = ('127.0.0.1', connections.links[0].port)

    def send(self, message):
        frame = self.codec.pack(message)
        self.socket.sendto(frame, self.to)
        return frame

    def receive(self):
        return self.codec.parse(self.socket.recv(65536))


def receive(connections, count=1):
    received = []
    for _ in range(100):
        received += connections.receive(0.1)
        if len(received) >= count:
            break
    return received


def nothing_received(connections):
    return connections.receive(0.05) == []
