# SPDX-License-Identifier: Apache-2.0
"""The allocator and the MAVLink bridge of a fleet, with one file of parameters for each."""
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import (
    EqualsSubstitution,
    LaunchConfiguration,
    NotEqualsSubstitution,
    PathJoinSubstitution,
)
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Arguments: namespace, allocator_params, bridge_params, rviz (true: show it there too),
    record (an MCAP file for all topics; a live view records it), bridge_state_dir (a folder that
    keeps over a restart of the bridge who has each aircraft; empty: as bridge_params says).
    """
    share = FindPackageShare('uav_task_alloc')
    config = [share, 'config']
    namespace, record = LaunchConfiguration('namespace'), LaunchConfiguration('record')
    state_dir = LaunchConfiguration('bridge_state_dir')

    def bridge(condition: IfCondition, *more: dict[str, object]) -> Node:
        # started again at once: the vehicles fly on meanwhile
        return Node(package='uav_task_alloc', executable='mavlink_bridge', namespace=namespace,
                    output='screen', respawn=True, condition=condition,
                    parameters=[LaunchConfiguration('bridge_params'), *more])

    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value=''),
        DeclareLaunchArgument('allocator_params',
                              default_value=PathJoinSubstitution([*config, 'allocator.yaml'])),
        DeclareLaunchArgument('bridge_params', default_value=PathJoinSubstitution(
            [*config, 'mavlink_bridge.yaml'])),
        DeclareLaunchArgument('rviz', default_value='false'),
        DeclareLaunchArgument('record', default_value=''),
        Node(package='uav_task_alloc', executable='allocator', namespace=namespace,
             output='screen', parameters=[LaunchConfiguration('allocator_params')]),
        DeclareLaunchArgument('bridge_state_dir', default_value=''),
        bridge(IfCondition(EqualsSubstitution(state_dir, ''))),
        bridge(IfCondition(NotEqualsSubstitution(state_dir, '')),
               {'state_dir': ParameterValue(state_dir, value_type=str)}),
        Node(package='uav_task_alloc', executable='live_view', namespace=namespace,
             output='screen', parameters=[{'record': ParameterValue(record, value_type=str)}],
             condition=IfCondition(NotEqualsSubstitution(record, ''))),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(
                PathJoinSubstitution([share, 'launch', 'rviz.launch.py'])),
            launch_arguments={'namespace': namespace}.items(),
            condition=IfCondition(LaunchConfiguration('rviz'))),
    ])
