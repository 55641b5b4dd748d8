# SPDX-License-Identifier: Apache-2.0
"""Simulates a scenario: allocator, bridge, simulated fleet, player and live view."""
from launch.actions import OpaqueFunction
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription
from uav_task_alloc.nodes.ros.launch_arguments import (
    BRIDGE_SIGTERM_TIMEOUT,
    TILE_ARGUMENTS,
    RespawnedNode,
    argument,
    declared,
    flag,
    localhost_only,
    node_action,
    optional_number,
    record_file,
    refuse_unknown,
    rviz_action,
    tile_parameters,
)
from uav_task_alloc.nodes.ros.udp_ports import free_port
from uav_task_alloc.scenario import load, simulation_parameters

ARGUMENTS = {
    'scenario': ([FindPackageShare('uav_task_alloc'), '/config/scenarios/demo.yaml'],
                 'Scenario file (YAML): origin, UAVs, tasks and zones.'),
    'speedup': ('', 'How many times faster than real time, 0.1 to 100; empty: as the scenario '
                'says.'),
    'rviz': ('false', 'true: start RViz, too.'),
    'record': ('', 'MCAP file to record all topics into; it must not exist. Empty: none.'),
    **TILE_ARGUMENTS,
    'bridge_state_dir': ('', 'Folder in which the bridge stores across restarts which vehicles '
                         'it has authority over; empty: not stored.'),
}


def generate_launch_description() -> LaunchDescription:
    """The arguments, `--show-args` describes them, and the nodes."""
    return LaunchDescription([*declared(ARGUMENTS), OpaqueFunction(function=start)])


def start(context: object) -> list:
    """All nodes, with the parameters of the scenario, on loopback and for its vehicles only.

    Raises:
        ValueError, ScenarioError: an argument is invalid; nothing has been started then.
    """
    refuse_unknown(__file__, ARGUMENTS)
    path, record = argument(context, 'scenario'), record_file(context)
    viewers = [rviz_action(context, simulated=True)] if flag(context, 'rviz') else []
    parameters = simulation_parameters(load(path), path, free_port(),
                                       optional_number(context, 'speedup'))
    return [
        *localhost_only(),
        *RespawnedNode('allocator', parameters['allocator']).start(),
        *RespawnedNode('mavlink_bridge', parameters['mavlink_bridge'],
                       {'state_dir': argument(context, 'bridge_state_dir')},
                       sigterm_timeout=BRIDGE_SIGTERM_TIMEOUT).start(),
        node_action('fleet_sim', parameters['fleet_sim']),
        node_action('scenario_player', parameters['scenario_player']),
        node_action('live_view', parameters['live_view'],
                    {'record': record, 'stay': True, **tile_parameters(context)}),
        *viewers,
    ]
