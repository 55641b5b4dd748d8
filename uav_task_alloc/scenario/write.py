# SPDX-License-Identifier: Apache-2.0
"""Writer of scenario files: the text reads back as the same scenario."""
from __future__ import annotations

import math
from dataclasses import asdict, fields
from typing import Any

import yaml

from uav_task_alloc.model import Task
from uav_task_alloc.scenario.schema import SEPARATION
from uav_task_alloc.scenario.values import (
    TASK_TIMES,
    UAV_LIMITS,
    Scenario,
    ScenarioUav,
    TimedTask,
    TimedZone,
)
from uav_task_alloc.scenario.work_schema import WORK_KEYS
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.zone_codec import SCENARIO_ZONE, encode_zone


def to_yaml(scenario: Scenario) -> str:
    """Write a scenario as the text of a file.

    Args:
        scenario: with the random arrivals drawn.

    Returns:
        YAML, which `parse` reads; arrivals are written as the tasks drawn.
    """
    document = {
        'name': scenario.name,
        'seed': scenario.seed,
        'origin': asdict(scenario.origin),
        'route_end': scenario.route_end,
        'speedup': scenario.speedup,
        'clearance': scenario.clearance,
        'altitude_min': scenario.altitude_min,
        'altitude_max': scenario.altitude_max,
        **({} if scenario.objective is None else {
            'objective': scenario.objective if isinstance(scenario.objective, str)
            else asdict(scenario.objective)}),
        'trips': scenario.trips,
        **({'fence_area': [list(corner) for corner in scenario.fence_area]}
           if scenario.fence_area else {}),
        'wind': asdict(scenario.wind),
        **({'separation': {name: getattr(scenario.separation, name) for name in SEPARATION}}
           if scenario.separation.on else {}),
        'uavs': [_uav(uav) for uav in scenario.uavs],
        'tasks': [scenario_task_row(timed) for timed in scenario.tasks],
        'zones': [scenario_zone_row(timed) for timed in scenario.zones],
        'cancels': [{'task': cancel.task, 'at': cancel.at} for cancel in scenario.cancels],
        'orders': [asdict(order) | {'tasks': list(order.tasks)} for order in scenario.orders],
    }
    return str(yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=99))


def _uav(uav: ScenarioUav) -> dict[str, Any]:
    row = {'id': uav.id, 'system_id': uav.system_id, 'autopilot': uav.autopilot,
           'position': list(uav.position), 'home': list(uav.home),
           'cruise_speed': uav.cruise_speed, 'range': uav.range,
           'capabilities': sorted(uav.capabilities), 'dies_at': uav.dies_at}
    return row | _changed(uav, ScenarioUav, UAV_LIMITS)


def scenario_task_row(timed: TimedTask) -> dict[str, Any]:
    """Return a task as a row of a scenario file.

    Args:
        timed: of any kind.

    Returns:
        Values by key, lengths in metres of the ENU frame.
    """
    work = timed.whole
    task = work.task
    place = {} if work.path else {'position': list(task.position)}
    return {'id': task.id, 'at': timed.at, **place, **_geometry(work), 'value': task.value,
            'service_time': task.service_time, 'acceptance_radius': task.acceptance_radius,
            'required_capabilities': sorted(task.required_capabilities),
            'allowed_uavs': None if task.allowed_uavs is None else sorted(task.allowed_uavs),
            **_changed(task, Task, (*TASK_TIMES, 'heading')),
            **({'actions': [{'name': action.name, **{
                key: int(value) if value.is_integer() else value for key, value in action.values}}
                for action in task.actions]} if task.actions else {})}


def _geometry(work: Work) -> dict[str, Any]:
    """What makes work more than a point."""
    row = {
        'kind': work.kind.name.lower(), 'path': [list(point) for point in work.path],
        'holes': [[list(corner) for corner in hole] for hole in work.holes],
        'strip_width': work.strip_width, 'direction': work.direction, 'radius': work.radius,
        'turns': work.turns, 'divisible': work.divisible, 'vertical': work.vertical.name.lower()}
    return {key: value for key, value in row.items() if value != WORK_KEYS[key].default
            and value != []}


def _changed(value: ScenarioUav | Task, kind: type, names: tuple[str, ...]) -> dict[str, Any]:
    """The named fields that do not have their default."""
    defaults = {spec.name: spec.default for spec in fields(kind)}
    return {name: given for name in names if (given := getattr(value, name)) != defaults[name]}


def scenario_zone_row(timed: TimedZone) -> dict[str, Any]:
    """Return a zone as a row of a scenario file.

    Args:
        timed: with its times.

    Returns:
        Values by key, lengths in metres of the ENU frame.
    """
    row = encode_zone(timed.zone, SCENARIO_ZONE) | {'appears': timed.appears}
    return row if math.isinf(timed.vanishes) else row | {'vanishes': timed.vanishes}
