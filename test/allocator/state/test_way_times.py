# SPDX-License-Identifier: Apache-2.0
"""When a UAV is where on a way, as it speeds up and brakes."""
import pytest

from uav_task_alloc.allocator.state.flight_pace import FlightPace
from uav_task_alloc.allocator.state.way_times import timed_points


def test_points_of_a_way_are_reached_when_a_uav_speeds_up_and_brakes():
    pace = FlightPace(10.0, stop_time=4.0)
    line = [(0.0, 0.0, 0.0), (50.0, 0.0, 0.0), (90.0, 0.0, 0.0)]
    assert timed_points(line, pace) == [
        (2.0, (5.0, 0.0, 0.0)), (4.0, (20.0, 0.0, 0.0)), (7.0, (50.0, 0.0, 0.0)),
        (9.0, (70.0, 0.0, 0.0)), (11.0, (85.0, 0.0, 0.0)), (13.0, (90.0, 0.0, 0.0))]


@pytest.mark.parametrize('share', [0.0, 0.5, 1.0])
@pytest.mark.parametrize('far', [2.0, 15.0, 300.0])
def test_the_last_point_of_a_way_is_reached_at_the_time_of_its_stop(far, share):
    pace = FlightPace(12.0, climb=2.5, wind=(3.0, -2.0), stop_time=5.0)
    line = [(0.0, 0.0, 50.0), (far, 0.0, 50.0), (far, far, 55.0), (far, far, 55.0),
            (9.0, 0.0, 50.0)]
    found = timed_points(line, pace, share)
    times_of = [t for t, _ in found]
    assert times_of == sorted(times_of)
    assert found[-1] == (pytest.approx(pace.from_stop(line, share)), line[-1])
    assert [point for _, point in found if point in line[1:]] == line[1:]
