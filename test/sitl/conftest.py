# SPDX-License-Identifier: Apache-2.0
"""The worlds that tests fly in: fleet_sim's always, real ones where a variable names them."""
import os

import pytest
from worlds import ArduCopter, FleetSim, Px4

SITL = {'ARDUCOPTER_SITL': ArduCopter, 'PX4_SITL': Px4}


@pytest.fixture(params=['ardupilot', 'px4', *SITL])
def world(request, tmp_path):
    """Four vehicles of a kind, at power-on."""
    if request.param not in SITL:
        made = FleetSim(request.param)
    elif not os.environ.get(request.param):
        pytest.skip(f'{request.param} is not set: expected the path of a SITL binary; '
                    'only simulated vehicles are flown')
    else:
        made = SITL[request.param](os.environ[request.param], tmp_path)
    yield made
    made.close()
