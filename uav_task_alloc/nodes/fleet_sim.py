# SPDX-License-Identifier: Apache-2.0
"""Simulates the UAVs of a scenario as ArduPilot and PX4 vehicles with MAVLink connections."""
from __future__ import annotations

import math
import socket

from rclpy.node import Node
from uav_task_alloc_msgs.srv import SetAvailability

from uav_task_alloc import scenario
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.ros.clock_publisher import ClockPublisher
from uav_task_alloc.nodes.ros.parameters import declare, given
from uav_task_alloc.nodes.ros.run import run
from uav_task_alloc.params import FleetSimParams
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.udp_fleet import UdpFleet, to_address
from uav_task_alloc.sim.wind import Wind

# [m/s] defaults of WPNAV_SPEED_UP, WPNAV_SPEED_DN; MPC_Z_V_AUTO_UP, MPC_Z_V_AUTO_DN
_CLIMB_RATES, _DESCENT_RATE = {'ardupilot': 2.5, 'px4': 3.0}, 1.5


class FleetSim(Node):
    """Runs the simulated fleet in a thread of its own.

    Publishes:
        `/clock` (Clock), unless the parameter `clock` is false.
    Services:
        `~/set_alive` (SetAvailability): switches a UAV off, or on again where it is.
    Parameters:
        FleetSimParams, see docs/parameters.md.
    """

    def __init__(self) -> None:
        super().__init__('fleet_sim')
        params = declare(self, FleetSimParams).now
        played = scenario.load(given('scenario', params.scenario, 'a scenario file'))
        self.fleet = UdpFleet(
            [(vehicle_config(uav, played, params), uav.autopilot) for uav in played.uavs],
            known_address(params.target), params.speedup, params.log_file,
            (played.separation.horizontal, played.separation.vertical),
            self.get_logger().error)
        self.thread = self.fleet.start()
        if params.clock:
            self.publisher = ClockPublisher(self, self.fleet.clock)
        self.create_service(SetAvailability, '~/set_alive', self.set_alive)
        self.get_logger().info(f'{played.name}: {len(played.uavs)} vehicles send to '
                               f'{params.target}, {params.speedup:g} times real time')

    def set_alive(self, request: SetAvailability.Request,
                  response: SetAvailability.Response) -> SetAvailability.Response:
        """Switch a UAV off or on."""
        refusal = self.fleet.set_alive(request.uav_id, request.available)
        response.success, response.message = not refusal, refusal or 'done'
        self.get_logger().info(
            f'{request.uav_id}: {refusal or ("alive" if request.available else "dead")}')
        return response

    def destroy_node(self) -> None:
        """End the thread before the log is closed."""
        self.fleet.stop()
        self.thread.join()
        self.fleet.close()
        super().destroy_node()


def known_address(target: str) -> tuple[str, int]:
    """The address of the bridge: IPv4 address, port. Raises InvalidValue."""
    host, port = to_address(target)
    try:
        return socket.gethostbyname(host), port
    except OSError as error:
        raise InvalidValue('target', target, f'HOST:PORT with a known host ({error})') from None


def vehicle_config(uav: scenario.ScenarioUav, played: scenario.Scenario,
                   params: FleetSimParams) -> VehicleConfig:
    """The simulated vehicle of a UAV of a scenario."""
    def rate(own: float, given: float, usual: float) -> float:
        return own if math.isfinite(own) else given or usual

    wind = Wind(played.wind.east + params.wind_east, played.wind.north + params.wind_north,
                max(played.wind.gusts, params.gusts), played.seed)
    return VehicleConfig(
        uav.id, uav.system_id, played.origin, uav.position, uav.home, uav.cruise_speed,
        climb_rate=rate(uav.climb_speed, params.climb_rate, _CLIMB_RATES[uav.autopilot]),
        descent_rate=rate(uav.descent_speed, params.descent_rate, _DESCENT_RATE),
        range=uav.most_range, endurance=uav.most_endurance, charge=uav.charge,
        turnaround=uav.turnaround, max_airspeed=params.max_airspeed or None,
        wind=None if wind == Wind(seed=played.seed) else wind,
        arming_delay=params.arming_delay if params.arming_delay >= 0.0 else None)


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run uav_task_alloc fleet_sim`."""
    run(FleetSim, args, params=FleetSimParams)
