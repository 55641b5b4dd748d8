# SPDX-License-Identifier: Apache-2.0
"""A scenario in the air: allocator, bridge, simulated fleet, player and live view."""
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Arguments: scenario (a YAML file), speedup, rviz (true: show it there too), record
    (an MCAP file for all topics), bridge_state_dir (a folder that keeps over a restart who has
    each aircraft; empty: nothing is kept).
    """
    share = FindPackageShare('uav_task_alloc')
    scenario = LaunchConfiguration('scenario')
    played = {'scenario': scenario,
              'speedup': ParameterValue(LaunchConfiguration('speedup'), value_type=float)}

    def node(name: str, respawn: bool = False, **parameters: object) -> Node:
        return Node(package='uav_task_alloc', executable=name, output='screen', respawn=respawn,
                    parameters=[parameters] if parameters else [])

    return LaunchDescription([
        DeclareLaunchArgument('scenario', default_value=PathJoinSubstitution(
            [share, 'config', 'scenarios', 'demo.yaml'])),
        DeclareLaunchArgument('speedup', default_value='8.0'),
        DeclareLaunchArgument('rviz', default_value='false'),
        DeclareLaunchArgument('record', default_value=''),
        node('allocator'),
        DeclareLaunchArgument('bridge_state_dir', default_value=''),
        node('mavlink_bridge', respawn=True, takeoff=True, relaunch='automatic',
             state_dir=ParameterValue(LaunchConfiguration('bridge_state_dir'), value_type=str)),
        node('fleet_sim', **played),
        node('scenario_player', **played),
        node('live_view', record=ParameterValue(LaunchConfiguration('record'), value_type=str)),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(
                PathJoinSubstitution([share, 'launch', 'rviz.launch.py'])),
            condition=IfCondition(LaunchConfiguration('rviz'))),
    ])
