# SPDX-License-Identifier: Apache-2.0
"""Findings 11 to 13 and 24: what links, heartbeats, signing and floods do to the bridge."""
import os
import socket

import pytest
from link_bench import heartbeat, nothing, receive

from uav_task_alloc.mavlink.codec import Codec


@pytest.fixture
def servers():
    """Two TCP servers, the first of which does not listen yet."""
    made = [socket.socket(), socket.socket()]
    for one in made:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        one.bind(('127.0.0.1', 0))
        one.settimeout(5.0)
    yield made
    for one in made:
        one.close()


def free_until(number):
    """Take all free file numbers below one, so that the next file to be opened gets it."""
    held = [os.dup(0)]
    while held[-1] < number:
        held.append(os.dup(0))
    os.close(held.pop())
    return held


# 11: a file number that passes from one link to another


def test_finding_11_a_file_number_may_pass_from_one_link_to_the_other(radio, servers):
    one, two = radio(*(f'tcp:127.0.0.1:{s.getsockname()[1]}' for s in servers)), servers[1]
    first, second = one.links
    two.listen()
    one.step(0.0)  # the first is refused, the second is connected
    far, _ = two.accept()
    assert nothing(one)
    assert first.fileno() == -1
    number = second.fileno()
    far.close()
    held = free_until(number)
    second._broken('closed by the far end')  # as a heartbeat does that meets the broken line
    servers[0].listen()
    one.step(10.0)
    for file in held:
        os.close(file)
    assert first.fileno() == number
    far, _ = servers[0].accept()
    far.sendall(Codec(1, 1).pack(heartbeat()))
    assert [address[0] for address, _ in receive(one)] == [0]
    far.close()


def test_finding_11_two_links_may_swap_their_files(radio, servers):
    one = radio(*(f'tcp:127.0.0.1:{s.getsockname()[1]}' for s in servers))
    for server in servers:
        server.listen()
    one.step(0.0)
    fars = [server.accept()[0] for server in servers]
    assert nothing(one)
    first, second = one.links
    first._file, second._file = second._file, first._file  # as if both had been opened again
    first.opened, second.opened = 2, 2
    for number, far in enumerate(fars):
        far.sendall(Codec(1, 1).pack(heartbeat()))
        assert [address[0] for address, _ in receive(one)] == [1 - number]
        far.close()


def test_finding_11_a_line_that_a_sender_closes_is_read_no_more(radio, servers):
    servers[0].listen()
    one = radio(f'tcp:127.0.0.1:{servers[0].getsockname()[1]}')
    one.step(0.0)
    assert nothing(one)
    link, = one.links
    link.trouble = 'Broken pipe'
    link.close()
    assert link.read() == []
    assert link.trouble == 'Broken pipe'
