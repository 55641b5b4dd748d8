# SPDX-License-Identifier: Apache-2.0
"""The allocator with a `fence_area`, as other programs meet it."""
import pytest
from geometry_msgs.msg import PolygonStamped
from test_allocator import Fleet, S, add, task
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.conversions.messages import LATCHED

pytestmark = pytest.mark.ros


def test_a_plan_stays_inside_of_the_fence_area(start, probe):
    south, west, north, east = 47.3945, 8.5410, 47.3980, 8.5460  # the origin is inside
    corners = [f'{lat},{lon}' for lat, lon in (
        (south, west), (south, east), (north, east), (north, west))]
    node = start('allocator', '-p', 'route_end:=hold', '-p', f'fence_area:={corners}')
    fleet = Fleet(probe)
    areas = probe.collect(PolygonStamped, 'fence_area', LATCHED)
    fleet.uav('u1', -50.0, -50.0)
    fleet.zones.publish(m.ThreatZoneArray(zones=[m.ThreatZone(
        zone_id=f'outside of fence_area ({side})', shape=m.ThreatZone.CYLINDER, radius=900.0,
        z_min=0.0, z_max=500.0) for side in ('west', 'east')]))
    fleet.tasks.publish(add(task('in', -100.0, -100.0), task('out', 300.0, 0.0)))
    probe.until(lambda: fleet.route('u1') == ['in'])
    probe.until(lambda: fleet.status('out').state == S.UNASSIGNED)
    assert fleet.status('out').reason.startswith('inside zone outside of fence_area (')
    assert "zone_id = 'outside of fence_area (west)': expected" in node.output()
    probe.until(lambda: areas)
    assert [round(v, -1) for p in areas[0].polygon.points for v in (p.x, p.y)] == [
        -350, -360, 30, -360, 30, 30, -350, 30]
