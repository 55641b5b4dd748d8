# SPDX-License-Identifier: Apache-2.0
"""Each parameter is declared once: generated files are up to date, values are checked."""
import math
from dataclasses import fields
from pathlib import Path

import pytest
import yaml

from uav_task_alloc import parameter_field, parameter_texts, params
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.objective import MAX_TRIPS, OBJECTIVES, Objective

ROOT = Path(__file__).parent.parent


@pytest.mark.parametrize('node', params.NODES)
def test_the_yaml_file_of_a_node_is_up_to_date(node):
    assert (ROOT / f'config/{node}.yaml').read_text() == parameter_texts.yaml_text(node)


def test_the_table_in_docs_is_up_to_date():
    assert (ROOT / 'docs/parameters.md').read_text() == parameter_texts.markdown_text()


@pytest.mark.parametrize('node', params.NODES)
def test_a_yaml_file_holds_the_defaults(node):
    read = yaml.safe_load(parameter_texts.yaml_text(node))[f'/**/{node}']['ros__parameters']
    for spec in fields(params.NODES[node]):
        if spec.default != ():
            value = read[parameter_field.ros_name(spec)]
            assert (tuple(value) if isinstance(value, list) else value) == spec.default


def test_contract_names_are_declared():
    names = {parameter_field.ros_name(spec) for spec in fields(params.AllocatorParams)}
    assert {'origin.latitude', 'origin.longitude', 'origin.altitude_amsl', 'solve_budget',
            'route_end', 'uav_timeout', 'default_range', 'default_cruise_speed', 'state_dir',
            'seed'} <= names
    names = {parameter_field.ros_name(spec) for spec in fields(params.BridgeParams)}
    assert {'connections', 'origin.latitude', 'origin.longitude', 'origin.altitude_amsl',
            'system_ids', 'uav_id_pattern', 'autopilot', 'cruise_altitude', 'takeoff',
            'signing_key_file'} <= names


@pytest.mark.parametrize(('given', 'text'), [
    ({'solve_budget': -1.0}, 'solve_budget = -1.0: expected float in [0.001, 60] s'),
    ({'solve_budget': float('nan')}, 'solve_budget = nan: expected float in [0.001, 60] s'),
    ({'route_end': 'land'}, "route_end = 'land': expected one of hold, home"),
    ({'seed': 1.5}, 'seed = 1.5: expected int in [0, 2.14748e+09]'),
    ({'state_dir': 3}, 'state_dir = 3: expected text'),
    ({'origin__latitude': 91.0}, 'origin.latitude = 91.0: expected float in [-90, 90] deg'),
])
def test_a_bad_value_is_refused_with_its_range(given, text):
    with pytest.raises(InvalidValue) as refused:
        params.AllocatorParams(**given)
    assert str(refused.value) == text


def test_an_integer_is_accepted_as_a_float():
    assert params.AllocatorParams(uav_timeout=3).uav_timeout == 3.0


def test_the_objectives_of_the_allocator_are_those_of_the_solver():
    choices = {spec.name: spec.metadata['choices'] for spec in fields(params.AllocatorParams)}
    assert choices['objective'] == tuple(OBJECTIVES)
    highest = {spec.name: spec.metadata['high'] for spec in fields(params.AllocatorParams)}
    assert highest['trips'] == MAX_TRIPS


@pytest.mark.parametrize('weights', [(1.0,), (1.0, 0.0, 0.0, 0.0, -1.0), (0.0,) * 5,
                                     (math.nan, 0.0, 0.0, 0.0, 0.0)])
def test_the_weights_of_an_objective_are_five_prices_or_none(weights):
    with pytest.raises(InvalidValue, match=r'objective_weights = .*: expected five numbers'):
        params.AllocatorParams(objective_weights=weights)
    params.AllocatorParams(objective_weights=(1, 0.5, 0, math.inf, math.inf))


def test_an_objective_by_which_all_plans_are_equal_is_refused():
    with pytest.raises(InvalidValue, match=r'objective = \[0.*: expected one price that is not 0'):
        Objective(0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize('value', [0.0, 5e-324, 1e9, 1.1e9, 1e300, math.inf])
@pytest.mark.parametrize('place', range(5))
def test_the_prices_that_the_parameter_takes_are_those_of_the_solver(place, value):
    weights = tuple(value if each == place else 1.0 for each in range(5))
    try:
        Objective(*weights)
    except InvalidValue:
        with pytest.raises(InvalidValue, match=r'objective_weights = .*: expected five numbers'):
            params.AllocatorParams(objective_weights=weights)
    else:
        assert params.AllocatorParams(objective_weights=weights).objective_weights == weights
