# SPDX-License-Identifier: Apache-2.0
"""A key in the middle of a range lies within it, and halving a range finds every key."""
import random

from uav_task_alloc.key_ranges import ALL_KEYS, KeyRange, after


def test_the_middle_of_a_range_lies_within_it():
    rng = random.Random(1)
    for _ in range(2000):
        low, high = sorted((rng.choice(('list', 'task', 'off')),
                            rng.choice(('', 't', 'uav_')) + str(rng.randrange(10 ** 5)))
                           for _ in range(2))
        middle = KeyRange(low, high).middle()
        if low < high:
            assert low < middle < high, (low, high)
        else:
            assert middle is None


def test_between_a_key_and_the_next_one_there_is_none():
    assert KeyRange(('task', 't1'), after(('task', 't1'))).middle() is None
    assert KeyRange(('task', 't2'), ('task', 't1')).middle() is None


def test_halving_leads_to_any_key():
    for wanted in (('zones', ''), ('task', 'field_7#12'), ('list', 'uav_1')):
        keys = ALL_KEYS
        for _ in range(200):
            middle = keys.middle()
            if middle is None or middle == wanted:
                break
            keys = KeyRange(keys.low, middle) if wanted < middle else KeyRange(middle, keys.high)
        assert keys.low <= wanted < keys.high
        assert len(keys.low[1]) <= len(wanted[1]) + 8
