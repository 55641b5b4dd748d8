# SPDX-License-Identifier: Apache-2.0
"""UDP ports and the ROS domain for a fleet that is simulated on this machine."""
from __future__ import annotations

import random
import socket

_DOMAINS = 101  # 0 to 101: above are ports that Linux assigns at random
_PORTS = range(61_000, 65_536)  # above those of domains and those that Linux assigns at random


def free_port() -> int:
    """Find a UDP port on 127.0.0.1 that is not in use.

    Returns:
        Its number, drawn at random, and not one that Linux gives to another socket meanwhile;
        a process that asks for it may still take it. 0, any port, where none is free.
    """
    ports = random.SystemRandom().sample(_PORTS, len(_PORTS))
    return next((port for port in ports if _is_free('127.0.0.1', port)), 0)


def free_domain(preferred: int) -> int:
    """Find a ROS domain in which nothing on this machine takes part.

    Args:
        preferred: number of the domain to begin with, in 1 to 101.

    Returns:
        The first one without a participant, by the UDP ports at which DDS participants are
        discovered; `preferred` where each has one.
    """
    return next((domain for domain in (*range(preferred, _DOMAINS + 1), *range(1, preferred))
                 if _has_no_participant(domain)), preferred)


def _has_no_participant(domain: int) -> bool:
    """Whether no discovery port of a domain is in use (DDSI-RTPS 9.6.2.3).

    Only those of the first ten participants are tried: a new one takes the lowest free port.
    """
    return all(_is_free('', 7410 + 250 * domain + 2 * participant) for participant in range(10))


def _is_free(address: str, port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, port))
        except OSError:
            return False
    return True
