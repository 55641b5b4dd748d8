# SPDX-License-Identifier: Apache-2.0
"""The allocator and the MAVLink bridge of a fleet, with one file of parameters for each."""
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Arguments: namespace, allocator_params, bridge_params."""
    config = [FindPackageShare('uav_task_alloc'), 'config']
    namespace = LaunchConfiguration('namespace')
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value=''),
        DeclareLaunchArgument('allocator_params',
                              default_value=PathJoinSubstitution([*config, 'allocator.yaml'])),
        DeclareLaunchArgument('bridge_params', default_value=PathJoinSubstitution(
            [*config, 'mavlink_bridge.yaml'])),
        Node(package='uav_task_alloc', executable='allocator', namespace=namespace,
             output='screen', parameters=[LaunchConfiguration('allocator_params')]),
        Node(package='uav_task_alloc', executable='mavlink_bridge', namespace=namespace,
             output='screen', parameters=[LaunchConfiguration('bridge_params')]),
    ])
