# SPDX-License-Identifier: Apache-2.0
"""Starts RViz with the markers and paths of a fleet; needs the packages rviz2 and tf2_ros."""
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription

_TOPICS = ['allocation_markers', *(f'uav_{k}/path' for k in range(1, 5))]


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start RViz.

    Arguments:
        namespace: of the fleet.
        rviz_config: file of RViz.
    """
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value=''),
        DeclareLaunchArgument('rviz_config', default_value=PathJoinSubstitution(
            [FindPackageShare('uav_task_alloc'), 'config', 'allocation.rviz'])),
        Node(package='rviz2', executable='rviz2', namespace=LaunchConfiguration('namespace'),
             arguments=['-d', LaunchConfiguration('rviz_config')],
             # the configuration has absolute topic names; these are in the namespace
             remappings=[(f'/{topic}', topic) for topic in _TOPICS]),
        # RViz shows no Path whose frame is in no transform
        Node(package='tf2_ros', executable='static_transform_publisher',
             arguments=['--frame-id', 'map', '--child-frame-id', 'fleet_origin']),
    ])
