# SPDX-License-Identifier: Apache-2.0
"""What the launch files share: arguments are resolved in full before any node is started."""
from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, List  # noqa: UP035 - launch compares with typing's

import yaml
from launch.actions import (
    IncludeLaunchDescription,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
    TimerAction,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare

from uav_task_alloc.nodes.ros.restart_policy import RestartPolicy, RestartVerdict
from uav_task_alloc.scenario.node_parameters import Value

_PACKAGE = 'uav_task_alloc'
BRIDGE_END = '15'  # [s] from Ctrl-C to SIGTERM, as the bridge ends after a swap under way


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
    return Node(package=_PACKAGE, executable=executable, output='screen',
                parameters=[each if isinstance(each, str) else typed(each)
                            for each in parameters if each], **more)


class Lasting:
    """A node that is started again when it dies; in a fresh life it has the same parameters."""

    def __init__(self, executable: str, *parameters: str | Mapping[str, Value],
                 **more: Any) -> None:
        self.executable, self.parameters, self.more = executable, parameters, more
        self.restarts, self.began = RestartPolicy(), 0.0

    def start(self, _: Any = None) -> list[Node]:
        """The action of one life."""
        self.began = time.monotonic()
        return [node(self.executable, *self.parameters, on_exit=self.died, **self.more)]

    def died(self, event: Any, context: Any) -> list[Any]:
        """What follows on its end."""
        if context.is_shutdown:
            return []
        verdict = self.restarts.died(event.returncode, time.monotonic() - self.began)
        name, status = self.executable, event.returncode
        if verdict is RestartVerdict.END_ALL:
            return [Shutdown(reason=f'{name} refuses what it is given, as it says above')]
        if verdict is RestartVerdict.GIVE_UP:
            return [LogInfo(msg=f'{name} refuses to start, as it says above: not tried again; '
                            'the others go on')]
        delay = self.restarts.delay
        return [LogInfo(msg=f'{name} has ended with status {status}: again in {delay:g} s'),
                TimerAction(period=delay, actions=[OpaqueFunction(function=self.start)])]


def typed(values: Mapping[str, Value]) -> dict[str, ParameterValue]:
    """Values with their types, which launch would else guess from their texts."""
    return {name: ParameterValue(value, value_type=_type_of(value))
            for name, value in values.items()}


def _type_of(value: Value) -> Any:
    return List[type(value[0])] if isinstance(value, list) else type(value)  # noqa: UP006


def parameter_file(context: Any, name: str) -> str:
    """A launch argument that names a parameter file; ValueError where it is none."""
    given = argument(context, name)
    try:
        content = yaml.safe_load(Path(given).read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ValueError(f'{name}:={given}: expected a parameter file: {error}') from None
    if not isinstance(content, dict):
        raise ValueError(f'{name}:={given}: expected a parameter file with `ros__parameters`')
    return given


def record_file(context: Any) -> str:
    """The argument `record`; ValueError where that file cannot be begun."""
    given = argument(context, 'record')
    if given and (Path(given).exists() or not Path(given).absolute().parent.is_dir()):
        raise ValueError(f'record:={given}: expected a file that is not there yet, in a folder '
                         'that is')
    return given


def rviz(context: Any, namespace: str = '') -> IncludeLaunchDescription:
    """launch/rviz.launch.py; ValueError where RViz is not installed."""
    for package, executable in (('rviz2', 'rviz2'), ('tf2_ros', 'static_transform_publisher')):
        try:
            ExecutableInPackage(executable=executable, package=package).perform(context)
        except Exception as error:  # of a package or of a program, and of two libraries
            raise ValueError(f'rviz:=true: expected {package} to be installed: {error}') from None
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution(
            [FindPackageShare(_PACKAGE), 'launch', 'rviz.launch.py'])),
        launch_arguments={'namespace': namespace}.items())


def on_this_machine() -> list[SetEnvironmentVariable]:
    """Keep simulated UAVs out of the network, unless a range of discovery is set already."""
    name = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
    return [] if os.environ.get(name) else [SetEnvironmentVariable(name, 'LOCALHOST')]
