# SPDX-License-Identifier: Apache-2.0
"""Fences and rally points of the bridge as a process, over a restart."""
import signal

import pytest
from test_mavlink_bridge import KINDS, sky  # noqa: F401
from uav_task_alloc_msgs import msg as m

from uav_task_alloc.model import ThreatZone
from uav_task_alloc.nodes.conversions.messages import LATCHED, from_zones

pytestmark = pytest.mark.ros


def test_zones_become_fences_on_board_and_a_restarted_bridge_knows_its_own(
        sky, probe, tmp_path):  # noqa: F811
    (tmp_path / 'state').mkdir()
    world = sky('-p', 'fences:=warn', '-p', f'state_dir:={tmp_path}/state', '-p',
                "rally_points:=['47.3950,8.5456']")
    zones = probe.node.create_publisher(m.ThreatZoneArray, 'threat_zones', LATCHED)

    def show(*radii):
        zones.publish(from_zones([ThreatZone.cylinder(f'z{r}', (0.0, -500.0), float(r))
                                  for r in radii], 0.0))

    def verified():
        return all(s.fence_state == m.UavState.VERIFIED for s in world.states.values())
    show(50)
    probe.until(verified)
    for n in KINDS:
        assert world.fact(n, 'fence') == 'VERIFIED, 1 zone in 1 point'
        assert 'FENCE_ENABLE 0' in world.fact(n, 'fence_parameters') or 'GF_ACTION 2' in (
            world.fact(n, 'fence_parameters'))
    probe.until(lambda: all(world.fact(n, 'rally_points').startswith('VERIFIED') for n in KINDS))
    world.bridge.stop(signal.SIGKILL)
    show(40, 60)
    world.again()
    probe.until(lambda: verified() and all(
        world.fact(n, 'fence') == 'VERIFIED, 2 zones in 2 points' for n in KINDS))
