# SPDX-License-Identifier: Apache-2.0
"""Make benchmarks/data/jacksboro.tif of the sample data of Matplotlib: real ground, 12 x 10 km.

The data are the elevations of the Jacksboro fault (Tennessee) that Matplotlib ships as
jacksboro_fault_dem.npz, at every 3 seconds of arc; benchmarks/data/README.md has their licence.
"""
from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.cbook
import numpy as np
import rasterio

_ROWS, _COLUMNS = slice(180, 320), slice(100, 240)  # the steepest square of 140 nodes
_DEFAULT = Path(__file__).parent / 'data' / 'jacksboro.tif'


def main() -> None:
    """Write the tile."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, default=_DEFAULT, help='(default: %(default)s)')
    out = parser.parse_args().out
    sample = matplotlib.cbook.get_sample_data('jacksboro_fault_dem.npz', asfileobj=False)
    with np.load(sample) as dem:
        heights = dem['elevation'][_ROWS, _COLUMNS].astype('int16')
        step = float(dem['dx'])
        west = float(dem['xmin']) + step * _COLUMNS.start
        north = max(float(dem['ymin']), float(dem['ymax'])) - step * _ROWS.start
    out.parent.mkdir(exist_ok=True)
    with rasterio.open(out, 'w', driver='GTiff', width=heights.shape[1], height=heights.shape[0],
                       count=1, dtype='int16', crs='EPSG:4326', compress='deflate', predictor=2,
                       zlevel=9, transform=rasterio.Affine(
                           step, 0.0, west - step / 2, 0.0, -step, north + step / 2)) as raster:
        raster.write(heights, 1)
    print(f'{out}: {out.stat().st_size} bytes, {heights.min()} to {heights.max()} m')


if __name__ == '__main__':
    main()
