# SPDX-License-Identifier: Apache-2.0
"""A vehicle held before a zone on its way: lists without tasks, and uploads that do not end."""
from authority_bench import BOTH, flying
from findings_bench import drop_messages
from mission_bench import task_list

from uav_task_alloc.geometry.zones import inside
from uav_task_alloc.mavlink.autopilots import ModeFunction
from uav_task_alloc.model import ThreatZone


def held_at_zone(kind):
    """Held before a zone; the uploads of the list around it are lost."""
    bench = flying(kind, 'AEZ')
    body = bench.vehicles[1].flight.body
    assert bench.run(lambda: bench.completed() == ['A'], 100.0)
    assert bench.run(lambda: body.position[0] > 140.0, 30.0)
    zone = ThreatZone.hemisphere('Z', center=(body.position[0] + 110.0, 100.0, 0.0), radius=70.0)
    drop_messages(bench, 'up', 'MISSION_COUNT', lambda m: True)
    bench.set_policy(zones=(zone,), zones_known=True)
    bench.assign(task_list('XYZ', 2))
    assert bench.run(lambda: 'zone: Z is ahead' in bench.executor().holds.reason, 10.0)
    bench.run(limit=3.0)
    assert bench.executor().telemetry.mode is ModeFunction.HOLD
    return bench, zone


def never_inside(bench, zone, limit):
    body = bench.vehicles[1].flight.body
    assert not bench.run(lambda: inside(body.position, zone), limit)


@BOTH
def test_a_vehicle_held_at_a_zone_returns_by_a_list_without_tasks(kind):
    bench, zone = held_at_zone(kind)
    bench.line.tampers.clear()
    bench.assign(task_list('', 3, returns=True))
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'RETURN', 10.0)
    assert bench.executor().holds.reason == ''
    never_inside(bench, zone, 100.0)
    assert not bench.vehicles[1].flight.armed
    assert not any('held for 30 s' in note for note in bench.notes)


@BOTH
def test_a_vehicle_held_at_a_zone_holds_by_a_list_without_tasks(kind):
    bench, zone = held_at_zone(kind)
    bench.line.tampers.clear()
    bench.assign(task_list('', 3))
    never_inside(bench, zone, 20.0)
    assert bench.executor().telemetry.mode is ModeFunction.HOLD


@BOTH
def test_without_another_list_a_vehicle_holds_before_a_new_zone_and_returns(kind):
    bench = flying(kind, 'AEZ')
    zone = ThreatZone.cylinder('Z', (200.0, 100.0), 40.0)
    bench.set_policy(zones=(zone,), zones_known=True)
    never_inside(bench, zone, 150.0)
    assert 'held for 30 s for a list around a zone: returns' in bench.notes
    assert not bench.vehicles[1].flight.armed
    assert bench.hand_over() == ''
    bench.run(limit=20.0)
    assert not bench.vehicles[1].flight.armed
    assert 'waits for another list: a zone is across this one' in bench.notes
    bench.set_policy(zones=())
    assert bench.run(lambda: bench.completed()[-1:] == ['Z'], 300.0)


@BOTH
def test_a_list_that_came_after_a_zone_is_flown_as_it_is(kind):
    bench = flying(kind, 'AEZ')
    zone = ThreatZone.cylinder('Z', (200.0, 100.0), 40.0)
    bench.set_policy(zones=(zone,), zones_known=True)
    bench.assign(task_list('AEZ', 2))
    assert bench.run(lambda: bench.completed()[-1:] == ['Z'], 200.0)


@BOTH
def test_a_vehicle_held_at_a_zone_for_an_upload_that_does_not_end_returns(kind):
    bench, zone = held_at_zone(kind)
    held_at = bench.now
    assert bench.run(lambda: bench.vehicles[1].mode.name == 'RETURN', 60.0)
    assert 20.0 < bench.now - held_at < 40.0
    assert any('held for 30 s for an upload that does not end' in note for note in bench.notes)
    never_inside(bench, zone, 100.0)
    assert not bench.vehicles[1].flight.armed
