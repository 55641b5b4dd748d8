# SPDX-License-Identifier: Apache-2.0
"""What `/diagnostics` of the allocator says about the messages on `threat_zones`."""
import math

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from test_allocator import Fleet, begin
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.nodes.conversions.messages import LATCHED

pytestmark = pytest.mark.ros


def test_a_refused_zone_is_a_warning_until_the_next_valid_message(start, probe):
    health, fleet = probe.collect(DiagnosticArray, '/diagnostics', 10), Fleet(probe)
    begin(start, fleet)

    def latest():
        return health[-1].status[0] if health else DiagnosticStatus()

    good, bad = (m.ThreatZone(zone_id='z', radius=radius) for radius in (50.0, math.nan))
    fleet.zones.publish(m.ThreatZoneArray(zones=[bad, m.ThreatZone(zone_id='no name')]))
    probe.until(lambda: 'threat_zones refused: zone z: radius = nan' in latest().message)
    assert latest().message.endswith('(and 1 more)')
    assert latest().level == DiagnosticStatus.WARN
    fleet.zones.publish(m.ThreatZoneArray(zones=[good] * 1001))
    probe.until(lambda: 'threat_zones refused: zones: number = 1001' in latest().message)
    fleet.zones.publish(m.ThreatZoneArray(zones=[good]))
    probe.until(lambda: latest().level == DiagnosticStatus.OK)


def test_two_publishers_of_zones_are_a_warning(start, probe):
    health, fleet = probe.collect(DiagnosticArray, '/diagnostics', 10), Fleet(probe)
    begin(start, fleet)
    probe.until(lambda: health and health[-1].status[0].level == DiagnosticStatus.OK)
    second = probe.publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)
    probe.until(lambda: 'threat_zones has 2 publishers' in health[-1].status[0].message)
    probe.node.destroy_publisher(second)
    probe.until(lambda: health[-1].status[0].level == DiagnosticStatus.OK)
