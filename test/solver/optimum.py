# SPDX-License-Identifier: Apache-2.0
"""Exact optima of small problems by dynamic programming over sets of tasks; uses no solver."""
import math
from itertools import combinations


def best_fit(uavs, tasks, home=False):
    """The least fit of eq 2.12 when every task is served, ranges being soft. O(m 3^n)."""
    n, everything = len(tasks), (1 << len(tasks)) - 1
    best = [0.0] + [math.inf] * everything
    for uav in uavs:
        lengths = shortest(uav, tasks, home)
        paid = [0.01 * metres + max(0.0, metres - uav.range) for metres in lengths]
        best = [min(best[done ^ mine] + paid[mine] for mine in subsets(done))
                for done in range(1 << n)]
    return best[everything] + 100.0 / sum(task.value for task in tasks)


def subsets(whole):
    """All subsets of a set of bits, the empty one too."""
    part = whole
    while part:
        yield part
        part = (part - 1) & whole
    yield 0


def shortest(uav, tasks, home):
    """Length [m] of the shortest route over each set of tasks (Held and Karp)."""
    n, length = len(tasks), math.dist
    end = {1 << i: {i: length(uav.position, tasks[i].position)} for i in range(n)}
    for size in range(2, n + 1):
        for chosen in combinations(range(n), size):
            mine = sum(1 << i for i in chosen)
            end[mine] = {i: min(metres + length(tasks[j].position, tasks[i].position)
                                for j, metres in end[mine ^ 1 << i].items()) for i in chosen}
    back = [length(task.position, uav.home or uav.position) if home else 0.0 for task in tasks]
    return [0.0, *(min(metres + back[i] for i, metres in end[mine].items())
                   for mine in range(1, 1 << n))]
