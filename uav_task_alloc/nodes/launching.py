# SPDX-License-Identifier: Apache-2.0
"""What the launch files share: arguments are resolved in full before any node is started."""
from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, List  # noqa: UP035 - launch compares with typing's

from launch.actions import IncludeLaunchDescription, SetEnvironmentVariable
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from uav_task_alloc.scenario.node_parameters import Value

PACKAGE = 'uav_task_alloc'


def argument(context: Any, name: str) -> str:
    """A launch argument as it was given."""
    return str(LaunchConfiguration(name).perform(context)).strip()


def flag(context: Any, name: str) -> bool:
    """A launch argument that is true or false; ValueError otherwise."""
    given = argument(context, name).lower()
    if given not in ('true', '1', 'false', '0'):
        raise ValueError(f'{name}:={given}: expected true or false')
    return given in ('true', '1')


def number(context: Any, name: str) -> float | None:
    """A launch argument that is a number, None where it is empty; ValueError otherwise."""
    given = argument(context, name)
    try:
        return float(given) if given else None
    except ValueError:
        raise ValueError(f'{name}:={given}: expected a number') from None


def node(executable: str, *parameters: str | Mapping[str, Value], **more: Any) -> Node:
    """One of this package's executables; parameters are files or values, the last one counts."""
    return Node(package=PACKAGE, executable=executable, output='screen',
                parameters=[each if isinstance(each, str) else typed(each)
                            for each in parameters if each], **more)


def typed(values: Mapping[str, Value]) -> dict[str, ParameterValue]:
    """Values with their types, which launch would else guess from their texts."""
    return {name: ParameterValue(value, value_type=_type_of(value))
            for name, value in values.items()}


def _type_of(value: Value) -> Any:
    return List[type(value[0])] if isinstance(value, list) else type(value)  # noqa: UP006


def rviz(namespace: str = '') -> IncludeLaunchDescription:
    """launch/rviz.launch.py."""
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution(
            [FindPackageShare(PACKAGE), 'launch', 'rviz.launch.py'])),
        launch_arguments={'namespace': namespace}.items())


def on_this_machine() -> list[SetEnvironmentVariable]:
    """Keep simulated UAVs out of the network, unless a range of discovery is set already."""
    name = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
    return [] if os.environ.get(name) else [SetEnvironmentVariable(name, 'LOCALHOST')]
