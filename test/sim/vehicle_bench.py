# SPDX-License-Identifier: Apache-2.0
"""A ground station for one simulated vehicle: bytes both ways, virtual time, no socket."""
import math

from pymavlink.dialects.v20 import ardupilotmega as d

from uav_task_alloc.geometry.frames import Origin, to_geodetic
from uav_task_alloc.mavlink.transport.codec import Codec
from uav_task_alloc.sim.config import FlightMode, VehicleConfig
from uav_task_alloc.sim.vehicle import AUTOPILOTS, Vehicle

ORIGIN = Origin(47.397742, 8.545594, 488.0)
READY = 60.0  # [s] after boot: there is a position estimate
NAN = math.nan


class Bench:
    """Sends for any number of stations; `received` keeps all messages since `clear`."""

    def __init__(self, autopilot, ready=READY, **config):
        config = {'position': (0.0, 0.0, 0.0), 'floods': False,
                  'acceptance_radius': 2.0, **config}
        self.vehicle = Vehicle(VehicleConfig('uav_1', 1, ORIGIN, **config), AUTOPILOTS[autopilot])
        self.flight = self.vehicle.flight
        self.own = 1 if autopilot == 'ardupilot' else 0  # items before the first one flown
        self.now = 0.0
        self.received = []
        self._vehicle_codec = Codec(1, 1)
        self._parser = Codec(255, 190)
        self._stations = {}
        if ready:
            self.pass_time(ready, step=ready)
        self.received.clear()

    def send(self, message, station=(255, 190)):
        """Deliver a message; returns the immediate answers."""
        codec = self._stations.setdefault(station, Codec(*station))
        out = []
        for one in codec.parse(codec.pack(message)):
            out += self._to_ground(self.vehicle.receive(one, self.now))
        return out

    def pass_time(self, seconds, step=0.1):
        """Let time pass; returns the messages sent meanwhile."""
        out, end = [], self.now + seconds
        while self.now < end - 1e-9:
            self.now = min(end, self.now + step)
            out += self._to_ground(self.vehicle.step(self.now))
        return out

    def _to_ground(self, messages):
        out = []
        for message in messages:
            out += self._parser.parse(self._vehicle_codec.pack(message))
        self.received += out
        return out

    def until(self, condition, limit=600.0):
        """Let time pass until condition(); fail after `limit` [s]."""
        out, end = [], self.now + limit
        while not condition():
            assert self.now < end, 'timed out'
            out += self.pass_time(0.1)
        return out

    # the protocol, as a station uses it

    def count(self, number, **kw):
        return self.send(d.MAVLink_mission_count_message(1, 1, number, 0), **kw)

    def upload(self, items, **kw):
        """Answer the requests of a transfer; returns the last answer."""
        answers = self.count(len(items), **kw)
        while answers and answers[-1].get_type().startswith('MISSION_REQUEST'):
            item = items[answers[-1].seq]
            item.seq = answers[-1].seq
            answers = of(self.send(item, **kw), 'MISSION_REQUEST', 'MISSION_REQUEST_INT',
                         'MISSION_ACK')
        return answers[-1]

    def load(self, *items):
        """Upload with home before, where the autopilot wants it, and check that it is taken."""
        ack = self.upload([waypoint((9.0, 9.0, 9.0))] * self.own + list(items))
        assert ack.type == d.MAV_MISSION_ACCEPTED

    def download(self, **kw):
        """All items, as read back."""
        count, = of(self.send(d.MAVLink_mission_request_list_message(1, 1, 0), **kw),
                    'MISSION_COUNT')
        items = []
        for seq in range(count.count):
            items += of(self.send(d.MAVLink_mission_request_int_message(1, 1, seq, 0), **kw),
                        'MISSION_ITEM_INT')
        self.send(d.MAVLink_mission_ack_message(1, 1, 0, 0), **kw)
        return items

    def command(self, number, *params, **kw):
        """The result of a COMMAND_LONG."""
        padded = (*params, *[0.0] * (7 - len(params)))
        answers = self.send(d.MAVLink_command_long_message(1, 1, number, 0, *padded), **kw)
        return of(answers, 'COMMAND_ACK')[0].result

    def request(self, kind):
        """The messages of a type, such as 'SYS_STATUS', as REQUEST_MESSAGE brings them."""
        number = getattr(d, f'MAVLINK_MSG_ID_{kind}')
        padded = (number, *[0.0] * 6)
        return of(self.send(d.MAVLink_command_long_message(
            1, 1, d.MAV_CMD_REQUEST_MESSAGE, 0, *padded)), kind)

    def texts(self):
        """All STATUSTEXTs since `clear`."""
        return [m.text for m in of(self.received, 'STATUSTEXT')]

    def arm(self):
        return self.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def set_mode(self, mode):
        """DO_SET_MODE with a Mode or a custom_mode."""
        number = self.flight.custom_modes[mode] if isinstance(mode, FlightMode) else mode
        if number > 0xffff:
            return self.command(d.MAV_CMD_DO_SET_MODE, 1, number >> 16 & 0xff, number >> 24)
        return self.command(d.MAV_CMD_DO_SET_MODE, 1, number)

    def set_current(self, seq):
        return self.send(d.MAVLink_mission_set_current_message(1, 1, seq))

    def rise(self, height=30.0):
        """In the air and holding, at `height` [m]."""
        if self.own:
            self.set_mode(FlightMode.GUIDED)
        assert self.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        amsl = 0.0 if self.own else ORIGIN.altitude_amsl
        assert self.command(d.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, amsl + height) == 0
        self.until(lambda: self.flight.body.position[2] > height - 0.5)
        self.pass_time(3.0)

    def fly(self, *items):
        """Take off, and begin this mission."""
        self.rise()
        self.load(*items)
        assert self.set_mode(FlightMode.MISSION) == 0

    def reach(self, number):
        """Let the flown item number (from 0) be reached."""
        return self.until(lambda: any(
            m.seq == number + self.own for m in of(self.received, 'MISSION_ITEM_REACHED')))


def of(messages, *kinds):
    """Those of some types."""
    return [m for m in messages if m.get_type() in kinds]


def reached(messages):
    """The seqs of MISSION_ITEM_REACHED."""
    return [m.seq for m in of(messages, 'MISSION_ITEM_REACHED')]


def item(command, point=None, frame=0, p1=0.0, p2=0.0, p3=0.0, p4=0.0, current=0):
    """A MISSION_ITEM_INT at an ENU point."""
    x, y, z = 0.0, 0.0, 0.0
    if point is not None:
        x, y, z = to_geodetic(ORIGIN, point)
        z -= ORIGIN.altitude_amsl if frame in (3, 6, 10, 11) else 0.0
    return d.MAVLink_mission_item_int_message(
        1, 1, 0, frame, command, current, 1, p1, p2, p3, p4, round(x * 1e7), round(y * 1e7), z, 0)


def waypoint(point, **kw):
    return item(d.MAV_CMD_NAV_WAYPOINT, point, **kw)


def content(message):
    """The fields that both sides of a transfer should agree on."""
    return (message.frame, message.command, message.param1, message.param2, message.param3,
            message.param4, message.x, message.y, message.z)
