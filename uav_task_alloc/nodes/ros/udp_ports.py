# SPDX-License-Identifier: Apache-2.0
"""UDP ports for a fleet that is simulated on this machine."""
from __future__ import annotations

import socket


def free_port() -> int:
    """Find a UDP port on 127.0.0.1 that is not in use.

    Returns:
        Its number; another process may still take it.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])
