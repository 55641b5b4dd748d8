# SPDX-License-Identifier: Apache-2.0
"""The allocator over a GeoTIFF, as other programs meet it: legs above ground, refused tasks."""
import signal
from itertools import pairwise

import numpy as np
import pytest
from geometry_msgs.msg import Point
from test_allocator import Fleet, add, begin, task
from uav_task_alloc_msgs import msg as m
from uav_task_alloc_msgs.srv import SubmitTasks

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.terrain import read_terrain

pytestmark = pytest.mark.ros
ORIGIN, STEP, NODES = Origin(47.0, 8.0, 500.0), 0.0002, 200
PLACE = ('-p', 'origin.latitude:=47.0', '-p', 'origin.longitude:=8.0',
         '-p', 'origin.altitude_amsl:=500.0')


@pytest.fixture
def ridge(tmp_path):
    """A GeoTIFF of a ridge 200 m high from south to north through the origin; its path."""
    rasterio = pytest.importorskip('rasterio')
    east = (np.arange(NODES) - NODES / 2) * STEP * 76_000.0
    heights = 500.0 + 200.0 * np.exp(-(east / 150.0)**2) + np.zeros((NODES, 1))
    path = tmp_path / 'ridge.tif'
    with rasterio.open(path, 'w', driver='GTiff', width=NODES, height=NODES, count=1,
                       dtype='float32', crs='EPSG:4326', transform=rasterio.Affine(
                           STEP, 0.0, 8.0 - STEP * NODES / 2, 0.0, -STEP,
                           47.0 + STEP * NODES / 2)) as raster:
        raster.write(heights.astype('float32'), 1)
    return path


def test_lists_keep_clear_of_the_ground(start, probe, ridge):
    fleet = Fleet(probe)
    begin(start, fleet, *PLACE, '-p', f'terrain:={ridge}', '-p', 'terrain_clearance:=40.0')
    fleet.uav('a', -900.0, 0.0)
    line = m.Task(task_id='line', kind=m.Task.LINE, vertical=m.Task.TERRAIN, value=1.0, path=[
        Point(x=-500.0, y=-400.0, z=60.0), Point(x=500.0, y=-400.0, z=60.0)])
    place = m.Task(task_id='wgs', frame=m.Task.WGS84, vertical=m.Task.TERRAIN, value=1.0,
                   latitude=47.003, longitude=8.0, altitude=60.0)
    answer = probe.call(SubmitTasks, 'allocator/submit_tasks', SubmitTasks.Request(
        announcement=add(task('far', 900.0, 0.0), line, place, task('low', 0.0, 0.0),
                         task('off', 90_000.0, 0.0), task('none', 0.0, 0.0, vertical=9))))
    assert set(answer.accepted) == {'far', 'line', 'wgs'}
    reasons = dict(zip(answer.rejected, answer.reasons, strict=True))
    assert 'expected at least 199' in reasons['low']
    assert 'ridge.tif: it does not reach to (90000, 0)' in reasons['off']
    assert 'ORIGIN (0) or TERRAIN (1)' in reasons['none']
    probe.until(lambda: fleet.lists['a'] and len(fleet.lists['a'].tasks) == 3)
    ground, at = read_terrain(ridge, ORIGIN), (-900.0, 0.0, 50.0)
    for planned in fleet.lists['a'].tasks:
        way = [(p.x, p.y, p.z) for p in planned.task.path or [planned.task.position]]
        way = way[::-1] if planned.reversed else way
        for a, b in pairwise((at, *((p.x, p.y, p.z) for p in planned.via), way[0])):
            assert a[:2] == b[:2] or ground.least_clearance(a, b)[0] >= 39.9
        if planned.task.task_id != 'far':
            assert ground.above_ground(way) == pytest.approx([60.0] * len(way), abs=0.1)
        at = way[-1]


@pytest.mark.parametrize(('west', 'why'), [
    ('8.0', 'missing.tif'), ('9.0', 'ridge.tif: it does not reach to (0, 0)')])
def test_the_node_does_not_start_without_its_terrain(start, ridge, west, why):
    path = ridge if west == '9.0' else ridge.parent / 'missing.tif'
    process = start('allocator', '-p', f'terrain:={path}', '-p', 'origin.latitude:=47.0',
                    '-p', f'origin.longitude:={west}', '-p', 'origin.altitude_amsl:=500.0')
    status, text = process.stop(signal.SIGCONT, 60)  # it has exited without a signal
    assert status == 1
    assert why in text
    assert 'Traceback' not in text
