# SPDX-License-Identifier: Apache-2.0
"""What the launch files share: all arguments are checked before any node is started."""
from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, List  # noqa: UP035 - launch compares with typing's

from launch.actions import (
    DeclareLaunchArgument,
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

from uav_task_alloc.live.tiles import tile_source
from uav_task_alloc.nodes.ros.parameter_files import ParameterFileError, read_sections
from uav_task_alloc.nodes.ros.restart_policy import RestartPolicy, RestartVerdict
from uav_task_alloc.scenario.node_parameters import Value

_PACKAGE = 'uav_task_alloc'
ArgumentTable = Mapping[str, tuple[Any, str]]  # default and description, by name
TILE_ARGUMENTS = {
    'tiles': ('', 'Map tiles under the fleet on the page of a live view, which starts with them: '
              'a folder with {z}/{x}/{y}.png in it, or a URL with {z}, {x} and {y}; empty: '
              'none.'),
    'tiles_attribution': ('', 'Text that the provider of the tiles wants shown.'),
}
# [s] from SIGINT to SIGTERM; the bridge completes a running upload first
BRIDGE_SIGTERM_TIMEOUT = '15'


def declared(table: ArgumentTable) -> list[DeclareLaunchArgument]:
    """The arguments of a launch file, with the texts that `--show-args` prints."""
    return [DeclareLaunchArgument(name, default_value=default, description=text)
            for name, (default, text) in table.items()]


def refuse_unknown(path: str, table: ArgumentTable, argv: Sequence[str] = ()) -> None:
    """Refuse an argument of the command line that a launch file does not have.

    `ros2 launch` ignores it, and a fleet would fly with a default instead.

    Args:
        path: of the launch file; one that another file includes is not checked.
        table: its arguments.
        argv: the command line; empty: of this process.

    Raises:
        ValueError: there is one; the text names the nearest that exists.
    """
    words = argv or sys.argv
    if not any(Path(word).name == Path(path).name for word in words):
        return
    for word in words:
        name, assigned, _ = word.partition(':=')
        if assigned and name not in table:
            raise ValueError(f'{word}: expected an argument that --show-args lists; nearest is '
                             f'{get_close_matches(name, table, 1, 0.0)[0]!r}')


def argument(context: Any, name: str) -> str:
    """The text of a launch argument."""
    return str(LaunchConfiguration(name).perform(context)).strip()


def flag(context: Any, name: str) -> bool:
    """A launch argument that is true or false; ValueError otherwise."""
    text = argument(context, name).lower()
    if text not in ('true', '1', 'false', '0'):
        raise ValueError(f'{name}:={text}: expected true or false')
    return text in ('true', '1')


def optional_number(context: Any, name: str) -> float | None:
    """A launch argument that is a number, None where it is empty; ValueError otherwise."""
    text = argument(context, name)
    try:
        return float(text) if text else None
    except ValueError:
        raise ValueError(f'{name}:={text}: expected a number') from None


def node_action(executable: str, *parameters: str | Mapping[str, Value], **options: Any) -> Node:
    """The launch action of one of this package's executables.

    Args:
        executable: its name.
        parameters: files or values; of several values for a name the last one counts.
        options: further arguments of launch_ros.actions.Node.
    """
    return Node(package=_PACKAGE, executable=executable, output='screen',
                parameters=[each if isinstance(each, str) else typed(each)
                            for each in parameters if each], **options)


class RespawnedNode:
    """A node that is restarted with the same parameters after it has exited.

    Args:
        executable, parameters, options: as of `node_action`.
    """

    def __init__(self, executable: str, *parameters: str | Mapping[str, Value],
                 **options: Any) -> None:
        self.executable, self.parameters, self.options = executable, parameters, options
        self.policy, self.started_at = RestartPolicy(), 0.0

    def start(self, _: Any = None) -> list[Node]:
        """The action of one run."""
        self.started_at = time.monotonic()
        return [node_action(self.executable, *self.parameters, on_exit=self.on_exit,
                            **self.options)]

    def on_exit(self, event: Any, context: Any) -> list[Any]:
        """The actions after a run, unless launch shuts down."""
        if context.is_shutdown:
            return []
        name, status = self.executable, event.returncode
        verdict = self.policy.on_exit(status, time.monotonic() - self.started_at)
        if verdict is RestartVerdict.END_ALL:
            return [Shutdown(reason=f'{name} refuses its parameters, see its error above')]
        if verdict is RestartVerdict.GIVE_UP:
            return [LogInfo(msg=f'{name} refuses to start, see its error above: not restarted; '
                            'the other nodes go on')]
        delay = self.policy.delay
        return [LogInfo(msg=f'{name} has exited with status {status}: restarted in {delay:g} s'),
                TimerAction(period=delay, actions=[OpaqueFunction(function=self.start)])]


def typed(values: Mapping[str, Value]) -> dict[str, ParameterValue]:
    """Values with their types, which launch would otherwise guess from their texts."""
    return {name: ParameterValue(value, value_type=_type_of(value))
            for name, value in values.items()}


def _type_of(value: Value) -> Any:
    if not isinstance(value, list):
        return type(value)
    item: Any = type(value[0])
    return List[item]  # noqa: UP006


def parameter_file(context: Any, name: str) -> str:
    """A launch argument that names a parameter file; ValueError otherwise."""
    path = argument(context, name)
    try:
        read_sections(path)
    except ParameterFileError as error:
        raise ValueError(f'{name}:={error.text}') from None
    return path


def existing_file(context: Any, name: str) -> str:
    """The absolute path of a launch argument, '' where it is empty; ValueError for no file."""
    text = argument(context, name)
    if text and not Path(text).is_file():
        raise ValueError(f'{name}:={text}: expected a file')
    return str(Path(text).resolve()) if text else ''


def record_file(context: Any) -> str:
    """The launch argument `record`; ValueError where that file cannot be created."""
    path = argument(context, 'record')
    if path and (Path(path).exists() or not Path(path).absolute().parent.is_dir()):
        raise ValueError(f'record:={path}: expected a file that does not exist, in a folder that '
                         'does')
    return path


def tile_parameters(context: Any) -> dict[str, Value]:
    """The arguments of TILE_ARGUMENTS as parameters of the live view.

    Returns:
        Nothing where `tiles` is empty.

    Raises:
        InvalidValue: they name no tiles.
    """
    found = {name: argument(context, name) for name in TILE_ARGUMENTS}
    return {**found} if tile_source(found['tiles'], found['tiles_attribution']) else {}


def rviz_action(context: Any, namespace: str = '',
                simulated: bool = False) -> IncludeLaunchDescription:
    """launch/rviz.launch.py for a fleet; ValueError where RViz is not installed."""
    for package, executable in (('rviz2', 'rviz2'), ('tf2_ros', 'static_transform_publisher')):
        try:
            ExecutableInPackage(executable=executable, package=package).perform(context)
        except Exception as error:  # launch and ament raise different ones
            raise ValueError(f'rviz:=true: expected {package} to be installed: {error}') from None
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution(
            [FindPackageShare(_PACKAGE), 'launch', 'rviz.launch.py'])),
        launch_arguments={'namespace': namespace,
                          'use_sim_time': str(simulated).lower()}.items())


def localhost_only() -> list[SetEnvironmentVariable]:
    """Keep simulated UAVs off the network, unless a discovery range is set already."""
    name = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
    return [] if os.environ.get(name) else [SetEnvironmentVariable(name, 'LOCALHOST')]
