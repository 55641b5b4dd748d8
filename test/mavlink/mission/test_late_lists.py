# SPDX-License-Identifier: Apache-2.0
"""Lists that a vehicle takes long after they were planned: it has flown on, past a zone."""
import math

from findings_bench import BOTH, listed
from flight_bench import FlightBench

from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList
from uav_task_alloc.model import Task, ThreatZone

CENTER, SAFE = (100.0, 150.0), 45.0  # [m]
TOWER = ThreatZone.cylinder('tower', CENTER, SAFE, margin=10.0)


def flying_around(kind):
    """A vehicle that flies around the north of a zone, and its least distance from the centre."""
    bench = FlightBench(kind, zones=(TOWER,), zones_known=True).discover()
    bench.assign(listed(1, A=(0, 150), B=(100, 230), C=(230, 190), D=(230, 400)))
    least, collect = [math.inf], bench._collect

    def watched():
        collect()
        least[0] = min(least[0], math.dist(bench.vehicles[1].flight.body.position[:2], CENTER))
    bench._collect = watched
    return bench, least


@BOTH
def test_a_list_that_is_taken_late_does_not_lead_back_through_a_zone(kind):
    bench, least = flying_around(kind)
    position = bench.vehicles[1].flight.body
    assert bench.run(lambda: bench.completed() == ['A'])
    # planned at A: south around the zone; px4 flies on while the transfer lasts
    list_2 = TaskList(2, (MissionStop(Task('E', (200.0, 60.0, 50.0)), (
        (40.0, 105.0, 50.0), (75.0, 80.0, 50.0))), MissionStop(Task('C', (230.0, 190.0, 50.0)))))
    if kind == 'px4':
        bench.line.tampers.append(lambda direction, m, now: [] if (
            m.get_type() == 'MISSION_ITEM_INT' and position.position[0] < 170.0) else None)
    else:
        bench.run(lambda: position.position[0] > 170.0)
    bench.assign(list_2)
    assert bench.run(lambda: {'C', 'E'} <= set(bench.completed()), 300.0)
    assert least[0] > SAFE
