# SPDX-License-Identifier: Apache-2.0
"""The published status of a vehicle, and when it is published."""
import dataclasses

import pytest
from flight_bench import FlightBench, flying
from mission_bench import task_list

from uav_task_alloc.mavlink.gcs.onboard_mission import MissionState
from uav_task_alloc.mavlink.gcs.status import PublishedStates, UavMode
from uav_task_alloc.mavlink.gcs.vehicle_diagnostics import diagnostics_of

BOTH = pytest.mark.parametrize('kind', ['ardupilot', 'px4'])


def watch(bench, seconds):
    """The statuses published within some time."""
    published, out = PublishedStates(), []

    def check():
        status = bench.state()
        if published.is_due(status, bench.executor().telemetry.position_at, bench.now, 10.0):
            out.append(status)
    bench.run(check, seconds)
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
def test_a_silent_vehicle_is_published_once_as_unavailable_and_then_no_more(kind):
    bench = flying(kind, 'ABCDEFGHIJKLMNO')  # a mission that ends in silence is a loss
    published = PublishedStates()
    assert published.is_due(bench.state(), bench.executor().telemetry.position_at, bench.now, 10.0)
    bench.line.cut = True
    bench.assign(task_list('CB', 2))  # an upload, which will fail
    seen = bench.executor().telemetry.position_at
    statuses = []

    def check():
        if bench.now - seen > 3.1 and published.is_due(
                bench.state(), bench.executor().telemetry.position_at, bench.now, 10.0):
            statuses.append(bench.state())
    bench.run(check, 60.0)
    assert [status.available for status in statuses] == [False]
    assert bench.onboard().state is not MissionState.UPLOADING  # it has failed meanwhile
    bench.line.cut = False
    assert bench.run(lambda: check() or statuses[-1].available, 10.0)


def test_positions_are_published_at_most_at_the_rate_and_changes_at_once():
    bench = FlightBench('px4', takeoff=False).discover()
    bench.run(limit=5.0)
    published, status = PublishedStates(), bench.state()
    assert published.is_due(status, 10.0, 10.0, 5.0)
    assert not published.is_due(status, 10.1, 10.1, 5.0)
    assert published.is_due(dataclasses.replace(status, list_revision=7), 10.1, 10.1, 5.0)
    assert not published.is_due(dataclasses.replace(status, list_revision=7), 10.2, 10.2, 5.0)
    assert published.is_due(dataclasses.replace(status, list_revision=7), 10.4, 10.4, 5.0)


@BOTH
def test_a_link_is_stale_after_three_seconds_lost_after_ten_and_back(kind):
    bench = flying(kind, 'ABC')
    levels = []

    def check():
        now = diagnostics_of(bench.ground_station.sessions[1], bench.now)
        level = now.level, now.summary.partition(',')[0]
        if not levels or levels[-1] != level:
            levels.append(level)
    bench.run(check, 1.0)
    bench.line.cut = True
    bench.run(check, 11.0)
    bench.line.cut = False
    bench.run(check, 3.0)
    assert levels == [(0, 'mission VERIFIED'), (1, 'link stale'), (3, 'link lost'),
                      (0, 'mission VERIFIED')]


@BOTH
def test_an_upload_reports_its_progress_and_remaining_time(kind):
    bench = FlightBench(kind, takeoff=False, delay=(0.1, 0.1), tick=0.05).discover()
    assert bench.run(lambda: bench.onboard().held is not None)
    bench.assign(task_list('ABCDEFGHIJKLMNOPQRST'))
    seen = []

    def check():
        now = diagnostics_of(bench.ground_station.sessions[1], bench.now)
        upload = now.facts.upload
        assert upload == 'none' or upload in now.summary
        if not seen or seen[-1][1] != upload:
            seen.append((bench.now, upload))
        return bench.state().mission_state is MissionState.VERIFIED
    assert bench.run(check)
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


@pytest.mark.parametrize(('kind', 'name', 'value'), [
    ('ardupilot', 'RTL_ALT', 4200.0), ('ardupilot', 'RTL_ALT_M', 42.0),
    ('px4', 'RTL_RETURN_ALT', 42.0)])
def test_the_height_of_its_own_return_is_read_also_without_fences(kind, name, value):
    bench = FlightBench(kind, fences='off', configs={1: {'parameters': ((name, value),)}})
    bench.discover()
    assert bench.run(lambda: bench.state().return_height == 42.0, 30.0)
    assert bench.state().takeoff_height == 50.0
