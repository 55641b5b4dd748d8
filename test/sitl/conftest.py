# SPDX-License-Identifier: Apache-2.0
"""Vehicles of the tests: those of fleet_sim, and SITL binaries named by environment variables."""
import os

import pytest
from worlds import ArduCopter, FleetSim, Px4

SITL = {'ARDUCOPTER_SITL': ArduCopter, 'PX4_SITL': Px4}


@pytest.fixture(params=['ardupilot', 'px4', *SITL])
def world(request, tmp_path):
    """Four vehicles of a kind, at power-on."""
    if request.param not in SITL:
        fleet = FleetSim(request.param)
    elif not os.environ.get(request.param):
        pytest.skip(f'{request.param} is not set: expected the path of a SITL binary; '
                    'only simulated vehicles are flown')
    else:
        fleet = SITL[request.param](os.environ[request.param], tmp_path)
    yield fleet
    fleet.close()
