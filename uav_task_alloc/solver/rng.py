# SPDX-License-Identifier: Apache-2.0
"""Random numbers for kernels: xorshift64 (Marsaglia 2003) on a state that the caller owns."""
from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uav_task_alloc.kernel import inline_kernel

RngState = NDArray[np.uint64]  # (1) uint64, never 0


def rng_state(seed: int) -> RngState:
    """Return the state of a generator; near seeds give uncorrelated sequences.

    Args:
        seed: any integer, taken modulo 2^64.

    Returns:
        uint64 (1,), odd.
    """
    return np.random.SeedSequence(seed % 2 ** 64).generate_state(1, np.uint64) | np.uint64(1)


@inline_kernel
def uniform(state: RngState) -> float:
    """Draw a random number by xorshift64 (Marsaglia 2003). O(1).

    Args:
        state: uint64 (1,), not 0; is changed.

    Returns:
        float64 in [0, 1).
    """
    x = state[0]
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    x ^= x << np.uint64(17)
    state[0] = x
    return np.float64(x >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@inline_kernel
def below(state: RngState, n: int) -> int:
    """Return a uniformly distributed integer. O(1)

    Args:
        state: of the generator, is advanced.
        n: number of values, at least 1.

    Returns:
        In 0..n-1.
    """
    return int(uniform(state) * n)
