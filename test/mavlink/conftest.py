# SPDX-License-Identifier: Apache-2.0
"""Radios and far ends that are closed at the end of a test."""
import pytest
from link_bench import WALL, End

from uav_task_alloc.mavlink.transport.connections import Connections
from uav_task_alloc.mavlink.transport.link import open_link


@pytest.fixture
def connections():
    made = []

    def make(*names, **kwargs):
        made.append(Connections(map(open_link, names or ['udpin:127.0.0.1:0']), 245, 190,
                          wall=lambda: WALL, **kwargs))
        return made[-1]
    yield make
    for one in made:
        one.close()


@pytest.fixture
def far():
    """far(radio, system) -> End; closed at the end."""
    made = []

    def make(*args):
        made.append(End(*args))
        return made[-1]
    yield make
    for one in made:
        one.socket.close()
