# SPDX-License-Identifier: Apache-2.0
"""Simulates a scenario: allocator, bridge, simulated fleet, player and live view."""
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription
from uav_task_alloc.nodes.ros.launch_arguments import (
    BRIDGE_SIGTERM_TIMEOUT,
    RespawnedNode,
    argument,
    flag,
    localhost_only,
    node_action,
    optional_number,
    record_file,
    rviz_action,
)
from uav_task_alloc.nodes.ros.udp_ports import free_port
from uav_task_alloc.scenario import load, simulation_parameters


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments.

    Arguments:
        scenario: YAML file.
        speedup: times real time; empty: the scenario's.
        rviz: true: start RViz as well.
        record: MCAP file for all topics; empty: none.
        bridge_state_dir: folder in which the bridge saves which vehicles it has authority over,
            for a restart; empty: not saved.
    """
    return LaunchDescription([
        DeclareLaunchArgument('scenario', default_value=PathJoinSubstitution(
            [FindPackageShare('uav_task_alloc'), 'config', 'scenarios', 'demo.yaml'])),
        DeclareLaunchArgument('speedup', default_value=''),
        DeclareLaunchArgument('rviz', default_value='false'),
        DeclareLaunchArgument('record', default_value=''),
        DeclareLaunchArgument('bridge_state_dir', default_value=''),
        OpaqueFunction(function=start),
    ])


def start(context: object) -> list:
    """All nodes, with the parameters of the scenario, on loopback and for its vehicles only.

    Raises:
        ValueError, ScenarioError: an argument is invalid; nothing has been started then.
    """
    path, record = argument(context, 'scenario'), record_file(context)
    viewers = [rviz_action(context)] if flag(context, 'rviz') else []
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
        node_action('live_view', parameters['live_view'], {'record': record, 'stay': True}),
        *viewers,
    ]
