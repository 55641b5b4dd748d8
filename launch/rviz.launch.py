# SPDX-License-Identifier: Apache-2.0
"""Starts RViz with the markers and paths of a fleet; needs the packages rviz2 and tf2_ros."""
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription
from uav_task_alloc.nodes.ros.launch_arguments import declared, refuse_unknown

_TOPICS = ['allocation_markers', 'fence_area', *(f'uav_{k}/path' for k in range(1, 5))]


ARGUMENTS = {
    'namespace': ('', 'Namespace of the fleet; empty: none.'),
    'use_sim_time': ('false', 'true: RViz lives by /clock.'),
    'rviz_config': ([FindPackageShare('uav_task_alloc'), '/config/allocation.rviz'],
                    'Configuration file of RViz.'),
}


def generate_launch_description() -> LaunchDescription:
    """The arguments, `--show-args` describes them, and RViz."""
    refuse_unknown(__file__, ARGUMENTS)
    return LaunchDescription([
        *declared(ARGUMENTS),
        Node(package='rviz2', executable='rviz2', namespace=LaunchConfiguration('namespace'),
             parameters=[{'use_sim_time': ParameterValue(
                 LaunchConfiguration('use_sim_time'), value_type=bool)}],
             arguments=['-d', LaunchConfiguration('rviz_config')],
             # the configuration has absolute topic names; these are in the namespace
             remappings=[(f'/{topic}', topic) for topic in _TOPICS]),
        # RViz shows no Path whose frame is in no transform
        Node(package='tf2_ros', executable='static_transform_publisher',
             arguments=['--frame-id', 'map', '--child-frame-id', 'fleet_origin']),
    ])
