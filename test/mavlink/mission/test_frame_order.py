# SPDX-License-Identifier: Apache-2.0
"""When a frame was sent, by its order among the positions: the same with and without search."""
import math
import random

import pytest

from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.position_history import PositionHistory


def searched(stamps, frame):
    """The answer by its definition."""
    before = max((t for number, t in stamps if number < frame), default=-math.inf)
    after = min((t for number, t in stamps if number > frame), default=math.inf)
    return (before, after) if before <= after else (-math.inf, math.inf)


@pytest.mark.parametrize('late', [0.0, 0.01, 0.3])
@pytest.mark.parametrize('seed', range(4))
def test_a_frame_is_placed_among_positions_that_come_late_or_again(late, seed):
    rng, history, stamps = random.Random(seed), PositionHistory(), []
    for k in range(1, 600):
        number, t = k, 0.2 * k
        if rng.random() < late:
            number -= rng.randrange(20)
        if rng.random() < late:
            t -= rng.uniform(0.0, 5.0)
        if rng.random() < 0.003:
            history.clear()
            stamps.clear()
        history.add(PositionSample(t, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), True, t, number)
        stamps.append((number, t))
        del stamps[:-150]  # as many as it keeps
        for frame in (k - 1, k, k + 1, rng.randrange(k + 5)):
            assert history.sent_between(frame) == searched(stamps, frame)
