# SPDX-License-Identifier: Apache-2.0
"""MAVSDK as autopilots in a process of its own: commands on stdin, reports on stdout.

A crash of the library then fails one test and not the run. The arguments are the UDP port of the
bridge and system ids; stdin takes `reach ID`, `move ID LAT LON ALT`, `reboot ID` and `quit`.
"""
import ctypes
import json
import sys
import threading
import time

from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.action_server.action_server import (
    ActionServer,
    AllowableFlightModes,
    FlightMode,
)
from mavsdk.plugins.mission_raw_server.mission_raw_server import MissionRawServer
from mavsdk.plugins.param_server.param_server import ParamServer
from mavsdk.plugins.telemetry_server.telemetry_server import (
    Battery,
    Heading,
    LandedState,
    Position,
    TelemetryServer,
    VelocityNed,
    VtolState,
)

QUADROTOR = 2


def report(**fields):
    """Write one line to the test."""
    sys.stdout.write(json.dumps(fields) + '\n')
    sys.stdout.flush()


class Autopilot:
    """One system, airborne in Hold."""

    def __init__(self, port, system):
        self.port, self.system = port, system
        self.place = [47.397742, 8.545594, 538.0]
        self.begin()

    def begin(self):
        config = Configuration.create_manual(self.system, 1, True)
        config._lib.mavsdk_configuration_set_mav_type(
            ctypes.c_void_p(config._handle), ctypes.c_uint8(QUADROTOR))
        self.mavsdk = Mavsdk(config)
        self.mavsdk.add_any_connection(f'udpout://127.0.0.1:{self.port}')
        component = self.mavsdk.server_component_by_type(ComponentType.AUTOPILOT)
        self.params = ParamServer(component)
        self.telemetry = TelemetryServer(component)
        self.mission = MissionRawServer(component)
        self.action = ActionServer(component)
        self.mission.subscribe_incoming_mission(self.on_mission)
        self.mission.subscribe_current_item_changed(self.on_current)
        self.action.subscribe_flight_mode_change(self.on_mode)
        self.action.set_allowable_flight_modes(AllowableFlightModes(True, True, True))
        self.action.set_armable(True, True)
        self.action.set_armed_state(True)
        self.action.set_flight_mode(FlightMode.HOLD)

    def reboot(self):
        self.mavsdk.destroy()
        self.begin()

    def on_mission(self, result, plan, _):
        report(system=self.system, what='mission', result=int(result), items=[
            [i.command, i.frame, i.x, i.y, i.z, i.param1, i.param2, i.current]
            for i in plan.mission_items])

    def on_current(self, item, _):
        report(system=self.system, what='current', seq=item.seq)

    def on_mode(self, result, mode, _):
        report(system=self.system, what='mode', mode=int(mode))

    def publish(self):
        latitude, longitude, altitude = self.place
        home = Position(47.397742, 8.545594, 488.0, 0.0)
        self.telemetry.publish_position(
            Position(latitude, longitude, altitude, altitude - 488.0),
            VelocityNed(3.0, 4.0, -1.0), Heading(0.0))
        self.telemetry.publish_home(home)
        self.telemetry.publish_battery(Battery(12.0, 75.0))
        self.telemetry.publish_sys_status(Battery(12.0, 75.0), True, True, True, True, True)
        self.telemetry.publish_extended_sys_state(VtolState(0), LandedState.IN_AIR)


def main():
    """Serve until `quit`."""
    port, *systems = map(int, sys.argv[1:])
    autopilots = {system: Autopilot(port, system) for system in systems}
    stop = threading.Event()
    lock = threading.Lock()

    def stream():
        while not stop.wait(0.1):
            with lock:
                for autopilot in autopilots.values():
                    autopilot.publish()
    threading.Thread(target=stream, daemon=True).start()
    for line in sys.stdin:
        word, *rest = line.split()
        if word == 'quit':
            break
        autopilot = autopilots[int(rest[0])]
        with lock:
            if word == 'reach':
                autopilot.mission.set_current_item_complete()
            elif word == 'move':
                autopilot.place = [float(v) for v in rest[1:]]
            elif word == 'reboot':
                autopilot.reboot()
    stop.set()
    time.sleep(0.2)
    for autopilot in autopilots.values():
        autopilot.mavsdk.destroy()


if __name__ == '__main__':
    main()
