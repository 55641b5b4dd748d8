# SPDX-License-Identifier: Apache-2.0
"""Random numbers for kernels: xorshift64 whose whole state is an array that the caller owns."""
from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.kernel import inline_kernel

Chance = NDArray[np.uint64]  # one number, never 0


def chance(seed: int) -> Chance:
    """A state from any integer; near seeds give unlike sequences."""
    return np.random.SeedSequence(seed % 2 ** 64).generate_state(1, np.uint64) | np.uint64(1)


@inline_kernel
def uniform(state: Chance) -> float:
    """In [0, 1)."""
    x = state[0]
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    x ^= x << np.uint64(17)
    state[0] = x
    return np.float64(x >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@inline_kernel
def below(state: Chance, n: int) -> int:
    """0..n-1, each as likely."""
    return int(uniform(state) * n)
