# SPDX-License-Identifier: Apache-2.0
"""The parameters of each node that follow from a scenario, for the demo and launch files."""
from __future__ import annotations

import math
from pathlib import Path

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import to_geodetic_batch
from uav_task_alloc.objective import Objective
from uav_task_alloc.params import MAX_RANGE, BridgeParams, PlayerParams
from uav_task_alloc.scenario.schema import SEPARATION
from uav_task_alloc.scenario.values import Scenario, ScenarioUav

Value = bool | int | float | str | list[str] | list[int] | list[float]
Parameters = dict[str, Value]  # by ROS name; lists are never empty, which would have no type

UAV_TIMEOUT = 2.0  # [s] of wall time, short as simulated UAVs fly faster than real time
SEEDS = 2**31  # a parameter holds smaller ones only, a scenario also greater ones


def fleet_parameters(played: Scenario) -> dict[str, Parameters]:
    """The parameters of allocator and bridge for any fleet of a scenario.

    Args:
        played: the scenario.

    Returns:
        Parameters by node.

    Raises:
        InvalidValue: no `uav_id_pattern` of the bridge gives these ids.
    """
    origin: Parameters = {'origin.latitude': played.origin.latitude,
                          'origin.longitude': played.origin.longitude,
                          'origin.altitude_amsl': played.origin.altitude_amsl}
    area: Parameters = {'fence_area': [
        '{:.9f},{:.9f}'.format(*place[:2]) for place in to_geodetic_batch(
            played.origin, [(x, y, 0.0) for x, y in played.fence_area]).tolist()]
    } if played.fence_area else {}
    capable = [f'{uav.id}:{_capabilities(uav)}' for uav in played.uavs if uav.capabilities]
    return {
        'allocator': {**origin, **area, 'route_end': played.route_end, 'seed': played.seed % SEEDS,
                      'clearance': played.clearance, 'altitude_min': played.altitude_min,
                      'altitude_max': played.altitude_max,
                      'default_range': min(map(_range, played.uavs)),
                      'trips': played.trips, **_objective(played), **_separation(played)},
        'mavlink_bridge': {**origin, **area,
                           'full_ranges': [f'{uav.id}:{_range(uav)}' for uav in played.uavs],
                           'system_ids': [uav.system_id for uav in played.uavs],
                           'uav_id_pattern': id_pattern(played),
                           'uav_limits': [f'{uav.id}:{_limits(uav)}' for uav in played.uavs],
                           **({'capabilities': capable} if capable else {})}}


def simulation_parameters(played: Scenario, path: str | Path, port: int,
                          speedup: float | None = None) -> dict[str, Parameters]:
    """The parameters of all nodes for a simulated fleet on this machine.

    Args:
        played: the scenario.
        path: the file of the scenario.
        port: UDP port on loopback that is free.
        speedup: factor on real time; None: that of the scenario.

    Returns:
        Parameters of each node of `params.NODES`.

    Raises:
        InvalidValue: no `uav_id_pattern` gives these ids, or the speedup is out of range.
    """
    fleet = fleet_parameters(played)
    flown: Parameters = {'scenario': str(path), 'speedup': PlayerParams(
        speedup=played.speedup if speedup is None else speedup).speedup}
    simulated: Parameters = {'use_sim_time': True}  # /clock is that of fleet_sim
    return {
        'allocator': {**fleet['allocator'], **simulated, 'uav_timeout': UAV_TIMEOUT},
        'mavlink_bridge': {**fleet['mavlink_bridge'], **simulated,
                           'connections': [f'udpin:127.0.0.1:{port}'],
                           'takeoff': True, 'relaunch': 'automatic'},
        'fleet_sim': {**flown, 'target': f'127.0.0.1:{port}'},
        'scenario_player': {**flown, **simulated, 'wait_for_plan': True},
        'live_view': {**flown, **simulated}}


def id_pattern(played: Scenario) -> str:
    """The `uav_id_pattern` of the bridge that gives all ids from their system ids.

    Raises:
        InvalidValue: there is none.
    """
    common = set.intersection(*(_patterns(uav) for uav in played.uavs))
    if not common:
        default = BridgeParams.uav_id_pattern
        mismatch = next((uav for uav in played.uavs if default not in _patterns(uav)),
                     played.uavs[0])
        raise InvalidValue(
            f'scenario {played.name}: id of system_id {mismatch.system_id}', mismatch.id,
            'ids that one uav_id_pattern gives for all system ids, such as '
            f'{default.format(sysid=mismatch.system_id)!r}')
    return max(sorted(common), key=lambda pattern: pattern == BridgeParams.uav_id_pattern)


def _patterns(uav: ScenarioUav) -> set[str]:
    """All patterns that give the id of this UAV from its system id."""
    number = str(uav.system_id)
    return {uav.id[:at] + '{sysid}' + uav.id[at + len(number):]
            for at in range(len(uav.id)) if uav.id.startswith(number, at)}


def _range(uav: ScenarioUav) -> float:
    """The range with a full battery [m], at most what the parameter allows."""
    return min(uav.most_range, MAX_RANGE)


def _limits(uav: ScenarioUav) -> str:
    """The limits that are not the defaults of the scenario, as `NAME=NUMBER,...`."""
    known = {'cruise_speed': uav.cruise_speed, 'climb_speed': uav.climb_speed,
             'descent_speed': uav.descent_speed, 'endurance': uav.most_endurance,
             'turnaround': uav.turnaround, 'payload_capacity': uav.payload_capacity}
    return ','.join(f'{name}={value!r}' for name, value in known.items()
                    if 0.0 < value < math.inf)


def _objective(played: Scenario) -> Parameters:
    """That of the scenario; nothing where it has none."""
    if isinstance(played.objective, Objective):
        return {'objective_weights': played.objective.coefficients.tolist()}
    return {} if played.objective is None else {'objective': played.objective}


def _separation(played: Scenario) -> Parameters:
    """How UAVs are kept apart; nothing where the scenario does not say."""
    rule = played.separation
    return {f'separation.{name}': float(getattr(rule, name)) for name in SEPARATION
            } if rule.on else {}


def _capabilities(uav: ScenarioUav) -> str:
    for word in uav.capabilities:
        if ',' in word:
            raise InvalidValue(f'capabilities of {uav.id}', word, 'words without a comma')
    return ','.join(sorted(uav.capabilities))
