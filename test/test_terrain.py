# SPDX-License-Identifier: Apache-2.0
"""Legs over terrain are judged exactly, and lifted where they come too near to the ground."""
import math
import random
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from uav_task_alloc.allocator.state.ground import read_ground
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.geometry.frames import Origin, to_enu_batch
from uav_task_alloc.params import AllocatorParams
from uav_task_alloc.terrain import Terrain, TerrainError, check_above, read_terrain

ORIGIN = Origin(47.0, 8.0, 500.0)
STEP = 0.0003  # [deg] some 30 m
NODES = 240
WEST, NORTH = 8.0 - STEP * NODES / 2, 47.0 + STEP * NODES / 2


def mountain(seed=1):
    """Heights with peaks and noise, 7 x 5 km around the origin."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:NODES, 0:NODES] / NODES - 0.5
    heights = 500.0 + 5.0 * rng.random((NODES, NODES))
    for _ in range(25):
        cx, cy = rng.uniform(-0.5, 0.5, 2)
        heights += rng.uniform(30.0, 400.0) * np.exp(
            -((x - cx)**2 + (y - cy)**2) / rng.uniform(0.0005, 0.02))
    return heights


def terrain(heights=None):
    return Terrain(mountain() if heights is None else heights,
                   lambda longitude, latitude: ((longitude - WEST) / STEP,
                                                (NORTH - latitude) / STEP), ORIGIN)


def above(ground, points):
    """Least height above ground of a polyline, sampled each metre."""
    rows = []
    for a, b in pairwise(points):
        n = max(2, math.ceil(math.dist(a, b)))
        rows += [np.array(a) + t * (np.array(b) - np.array(a)) for t in np.linspace(0, 1, n)]
    return float(np.min(ground.above_ground(rows)))


def test_heights_are_those_of_the_nodes_and_bilinear_between():
    heights = np.array([[500.0, 510.0], [520.0, 570.0]])
    ground = Terrain(heights, lambda lon, lat: ((lon - 8.0) / STEP, (47.0 - lat) / STEP), ORIGIN)
    spots = to_enu_batch(ORIGIN, [(47.0, 8.0, 600.0), (47.0, 8.0 + STEP, 600.0),
                                  (47.0 - STEP / 2, 8.0 + STEP / 2, 600.0)])
    assert ground.above_ground(spots) == pytest.approx([100.0, 90.0, 75.0], abs=1e-3)


@pytest.mark.parametrize('seed', range(3))
def test_the_least_clearance_of_a_leg_is_exact(seed):
    rng, ground = random.Random(seed), terrain()
    for _ in range(15):
        a, b = ((rng.uniform(-2000, 2000), rng.uniform(-3000, 3000), rng.uniform(0, 600))
                for _ in 'ab')
        least, share = ground.least_clearance(a, b)
        assert least <= above(ground, [a, b]) + 1e-3
        spot = [p + share * (q - p) for p, q in zip(a, b, strict=True)]
        assert ground.above_ground([spot])[0] == pytest.approx(least, abs=1e-3)


def test_lifted_legs_keep_clear_of_a_mountain():
    rng, ground = random.Random(7), terrain()
    for _ in range(40):
        a, b = ground.raised([(rng.uniform(-2000, 2000), rng.uniform(-3000, 3000), 0.0)
                              for _ in 'ab'], [rng.choice((0.0, 40.0, 120.0)) for _ in 'ab'])
        via = ground.lifted(a, b, 30.0)
        inner = [p for p in (a, *via, b) if ground.above_ground([p])[0] >= 30.0]
        assert above(ground, inner) >= 30.0
        for end, near in ((a, inner[0]), (b, inner[-1])):  # upright to and from low ends
            assert end[:2] == near[:2]


def test_legs_over_real_ground_keep_clear_of_it():
    pytest.importorskip('rasterio')
    tile = Path(__file__).parent.parent / 'benchmarks/data/jacksboro.tif'
    rng, ground = random.Random(3), read_terrain(tile, Origin(36.525, -84.272, 400.0))
    raised = 0
    for _ in range(25):
        a, b = ground.raised([(rng.uniform(-5000, 5000), rng.uniform(-5500, 5500), 0.0)
                              for _ in 'ab'], [rng.uniform(31.0, 120.0) for _ in 'ab'])
        via = ground.lifted(a, b, 30.0)
        assert above(ground, [a, *via, b]) >= 30.0
        raised += bool(via)
    assert raised > 15


def test_a_clear_leg_has_no_points():
    assert terrain().lifted((0.0, 0.0, 2000.0), (1000.0, 0.0, 2000.0), 30.0) == ()


def test_a_way_above_ground_follows_it():
    ground = terrain()
    way = ground.followed([(-1500.0, 0.0, 60.0), (1500.0, 500.0, 60.0)], 4.0)
    assert way[0][:2] == (-1500.0, 0.0)
    assert way[-1][:2] == (1500.0, 500.0)
    assert above(ground, way) >= 60.0 - 4.0 - 2.0  # noise of the nodes between two samples
    assert len(way) < 300


@pytest.mark.parametrize('far', [math.inf, math.nan])
def test_a_leg_to_where_the_projection_has_no_place_is_refused(far):
    ground = Terrain(mountain(), lambda longitude, latitude: (
        np.where(longitude < 8.02, (longitude - WEST) / STEP, far), (NORTH - latitude) / STEP),
        ORIGIN)
    with pytest.raises(TerrainError, match='it does not reach to'):
        ground.least_clearance((0.0, 0.0, 900.0), (9000.0, 0.0, 900.0))


def test_what_is_below_ground_is_refused():
    with pytest.raises(InvalidValue, match=r'task t: position = -900\.0: expected at least'):
        check_above(terrain(), 'task t: position', [(0.0, 0.0, -900.0)])


def test_the_end_of_the_data_is_named():
    with pytest.raises(TerrainError, match=r'terrain: it does not reach to \(0, 0\) to \(9000'):
        terrain().least_clearance((0.0, 0.0, 900.0), (9000.0, 0.0, 900.0))
    with pytest.raises(TerrainError, match='it does not reach to'):
        terrain().least_clearance((0.0, 0.0, 900.0), (1e8, 0.0, 900.0))
    heights = mountain()
    heights[100:140, 100:140] = np.nan
    with pytest.raises(TerrainError, match='it has no data near'):
        terrain(heights).above_ground([(0.0, 0.0, 900.0)])


def test_a_geotiff_in_degrees_and_one_in_metres(tmp_path):
    rasterio = pytest.importorskip('rasterio')
    from rasterio.warp import transform
    heights, path = mountain().astype('float32'), tmp_path / 'ground.tif'
    profile = {'driver': 'GTiff', 'width': NODES, 'height': NODES, 'count': 1, 'dtype': 'float32'}
    with rasterio.open(path, 'w', crs='EPSG:4326', transform=rasterio.Affine(
            STEP, 0.0, WEST - STEP / 2, 0.0, -STEP, NORTH + STEP / 2), **profile) as raster:
        raster.write(heights, 1)
    read = read_terrain(path, ORIGIN)
    spots = [(0.0, 0.0, 90.0), (700.0, -900.0, 500.0), (-1234.5, 678.9, -50.0)]
    assert read.above_ground(spots) == pytest.approx(
        terrain(heights).above_ground(spots), abs=1e-3)
    east, north = (row[0] for row in transform('EPSG:4326', 'EPSG:32632', [8.0], [47.0])[:2])
    flat = np.full((NODES, NODES), 512.0, 'float32')
    with rasterio.open(path, 'w', crs='EPSG:32632', transform=rasterio.Affine(
            10.0, 0.0, east - 1200, 0.0, -10.0, north + 1200), **profile) as raster:
        raster.write(flat, 1)
    assert read_terrain(path, ORIGIN).above_ground([(0.0, 0.0, 20.0)]) == pytest.approx(
        [8.0], abs=0.01)


def written(path, size=NODES, crs='EPSG:4326', west=WEST, step=STEP, nodata=None):
    """A flat GeoTIFF of `size` nodes each way from the north west; its path."""
    rasterio = pytest.importorskip('rasterio')
    place = {'transform': rasterio.Affine(step, 0.0, west, 0.0, -step, NORTH)} if step else {}
    with rasterio.open(path, 'w', driver='GTiff', width=size, height=size, count=1, crs=crs,
                       dtype='float32', nodata=nodata, **place) as raster:
        raster.write(np.full((size, size), 512.0, 'float32'), 1)
    return path


@pytest.mark.filterwarnings('ignore::rasterio.errors.NotGeoreferencedWarning')
@pytest.mark.parametrize(('made', 'why'), [
    ({'size': 1}, '1 x 1 pixels: expected 2 x 2'),
    ({'crs': None}, 'it has no projection'),
    ({'step': 0.0}, 'it has no position'),
    ({'crs': 'LOCAL_CS["site",UNIT["metre",1]]'}, 'its projection gives no degrees'),
    ({'crs': 'EPSG:32632'}, r'it does not reach to \(0, 0\)'),  # degrees taken for metres
    ({'west': 9.0}, r'it does not reach to \(0, 0\)'),
    ({'size': 20}, r'it does not reach to \(0, 0\)'),
    ({'nodata': 512.0}, 'it has no data')])
def test_a_geotiff_that_is_not_the_ground_here_is_refused(tmp_path, made, why):
    path = str(written(tmp_path / 'ground.tif', **made))
    with pytest.raises(TerrainError, match=why):
        read_ground(AllocatorParams(terrain=path), ORIGIN)
    assert read_ground(AllocatorParams(), ORIGIN) is None


def test_a_damaged_geotiff_is_refused(tmp_path):
    path = written(tmp_path / 'ground.tif')
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(TerrainError, match=r'ground\.tif: .*expected a GeoTIFF'):
        read_terrain(path, ORIGIN)


def test_what_is_no_terrain_is_refused(tmp_path):
    pytest.importorskip('rasterio')
    (tmp_path / 'x.tif').write_text('no raster')
    for name in 'x.tif', 'missing.tif':
        with pytest.raises(TerrainError, match=f'{name}.*: expected a GeoTIFF'):
            read_terrain(tmp_path / name, ORIGIN)
