# SPDX-License-Identifier: Apache-2.0
"""Flies the UAVs of a scenario as simulated ArduPilot and PX4 vehicles that speak MAVLink."""
from __future__ import annotations

from rclpy.node import Node
from uav_task_alloc_msgs.srv import SetAvailability

from uav_task_alloc import scenario
from uav_task_alloc.nodes.ros.parameters import declare
from uav_task_alloc.nodes.ros.run import run
from uav_task_alloc.params import FleetSimParams
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.udp_fleet import UdpFleet, to_address


class FleetSim(Node):
    """Holds the fleet, which lives in a thread of its own, and lets a UAV die when told."""

    def __init__(self) -> None:
        super().__init__('fleet_sim')
        params = declare(self, FleetSimParams).now
        played = scenario.load(params.scenario)
        self.fleet = UdpFleet([(config_of(uav, played, params), uav.autopilot)
                            for uav in played.uavs],
                           to_address(params.target), params.speedup, params.log_file)
        self.thread = self.fleet.start()
        self.create_service(SetAvailability, '~/set_alive', self.set_alive)
        self.get_logger().info(f'{played.name}: {len(played.uavs)} vehicles speak to '
                               f'{params.target}, time runs {params.speedup:g} times')

    def set_alive(self, request: SetAvailability.Request,
                  response: SetAvailability.Response) -> SetAvailability.Response:
        """Let a UAV die, or boot it again where it fell."""
        wrong = self.fleet.set_alive(request.uav_id, request.available)
        response.success, response.message = not wrong, wrong or 'done'
        self.get_logger().info(
            f'{request.uav_id}: {wrong or ("alive" if request.available else "dead")}')
        return response

    def destroy_node(self) -> None:
        """End the thread first; the log is whole then."""
        self.fleet.stop()
        self.thread.join()
        self.fleet.close()
        super().destroy_node()


def config_of(uav: scenario.ScenarioUav, played: scenario.Scenario,
              params: FleetSimParams) -> VehicleConfig:
    """The airframe of a UAV of the scenario."""
    return VehicleConfig(
        uav.id, uav.system_id, played.origin, uav.position, uav.home, uav.cruise_speed,
        range=uav.range, arming_delay=params.arming_delay if params.arming_delay >= 0.0 else None)


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run(FleetSim, args)
