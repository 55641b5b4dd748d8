# SPDX-License-Identifier: Apache-2.0
"""The allocator and the MAVLink bridge of a fleet, with one file of parameters for each."""
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
    parameter_file,
    record_file,
    rviz,
)
from uav_task_alloc.scenario import fleet_parameters, load


def generate_launch_description() -> LaunchDescription:
    """Arguments: namespace, allocator_params, bridge_params, scenario (a YAML file: its origin,
    route end, seed and vehicles count more than these two), rviz (true: show it there too),
    record (an MCAP file for all topics; a live view records it), bridge_state_dir (a folder that
    keeps over a restart of the bridge who has each aircraft; empty: as bridge_params says).
    """
    config = [FindPackageShare('uav_task_alloc'), 'config']
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value=''),
        DeclareLaunchArgument('allocator_params',
                              default_value=PathJoinSubstitution([*config, 'allocator.yaml'])),
        DeclareLaunchArgument('bridge_params', default_value=PathJoinSubstitution(
            [*config, 'mavlink_bridge.yaml'])),
        DeclareLaunchArgument('scenario', default_value=''),
        DeclareLaunchArgument('rviz', default_value='false'),
        DeclareLaunchArgument('record', default_value=''),
        DeclareLaunchArgument('bridge_state_dir', default_value=''),
        OpaqueFunction(function=start),
    ])


def start(context: object) -> list:
    """Both nodes, and what was asked for to look at them.

    Whatever is wrong with an argument is raised before anything is started.
    """
    namespace, state_dir, path = (
        argument(context, name) for name in ('namespace', 'bridge_state_dir', 'scenario'))
    files = [parameter_file(context, name) for name in ('allocator_params', 'bridge_params')]
    given = fleet_parameters(load(path)) if path else {'allocator': {}, 'mavlink_bridge': {}}
    shown = [rviz(context, namespace)] if flag(context, 'rviz') else []
    record = record_file(context)
    if record:
        shown.insert(0, node('live_view', {'record': record, **(
            {'scenario': path, 'stay': True} if path else {})}, namespace=namespace))
    return [
        *Lasting('allocator', files[0], given['allocator'], namespace=namespace).start(),
        *Lasting('mavlink_bridge', files[1], given['mavlink_bridge'],
                 {'state_dir': state_dir} if state_dir else {}, namespace=namespace,
                 sigterm_timeout=BRIDGE_END).start(),
        *shown,
    ]
