# SPDX-License-Identifier: Apache-2.0
"""The demand begins as uniform, finds hot spots, follows them, and survives a restart."""
import json

import numpy as np
import pytest

from uav_task_alloc.anticipation.demand import Demand, DemandModel, Observation
from uav_task_alloc.errors import InvalidValue

LOW, HIGH = np.zeros(2), np.full(2, 10_000.0)
SPOT, OTHER = (2000.0, 7000.0), (8000.0, 1500.0)


def near(spot, count, seed, start=0.0, every=60.0, value=1.0):
    rng = np.random.default_rng(seed)
    return [Observation(start + every * i, *rng.normal(spot, 500.0), value) for i in range(count)]


def learnt(seen, **kwargs):
    demand = Demand(LOW, HIGH, **kwargs)
    for each in seen:
        demand.add(each)
    return demand


def share(demand, spot, now, radius=1500.0):
    """Probability that the next task is around a place."""
    away = np.hypot(demand.cells.x - spot[0], demand.cells.y - spot[1])
    return float(demand.density(now)[away < radius].sum())


def test_a_demand_begins_as_uniform():
    density = Demand(LOW, HIGH).density(0.0)
    assert density == pytest.approx(np.full(256, 1.0 / 256.0))


def test_a_density_sums_to_one_and_is_nowhere_zero_in_the_area():
    demand = learnt(near(SPOT, 40, 1), outside=[0, 1, 2])
    density = demand.density(5000.0)
    assert density.sum() == pytest.approx(1.0)
    assert list(np.flatnonzero(density == 0.0)) == [0, 1, 2]


def test_a_hot_spot_is_found_and_a_new_one_replaces_it():
    demand = learnt(near(SPOT, 60, 2))
    assert share(demand, SPOT, 3600.0) > 0.7
    for each in near(OTHER, 60, 3, start=3600.0):
        demand.add(each)
    assert share(demand, OTHER, 7200.0) > 0.6
    assert share(demand, SPOT, 7200.0) < 0.2


def test_mixtures_of_spots_foretell_tasks_of_three_spots_better_than_kernels():
    rng = np.random.default_rng(11)
    spots = rng.uniform(1000.0, 9000.0, (3, 2))
    place = rng.normal(spots[rng.integers(3, size=590)], 700.0).clip(0.0, 9999.0)
    seen = [Observation(50.0 * i, *place[i], 1.0) for i in range(90)]
    at = (place[90:] // 625.0).astype(int)  # cells of tasks that were not seen
    both, kernels = (np.log(learnt(seen, model=model).density(4500.0)[at[:, 1] * 16 + at[:, 0]])
                     for model in (DemandModel(), DemandModel(spot_forgetting=())))
    assert both.mean() > kernels.mean() + 0.05


def test_uniform_tasks_stay_almost_uniform():
    rng = np.random.default_rng(4)
    demand = learnt([Observation(60.0 * i, *rng.uniform(0.0, 10_000.0, 2), 1.0)
                     for i in range(120)])
    density = 256.0 * demand.density(7200.0)
    assert np.abs(density - 1.0).mean() < 0.15


def test_the_time_of_day_is_learnt_over_days():
    seen = []
    for day in range(6):
        for spot, hour in ((SPOT, 8.0), (OTHER, 20.0)):
            seen += near(spot, 15, day, 86_400.0 * day + 3600.0 * hour)
    demand = learnt(seen)
    morning, evening = 86_400.0 * 6 + 3600.0 * 8, 86_400.0 * 6 + 3600.0 * 20
    for spot, now in ((SPOT, morning), (OTHER, evening)):
        for each in near(spot, 3, 9, now):
            demand.add(each)
        assert share(demand, spot, now + 200.0) > 0.5
    without = learnt(seen, model=DemandModel(day_parts=0))
    assert share(demand, SPOT, morning) > share(without, SPOT, morning)


def test_places_of_valuable_tasks_weigh_more():
    both = [task for pair in zip(near(SPOT, 30, 5), near(OTHER, 30, 6, value=5.0), strict=True)
            for task in pair]
    demand = learnt(both)
    at = [int(np.argmin(np.hypot(demand.cells.x - x, demand.cells.y - y))) for x, y in
          (SPOT, OTHER)]
    density, weight = demand.density(1800.0), demand.weight(1800.0)
    assert weight.sum() == pytest.approx(1.0)
    ratio = (weight[at[1]] / density[at[1]]) / (weight[at[0]] / density[at[0]])
    assert 3.0 < ratio <= 5.0


def test_a_record_as_json_teaches_another_demand_the_same():
    first, second = learnt(near(SPOT, 30, 7)), Demand(LOW, HIGH)
    second.add_record(json.loads(json.dumps(first.to_record())))
    assert second.density(2000.0) == pytest.approx(first.density(2000.0))
    second.forget()
    assert second.density(2000.0) == pytest.approx(Demand(LOW, HIGH).density(2000.0))
    assert second.to_record() == []


def test_a_task_far_outside_the_area_or_earlier_than_the_last_is_harmless():
    demand = learnt([*near(SPOT, 5, 8), Observation(-1e6, 1e9, -1e9, 0.0)])
    assert np.isfinite(demand.density(400.0)).all()
    assert demand.density(400.0).sum() == pytest.approx(1.0)


@pytest.mark.parametrize(('record', 'text'), [
    ('x', "demand = 'x': expected a list"),
    ([[1.0, 2.0]], r'demand\[0\] = \[1.0, 2.0\]: expected \[at, x, y, value\]'),
    ([[0.0, float('nan'), 0.0, 1.0]], 'x = nan'),
    ([[0.0, 0.0, 0.0, -1.0]], r'value = -1.0: expected a number in \[0, inf\]'),
])
def test_a_wrong_record_is_refused_with_its_place(record, text):
    with pytest.raises(InvalidValue, match=text):
        Demand(LOW, HIGH).add_record(record)


def test_an_empty_area_is_refused():
    with pytest.raises(InvalidValue, match=r'high\[1\] = 0.0: expected a number > 0.0'):
        Demand(LOW, np.array([5.0, 0.0]))
