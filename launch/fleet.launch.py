# SPDX-License-Identifier: Apache-2.0
"""Starts the allocator and the MAVLink bridge of a fleet, with a parameter file for each."""
from launch.actions import OpaqueFunction
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription
from uav_task_alloc.nodes.ros.launch_arguments import (
    BRIDGE_SIGTERM_TIMEOUT,
    TILE_ARGUMENTS,
    RespawnedNode,
    argument,
    declared,
    existing_file,
    flag,
    node_action,
    optional_number,
    parameter_file,
    record_file,
    refuse_unknown,
    rviz_action,
    tile_parameters,
)
from uav_task_alloc.params import PlayerParams
from uav_task_alloc.scenario import fleet_parameters, load

_CONFIG = FindPackageShare('uav_task_alloc')
ARGUMENTS = {
    'namespace': ('', 'Namespace of the fleet; empty: none.'),
    'allocator_params': ([_CONFIG, '/config/allocator.yaml'],
                         'Parameter file of the allocator.'),
    'bridge_params': ([_CONFIG, '/config/mavlink_bridge.yaml'],
                      'Parameter file of the MAVLink bridge.'),
    'scenario': ('', 'Scenario file (YAML), whose origin, route end, seed and vehicles override '
                 'both parameter files; empty: none.'),
    'terrain': ('', 'GeoTIFF of the ground, which legs keep clear of; empty: as in '
                'allocator_params.'),
    'speedup': ('', 'How many times faster than real time a simulated fleet flies, 0.1 to 100, '
                'for the live view; empty: measured by the clocks of the vehicles.'),
    'use_sim_time': ('false', 'true: all nodes live by /clock, which a simulator publishes.'),
    'rviz': ('false', 'true: start RViz, too.'),
    'record': ('', 'MCAP file to record all topics into, by a live view; it must not exist. '
               'Empty: none.'),
    **TILE_ARGUMENTS,
    'bridge_state_dir': ('', 'Folder in which the bridge stores across restarts which vehicles '
                         'it has authority over; empty: as in bridge_params.'),
}


def generate_launch_description() -> LaunchDescription:
    """The arguments, `--show-args` describes them, and the nodes."""
    return LaunchDescription([*declared(ARGUMENTS), OpaqueFunction(function=start)])


def start(context: object) -> list:
    """Both nodes, and the viewers that the arguments ask for.

    Raises:
        ValueError, ScenarioError: an argument is invalid; nothing has been started then.
    """
    refuse_unknown(__file__, ARGUMENTS)
    namespace, state_dir, path = (
        argument(context, name) for name in ('namespace', 'bridge_state_dir', 'scenario'))
    files = [parameter_file(context, name) for name in ('allocator_params', 'bridge_params')]
    parameters = fleet_parameters(load(path)) if path else {'allocator': {}, 'mavlink_bridge': {}}
    ground = existing_file(context, 'terrain')
    clock = {'use_sim_time': True} if flag(context, 'use_sim_time') else {}
    viewers = [rviz_action(context, namespace, bool(clock))] if flag(context, 'rviz') else []
    record, speedup = record_file(context), optional_number(context, 'speedup')
    if speedup is not None:
        speedup = PlayerParams(speedup=speedup).speedup
    tiles = tile_parameters(context)
    if record or tiles:
        viewers.insert(0, node_action('live_view', {
            'record': record, **tiles, **clock,
            **({'scenario': path, 'stay': True} if path else {}),
            **({} if speedup is None else {'speedup': speedup})}, namespace=namespace))
    return [
        *RespawnedNode('allocator', files[0], {
            **parameters['allocator'], **clock, **({'terrain': ground} if ground else {})},
                       namespace=namespace).start(),
        *RespawnedNode('mavlink_bridge', files[1], {**parameters['mavlink_bridge'], **clock},
                       {'state_dir': state_dir} if state_dir else {}, namespace=namespace,
                       sigterm_timeout=BRIDGE_SIGTERM_TIMEOUT).start(),
        *viewers,
    ]
