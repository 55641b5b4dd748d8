# SPDX-License-Identifier: Apache-2.0
"""Starts the allocator and the MAVLink bridge of a fleet, with a parameter file for each."""
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription
from uav_task_alloc.nodes.ros.launch_arguments import (
    BRIDGE_SIGTERM_TIMEOUT,
    RespawnedNode,
    argument,
    flag,
    node_action,
    parameter_file,
    record_file,
    rviz_action,
)
from uav_task_alloc.scenario import fleet_parameters, load


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments.

    Arguments:
        namespace: of the fleet.
        allocator_params, bridge_params: parameter files.
        scenario: YAML file; its origin, route end, seed and vehicles override both files.
        rviz: true: start RViz as well.
        record: MCAP file for all topics, written by a live view; empty: none.
        bridge_state_dir: folder in which the bridge saves which vehicles it has authority over,
            for a restart; empty: as in bridge_params.
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
    """Both nodes, and the viewers that the arguments ask for.

    Raises:
        ValueError, ScenarioError: an argument is invalid; nothing has been started then.
    """
    namespace, state_dir, path = (
        argument(context, name) for name in ('namespace', 'bridge_state_dir', 'scenario'))
    files = [parameter_file(context, name) for name in ('allocator_params', 'bridge_params')]
    parameters = fleet_parameters(load(path)) if path else {'allocator': {}, 'mavlink_bridge': {}}
    viewers = [rviz_action(context, namespace)] if flag(context, 'rviz') else []
    record = record_file(context)
    if record:
        viewers.insert(0, node_action('live_view', {'record': record, **(
            {'scenario': path, 'stay': True} if path else {})}, namespace=namespace))
    return [
        *RespawnedNode('allocator', files[0], parameters['allocator'],
                       namespace=namespace).start(),
        *RespawnedNode('mavlink_bridge', files[1], parameters['mavlink_bridge'],
                       {'state_dir': state_dir} if state_dir else {}, namespace=namespace,
                       sigterm_timeout=BRIDGE_SIGTERM_TIMEOUT).start(),
        *viewers,
    ]
