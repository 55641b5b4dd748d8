# SPDX-License-Identifier: Apache-2.0
"""The study of waiting: reproducible arrivals, all tasks served, paired runs, its last line."""
import json
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
import pytest

from uav_task_alloc.anticipation import event_simulation as events
from uav_task_alloc.anticipation.cover import COVER_PRICES
from uav_task_alloc.anticipation.places import MOVE_PRICES
from uav_task_alloc.cli import study as command
from uav_task_alloc.errors import AllocError, InvalidValue
from uav_task_alloc.study import anticipation, arrivals, executors
from uav_task_alloc.study.waiting_runs import POLICIES, Setting, arrival_rate, fly, run_pair

RATE = 0.02  # [1/s]


@contextmanager
def one_thread():
    with ThreadPoolExecutor(1) as pool:
        yield pool


@pytest.mark.parametrize('kind', arrivals.ARRIVAL_KINDS)
def test_arrivals_are_reproducible_within_the_area_and_ascending(kind):
    first, second = arrivals.make_stream(kind, RATE, 5), arrivals.make_stream(kind, RATE, 5)
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    assert ((first.place >= 0.0) & (first.place <= arrivals.AREA)).all()
    assert (np.diff(first.announced) >= 0.0).all()
    assert first.announced[-1] <= arrivals.DURATION


def test_hot_spots_stay_move_or_switch():
    spots = {kind: arrivals.make_stream(kind, RATE, 5).spots for kind in arrivals.ARRIVAL_KINDS}
    ways = {kind: np.hypot(*(each[1:] - each[:-1]).T) for kind, each in spots.items()}
    assert ways['hot'].max() == 0.0
    assert 0.0 < ways['moving'].max() <= 60.0 * arrivals.DRIFT + 1e-6
    assert np.count_nonzero(ways['switch'].max(0)) == 1


def test_the_true_density_is_where_the_tasks_are():
    stream = arrivals.make_stream('hot', 0.5, 6)
    x, y = (each.ravel() for each in np.meshgrid(*[np.arange(500.0, 10_000.0, 1000.0)] * 2))
    density = arrivals.true_density(stream.spots, x, y)
    assert density.sum(1) == pytest.approx(np.ones(120))
    counts, *_ = np.histogram2d(stream.place[:, 1], stream.place[:, 0], 10,
                                [[0.0, arrivals.AREA]] * 2)
    assert np.corrcoef(counts.ravel(), density[0])[0, 1] > 0.9


@pytest.mark.parametrize('policy', POLICIES.values(), ids=POLICIES)
def test_every_task_is_served_once_and_no_uav_flies_faster_than_it_can(policy):
    stream = arrivals.make_stream('hot', RATE, 7)
    response, fleet = fly(stream, 4, policy, 7)
    assert (response >= 0.0).all()
    assert fleet.flown.max() <= 15.0 * (fleet.clock[0] + 1e-6)
    assert (fleet.waiting <= fleet.flown + 1e-6).all()
    assert (fleet.waiting.sum() > 0.0) == (policy not in (events.STAY, events.ASSIGN))


def test_one_uav_serves_two_tasks_as_calculated_by_hand():
    start = np.random.default_rng([3, 1]).uniform(0.0, arrivals.AREA, 2)
    places = np.array([start + [300.0, 0.0], start + [300.0, 150.0]])
    stream = arrivals.TaskStream(places, np.array([10.0, 15.0]), np.array([40.0, 40.0]),
                             np.zeros((120, 0, 2)))
    response, fleet = fly(stream, 1, events.STAY, 3)
    assert response == pytest.approx([20.0, 20.0 - 5.0 + 40.0 + 10.0])
    assert fleet.flown == pytest.approx([450.0])
    assert fleet.busy == pytest.approx([20.0 + 40.0 + 10.0 + 40.0])


def test_a_task_under_way_moves_to_a_uav_that_becomes_free_nearer():
    start = np.random.default_rng([3, 2]).uniform(0.0, arrivals.AREA, (2, 2))
    first = start[0]  # served at once by the first UAV, for 10 s
    second = start[0] + 0.1 * (start[0] - start[1])  # the other one is sent, then released
    stream = arrivals.TaskStream(np.array([first, second]), np.array([1.0, 2.0]),
                             np.array([10.0, 10.0]), np.zeros((120, 0, 2)))
    response, _ = fly(stream, 2, events.STAY, 3)
    way = 0.1 * np.hypot(*(start[0] - start[1])) / 15.0
    assert response == pytest.approx([0.0, 9.0 + way])


