# SPDX-License-Identifier: Apache-2.0
"""What is told of a vehicle, and when."""
import dataclasses

import pytest
from flight_bench import FlightBench, flying
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.gcs.status import PublishedStates, UavMode, facts_of

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


def watch(bench, seconds):
    """What is told within some time, as (available, position, mission state, active task)."""
    told, out = PublishedStates(), []

    def look():
        status = bench.state()
        if told.is_due(status, bench.executor().telemetry.position_at, bench.now, 10.0):
            out.append(status)
    bench.run(look, seconds)
    return out


@BOTH
def test_no_task_is_active_after_the_last(kind):
    bench = flying(kind, 'AB')
    assert bench.run(lambda: bench.completed() == ['A', 'B'])
    after = watch(bench, 30.0)
    assert {status.active_task for status in after} == {''}
    assert {status.mode for status in after} == {UavMode.HOLD}


@BOTH
def test_a_task_withdrawn_is_not_active_while_the_vehicle_holds(kind):
    bench = flying(kind, 'AB')
    assert bench.state().active_task == 'A'
    bench.assign(task_list('', 2))
    bench.run(limit=5.0)
    assert {status.active_task for status in watch(bench, 10.0)} == {''}


@BOTH
def test_a_silent_vehicle_is_told_of_once_as_unavailable_and_then_no_more(kind):
    bench = flying(kind, 'ABC')
    told = PublishedStates()
    assert told.is_due(bench.state(), bench.executor().telemetry.position_at, bench.now, 10.0)
    bench.line.cut = True
    bench.assign(task_list('CB', 2))  # an upload, which will fail
    seen = bench.executor().telemetry.position_at
    news = []

    def look():
        if bench.now - seen > 3.1 and told.is_due(
                bench.state(), bench.executor().telemetry.position_at, bench.now, 10.0):
            news.append(bench.state())
    bench.run(look, 60.0)
    assert [status.available for status in news] == [False]
    assert bench.onboard().state is not MissionState.UPLOADING  # it has failed meanwhile
    bench.line.cut = False
    assert bench.run(lambda: look() or news[-1].available, 10.0)


def test_positions_are_told_at_most_at_the_rate_and_changes_at_once():
    bench = FlightBench('px4', takeoff=False).discover()
    bench.run(limit=5.0)
    told, status = PublishedStates(), bench.state()
    assert told.is_due(status, 10.0, 10.0, 5.0)
    assert not told.is_due(status, 10.1, 10.1, 5.0)
    assert told.is_due(dataclasses.replace(status, list_revision=7), 10.1, 10.1, 5.0)
    assert not told.is_due(dataclasses.replace(status, list_revision=7), 10.2, 10.2, 5.0)
    assert told.is_due(dataclasses.replace(status, list_revision=7), 10.4, 10.4, 5.0)


@BOTH
def test_a_link_is_stale_after_three_seconds_lost_after_ten_and_back(kind):
    bench = flying(kind, 'ABC')
    levels = []

    def look():
        level, line, _ = facts_of(bench.ground_station.sessions[1], bench.now)
        if not levels or levels[-1] != (level, line.partition(',')[0]):
            levels.append((level, line.partition(',')[0]))
    bench.run(look, 1.0)
    bench.line.cut = True
    bench.run(look, 11.0)
    bench.line.cut = False
    bench.run(look, 3.0)
    assert levels == [(0, 'mission VERIFIED'), (1, 'link stale'), (3, 'link lost'),
                      (0, 'mission VERIFIED')]


@BOTH
def test_an_upload_tells_how_far_it_is_and_about_when_it_ends(kind):
    bench = FlightBench(kind, takeoff=False, delay=(0.1, 0.1), tick=0.05).discover()
    assert bench.run(lambda: bench.onboard().held is not None)
    bench.assign(task_list('ABCDEFGHIJKLMNOPQRST'))
    seen = []

    def look():
        _, line, facts = facts_of(bench.ground_station.sessions[1], bench.now)
        assert facts['upload'] == 'none' or facts['upload'] in line
        if not seen or seen[-1][1] != facts['upload']:
            seen.append((bench.now, facts['upload']))
        return bench.state().mission_state is MissionState.VERIFIED
    assert bench.run(look)
    count = 20 + bench.onboard().own
    steps = [text.partition(',')[0] for _, text in seen]
    assert steps[-1] == 'none'
    parts = [f'sent {n} of {count} items' for n in range(1, count + 1)]
    parts += [f'read back {n} of {count} items' for n in range(1, count)]
    assert [part for part in parts if part not in steps] == []
    guesses = [(now, float(text.split('about ')[1].split()[0])) for now, text in seen
               if text.startswith(f'sent {count // 2} of') and 'about' in text]
    now, left = guesses[0]
    assert abs(left - (bench.now - now)) < 0.3 * (bench.now - now) + 1.0
