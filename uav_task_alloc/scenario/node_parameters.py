# SPDX-License-Identifier: Apache-2.0
"""The parameters that a scenario gives to each node: the one place, for demo and launch files."""
from __future__ import annotations

from pathlib import Path

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.params import MAX_RANGE, BridgeParams, PlayerParams
from uav_task_alloc.scenario.values import Scenario, ScenarioUav

Value = bool | int | float | str | list[str] | list[int]
Parameters = dict[str, Value]  # by ROS name; lists are never empty, which would have no type

UAV_TIMEOUT = 2.0  # [s] of the machine, in which a sped up UAV flies far
SEEDS = 2**31  # that a parameter can hold; a scenario may have greater ones


def fleet_parameters(played: Scenario) -> dict[str, Parameters]:
    """What allocator and bridge take from a scenario, whoever flies it.

    Raises:
        InvalidValue: the bridge cannot have UAVs of these names.
    """
    origin: Parameters = {'origin.latitude': played.origin.latitude,
                          'origin.longitude': played.origin.longitude,
                          'origin.altitude_amsl': played.origin.altitude_amsl}
    capable = [f'{uav.id}:{_words(uav)}' for uav in played.uavs if uav.capabilities]
    return {
        'allocator': {**origin, 'route_end': played.route_end, 'seed': played.seed % SEEDS,
                      'clearance': played.clearance, 'altitude_min': played.altitude_min,
                      'altitude_max': played.altitude_max,
                      'default_range': min(map(_range, played.uavs))},
        'mavlink_bridge': {**origin,
                           'full_ranges': [f'{uav.id}:{_range(uav)}' for uav in played.uavs],
                           'system_ids': [uav.system_id for uav in played.uavs],
                           'uav_id_pattern': id_pattern(played),
                           **({'capabilities': capable} if capable else {})}}


def simulation_parameters(played: Scenario, path: str | Path, port: int,
                          speedup: float | None = None) -> dict[str, Parameters]:
    """What all nodes take from a scenario that a simulated fleet flies on this machine.

    Args:
        path: the file of the scenario.
        port: UDP port on loopback that is free.
        speedup: None: the scenario's.

    Returns:
        Parameters of each node of `params.NODES`.

    Raises:
        InvalidValue: the bridge cannot have UAVs of these names, or no such speed-up.
    """
    fleet = fleet_parameters(played)
    flown: Parameters = {'scenario': str(path), 'speedup': PlayerParams(
        speedup=played.speedup if speedup is None else speedup).speedup}
    return {
        'allocator': {**fleet['allocator'], 'uav_timeout': UAV_TIMEOUT},
        'mavlink_bridge': {**fleet['mavlink_bridge'], 'connections': [f'udpin:127.0.0.1:{port}'],
                           'takeoff': True, 'relaunch': 'automatic'},
        'fleet_sim': {**flown, 'target': f'127.0.0.1:{port}'},
        'scenario_player': {**flown, 'wait_for_plan': True},
        'live_view': {**flown}}


def id_pattern(played: Scenario) -> str:
    """The bridge's `uav_id_pattern` that makes these ids of these system ids.

    Raises:
        InvalidValue: no pattern does.
    """
    common = set.intersection(*(_patterns(uav) for uav in played.uavs))
    if not common:
        default = BridgeParams.uav_id_pattern
        wrong = next((uav for uav in played.uavs if default not in _patterns(uav)),
                     played.uavs[0])
        raise InvalidValue(
            f'scenario {played.name}: id of system_id {wrong.system_id}', wrong.id,
            f'ids that one pattern makes of system ids, {default.format(sysid=wrong.system_id)!r} '
            'say: the bridge names UAVs by it')
    return max(sorted(common), key=lambda pattern: pattern == BridgeParams.uav_id_pattern)


def _patterns(uav: ScenarioUav) -> set[str]:
    """All patterns that make the id of this UAV."""
    number = str(uav.system_id)
    return {uav.id[:at] + '{sysid}' + uav.id[at + len(number):]
            for at in range(len(uav.id)) if uav.id.startswith(number, at)}


def _range(uav: ScenarioUav) -> float:
    """What it can fly with a full battery [m], as a parameter can hold it."""
    return min(uav.range, MAX_RANGE)


def _words(uav: ScenarioUav) -> str:
    for word in uav.capabilities:
        if ',' in word:
            raise InvalidValue(f'capabilities of {uav.id}', word, 'words without a comma')
    return ','.join(sorted(uav.capabilities))