def test_a_task_is_left_to_the_uav_that_is_not_needed_for_the_next_ones():
    """The nearer UAV is in the only hot spot; the other one is 20 s further from the task."""
    start = np.random.default_rng([3, 2]).uniform(0.0, arrivals.AREA, (2, 2))
    way = start[1] - start[0]
    half = np.hypot(*way) / 2.0
    task = start[0] + way * (0.5 - 75.0 / half)
    stream = arrivals.TaskStream(np.array([task, start[0]]), np.array([1.0, 450.0]),
                                 np.full(2, 60.0), np.tile(start[0], (120, 1, 1)))
    still = MOVE_PRICES._replace(way=1e9)
    plain, cover = (fly(stream, 2, events.ORACLE, 3, still, prices)[0]
                    for prices in (COVER_PRICES._replace(tasks=0.0, least=0.0), COVER_PRICES))
    near, far = (half - 150.0) / 15.0, (half + 150.0) / 15.0
    assert plain == pytest.approx([near, near])
    assert cover == pytest.approx([far, 0.0])


def test_a_run_is_the_same_again_and_paired_over_policies():
    setting = Setting(4, 50, 'switch')
    first, second = run_pair(setting, RATE, 11), run_pair(setting, RATE, 11)
    assert first == second
    assert list(first) == list(POLICIES)
    assert first['base']['flown'] > first['stay']['flown']


def test_the_rate_of_arrivals_makes_a_staying_fleet_as_busy_as_wanted():
    setting = Setting(4, 50, 'uniform')
    rate = arrival_rate(setting)
    fleets = [fly(arrivals.make_stream('uniform', rate, seed), 4, events.STAY, seed)[1]
              for seed in range(8)]
    busy = [fleet.busy.mean() / arrivals.DURATION for fleet in fleets]
    assert np.mean(busy) == pytest.approx(0.5, abs=0.06)


def test_waiting_where_tasks_come_from_is_sooner():
    streams = [arrivals.make_stream('hot', 0.027, seed) for seed in range(6)]
    mean = {policy: np.mean([fly(stream, 8, policy, seed)[0].mean()
                             for seed, stream in enumerate(streams)])
            for policy in (events.STAY, events.LEARNT, events.ORACLE)}
    assert mean[events.ORACLE] < 0.95 * mean[events.STAY]
    assert mean[events.LEARNT] < 0.97 * mean[events.STAY]


def test_a_process_that_is_killed_is_an_error_in_one_line(monkeypatch):
    def killed(setting):
        raise BrokenExecutor('terminated abruptly')
    monkeypatch.setattr(anticipation, 'arrival_rate', killed)
    with pytest.raises(AllocError, match=r'was killed: expected memory.*terminated abruptly'):
        anticipation.run_study(anticipation.Study(), one_thread, print)


def test_the_last_line_of_the_study_is_one_json_object(monkeypatch, capsys):
    monkeypatch.setattr(executors, 'chosen', lambda args: one_thread)
    monkeypatch.setattr(anticipation, 'arrival_rate', lambda setting: RATE)
    argv = ['anticipation', '--uavs', '8', '--busy', '50', '--runs', '2', '--json',
            '--policies', 'learnt,oracle']
    assert command.main(argv) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = [line for line in lines if line.startswith('| 8 | 50 %')]
    assert len(rows) == len(arrivals.ARRIVAL_KINDS)
    figures = json.loads(lines[-1])
    assert list(figures) == [*arrivals.ARRIVAL_KINDS, 'oracle_gap_percent']
    for kind in arrivals.ARRIVAL_KINDS:
        low, high = figures[kind]['ci95']
        assert low < figures[kind]['reduction_percent'] < high


@pytest.mark.parametrize(('option', 'value', 'text'), [
    ('--uavs', '4,16', "--uavs = '4,16': expected 8 in it with --json"),
    ('--busy', '30', "--busy = '30': expected 50 in it with --json"),
    ('--policies', 'learnt', "--policies = 'stay,learnt': expected learnt and oracle in it"),
])
def test_a_last_line_needs_its_setting(option, value, text):
    with pytest.raises(InvalidValue) as error:
        command.main(['anticipation', option, value, '--json'])
    assert text in str(error.value)


def test_only_the_policies_wanted_are_flown(monkeypatch, capsys):
    monkeypatch.setattr(executors, 'chosen', lambda args: one_thread)
    monkeypatch.setattr(anticipation, 'arrival_rate', lambda setting: RATE)
    assert command.main(['anticipation', '--uavs', '4', '--busy', '30', '--runs', '2',
                         '--policies', 'base']) == 0
    out, log = capsys.readouterr()
    assert [cell.strip() for cell in out.splitlines()[0].strip('|').split('|')] == [
        'UAVs', 'busy', 'arrivals', 'stay', 'base']
    assert '4 UAVs, 30 % busy, moving: 2 runs' in log
    with pytest.raises(SystemExit):
        command.main(['anticipation', '--policies', 'base,best'])
    assert "'base,best': expected of stay,base,even" in capsys.readouterr().err


@pytest.mark.parametrize('value', ['0', '8,x', '', '101', '8,,4'])
def test_a_wrong_list_of_fleets_is_refused(value, capsys):
    with pytest.raises(SystemExit) as error:
        command.main(['anticipation', '--uavs', value])
    assert error.value.code == 2
    assert 'expected whole numbers in [1, 100]' in capsys.readouterr().err
