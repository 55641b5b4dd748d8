# SPDX-License-Identifier: Apache-2.0
"""Reports of nodes that follow one another: zones that change, several that report one UAV."""
import pytest

from uav_task_alloc.model import ThreatZone
from uav_task_alloc.record.events import sentences
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

ONE = ThreatZone.cylinder('z1', (70.0, 0.0), 20.0)
GROWN = ThreatZone.cylinder('z1', (70.0, 0.0), 80.0)
OTHER = ThreatZone.cylinder('z2', (170.0, 0.0), 20.0)


def zones(wall, *in_force, kept=()):
    return {'kind': 'zones', 'wall': wall, 'kept': list(kept),
            'zones': [encode_zone(zone, JSON_ZONE) for zone in in_force]}


@pytest.mark.parametrize(('then', 'texts'), [
    (zones(1.0, OTHER, ONE), []), (zones(1.0, GROWN, OTHER), ['zone z1 changed']),
    (zones(1.0, OTHER, kept=['z1']), []), (zones(1.0, OTHER), ['zone z1 removed'])])
def test_a_zone_that_changes_is_an_event_and_one_that_is_repeated_is_not(then, texts):
    run = RunState()
    run.apply(zones(0.0, ONE, OTHER))
    assert [text for _, text in sentences(run, then)] == texts
