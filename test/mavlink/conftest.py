# SPDX-License-Identifier: Apache-2.0
"""Connections and remotes that are closed at the end of a test."""
import pytest
from link_bench import WALL, Remote

from uav_task_alloc.mavlink.transport.connections import Connections
from uav_task_alloc.mavlink.transport.link import open_link


@pytest.fixture
def make_connections():
    """make_connections(*names, **kwargs) -> Connections; one udpin link by default."""
    opened = []

    def make(*names, **kwargs):
        opened.append(Connections(map(open_link, names or ['udpin:127.0.0.1:0']), 245, 190,
                          wall=lambda: WALL, **kwargs))
        return opened[-1]
    yield make
    for one in opened:
        one.close()


@pytest.fixture
def make_remote():
    """make_remote(connections, system) -> Remote."""
    opened = []

    def make(*args):
        opened.append(Remote(*args))
        return opened[-1]
    yield make
    for one in opened:
        one.socket.close()
