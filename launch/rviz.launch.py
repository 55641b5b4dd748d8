# SPDX-License-Identifier: Apache-2.0
"""RViz with the picture of a fleet: markers and paths; needs the packages rviz2 and tf2_ros."""
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription

FLEET = ['allocation_markers', *(f'uav_{k}/path' for k in range(1, 5))]


def generate_launch_description() -> LaunchDescription:
    """Arguments: namespace (of the fleet), rviz_config."""
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value=''),
        DeclareLaunchArgument('rviz_config', default_value=PathJoinSubstitution(
            [FindPackageShare('uav_task_alloc'), 'config', 'allocation.rviz'])),
        Node(package='rviz2', executable='rviz2', namespace=LaunchConfiguration('namespace'),
             arguments=['-d', LaunchConfiguration('rviz_config')],
             # the file names topics from the root; here they belong to the fleet
             remappings=[(f'/{topic}', topic) for topic in FLEET]),
        # RViz shows no Path in a frame that no transform names
        Node(package='tf2_ros', executable='static_transform_publisher',
             arguments=['--frame-id', 'map', '--child-frame-id', 'fleet_origin']),
    ])
