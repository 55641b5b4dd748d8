# SPDX-License-Identifier: Apache-2.0
"""Scenario files: read and validated, written, generated."""
from uav_task_alloc.scenario.generate import generate
from uav_task_alloc.scenario.node_parameters import fleet_parameters, simulation_parameters
from uav_task_alloc.scenario.read import load, parse
from uav_task_alloc.scenario.timeline import Moment, from_zero, timeline
from uav_task_alloc.scenario.values import (
    Cancel,
    Scenario,
    ScenarioUav,
    TimedOrder,
    TimedTask,
    TimedZone,
)
from uav_task_alloc.scenario.write import to_yaml

__all__ = ['Cancel', 'Moment', 'Scenario', 'ScenarioUav', 'TimedOrder', 'TimedTask', 'TimedZone',
           'fleet_parameters', 'from_zero', 'generate', 'load', 'parse', 'simulation_parameters',
           'timeline', 'to_yaml']
