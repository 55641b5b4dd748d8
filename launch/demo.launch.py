# SPDX-License-Identifier: Apache-2.0
"""A scenario in the air: allocator, bridge, simulated fleet, player and live view."""
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription
from uav_task_alloc.nodes.ros.launch_arguments import (
    BRIDGE_END,
    Lasting,
    argument,
    flag,
    node,
    number,
    on_this_machine,
    record_file,
    rviz,
)
from uav_task_alloc.nodes.ros.udp_ports import free_port
from uav_task_alloc.scenario import load, simulation_parameters


def generate_launch_description() -> LaunchDescription:
    """Arguments: scenario (a YAML file), speedup (empty: the scenario's), rviz (true: show it
    there too), record (an MCAP file for all topics), bridge_state_dir (a folder that keeps over a
    restart who has each aircraft; empty: nothing is kept).
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
    """All nodes, with the scenario's values, on loopback and for its vehicles alone.

    Whatever is wrong with an argument is raised before anything is started.
    """
    path, record = argument(context, 'scenario'), record_file(context)
    shown = [rviz(context)] if flag(context, 'rviz') else []
    given = simulation_parameters(load(path), path, free_port(), number(context, 'speedup'))
    return [
        *on_this_machine(),
        *Lasting('allocator', given['allocator']).start(),
        *Lasting('mavlink_bridge', given['mavlink_bridge'],
                 {'state_dir': argument(context, 'bridge_state_dir')},
                 sigterm_timeout=BRIDGE_END).start(),
        node('fleet_sim', given['fleet_sim']),
        node('scenario_player', given['scenario_player']),
        node('live_view', given['live_view'],
             {'record': record, 'stay': True}),
        *shown,
    ]
