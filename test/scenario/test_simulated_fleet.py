# SPDX-License-Identifier: Apache-2.0
"""What a scenario says about simulated vehicles: wind, charge, and limits for the bridge."""
from pathlib import Path

import pytest

from uav_task_alloc import scenario
from uav_task_alloc.errors import ScenarioError

CROSSING = Path(__file__).parents[2] / 'config/scenarios/crossing.yaml'
UAV = 'uavs:\n  - {id: u1, position: [0, 0, 0]}\n'


def test_the_wind_and_the_charge_of_a_simulated_flight_are_read_and_written():
    text = UAV.replace('}', ', range: 2000, full_range: 8000, endurance: 300}')
    played = scenario.parse(text + 'wind: {east: -4, gusts: 1.5}\n')
    assert played.wind == scenario.values.ScenarioWind(-4.0, 0.0, 1.5)
    uav = played.uavs[0]
    assert (uav.most_range, uav.most_endurance, uav.charge) == (8000.0, 300.0, 0.25)
    assert scenario.parse(scenario.to_yaml(played)) == played
    with pytest.raises(ScenarioError, match=r'wind.gusts = -1'):
        scenario.parse(UAV + 'wind: {gusts: -1}\n')


def test_the_limits_of_a_scenario_reach_the_bridge():
    played = scenario.parse(UAV.replace('}', ', range: 2000, full_range: 8000, climb_speed: 4, '
                                        'endurance: 300, turnaround: 90}'))
    bridge = scenario.fleet_parameters(played)['mavlink_bridge']
    assert bridge['full_ranges'] == ['u1:8000.0']
    assert bridge['uav_limits'] == [
        'u1:cruise_speed=15.0,climb_speed=4.0,endurance=300.0,turnaround=90.0']


def test_the_separation_of_uavs_is_read_written_and_passed_on():
    crossing = scenario.load(CROSSING)
    assert (crossing.separation.horizontal, crossing.separation.vertical) == (10.0, 5.0)
    assert scenario.parse(scenario.to_yaml(crossing)).separation == crossing.separation
    fleet = scenario.fleet_parameters(crossing)
    assert fleet['allocator']['separation.horizontal'] == 10.0
    assert fleet['allocator']['separation.time'] == 2.0
    with pytest.raises(ScenarioError, match=r'separation: vertical = 0'):
        scenario.parse('uavs: [{id: u1, position: [0, 0, 0]}]\n'
                       'separation: {horizontal: 10, vertical: 0}\n')
    plain = scenario.parse('uavs: [{id: uav_1, position: [0, 0, 0]}]\n')
    assert not plain.separation.on
    assert not any('separation' in name for name in
                   scenario.fleet_parameters(plain)['allocator'])
