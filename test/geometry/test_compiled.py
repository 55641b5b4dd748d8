# SPDX-License-Identifier: Apache-2.0
"""After `python -m uav_task_alloc compile` kernels are loaded, never compiled in flight."""
import subprocess
import sys

CODE = """
import numpy as np
from numba.core import event

compiled = []


class Recorder(event.Listener):
    def on_start(self, event):
        compiled.append(event.data['dispatcher'].py_func.__name__)

    def on_end(self, event):
        pass


event.register('numba:compile', Recorder())

from uav_task_alloc.geometry import zones
from uav_task_alloc.geometry.detour import detour
from uav_task_alloc.geometry.distances import DENSE_MAX, Distances
from uav_task_alloc.model import ThreatZone

Z = [ThreatZone.hemisphere('dome', (300, 0, 0), 80, 5.0),
     ThreatZone.cylinder('low', (600, 50), 90, 0.0, 100.0),
     ThreatZone.cylinder('hanging', (640, 0), 90, 50.0),
     ThreatZone.polygon('concave', [(200, 300), (400, 300), (400, 500), (300, 350), (200, 500)])]
A, B, INSIDE = (0, 0, 50), (1000, 30, 50), (300, 320, 20)
detour(A, B), detour(A, B, Z), detour(INSIDE, B, Z, altitude_min=0.0, altitude_max=90.0)
zones.inside(A, Z[0]), zones.cut_by(A, B, Z), zones.distance(A, Z[3])
points = np.array([A, B, INSIDE, (500, -200, 20)], float)
for first, then in (((), Z), (Z[:1], Z), (Z, Z[3:]), (Z, ())):
    for more in (points, np.random.default_rng(1).uniform(0, 1000, (DENSE_MAX + 1, 3))):
        known = Distances(points, first)
        for lengths in (known, known.updated(points=more), known.updated(zones=then)):
            lengths.ensure([0, 2], [1, 1]), lengths.length(1, 0)
            lengths.leg(0, 1), lengths.leg(2, 1)
print('compiled:', *compiled)
"""


def test_nothing_is_compiled_in_flight_once_compile_has_run():
    subprocess.run([sys.executable, '-m', 'uav_task_alloc', 'compile'], check=True)
    process = subprocess.run([sys.executable, '-c', CODE], capture_output=True, text=True,
                             check=True)
    assert process.stdout == 'compiled:\n'
