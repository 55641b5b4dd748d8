# SPDX-License-Identifier: Apache-2.0
"""Which current item is set after an upload, and what was flown before that."""
from dataclasses import replace

import pytest
from test_findings_kills import items_at

from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.item_to_set import ItemToSet
from uav_task_alloc.mavlink.mission.progress import ProgressTable


def tasks_at(**places):
    """A waypoint for each task at its x [m]."""
    return tuple(replace(item, task=name, completes=True) for name, item in zip(
        places, items_at(*places.values()), strict=True))


def flying(items, current):
    progress = ProgressTable()
    progress.begin(items, current, 0.0)
    return progress


ITEMS = tasks_at(A=0.0, B=100.0, C=200.0)
WHOLE = MissionDiff(DiffKind.REPLACE, ITEMS, 0)


@pytest.mark.parametrize(('current', 'seq'), [(1, 1), (None, 0), (3, 0)])
def test_an_ardupilot_keeps_the_current_item_of_its_old_mission_until_it_is_set(current, seq):
    to_set = ItemToSet(flying(ITEMS, current), atomic=False)
    to_set.choose(WHOLE, 0, False, 1.0)
    assert to_set.seq == seq


def test_nothing_is_set_where_items_were_appended_or_a_px4_begins_at_the_first():
    appended = ItemToSet(flying(ITEMS, 1), atomic=False)
    appended.choose(MissionDiff(DiffKind.APPEND, ITEMS, 1), 1, False, 1.0)
    whole = ItemToSet(flying(ITEMS, 0), atomic=True)
    whole.choose(WHOLE, 0, False, 1.0)
    assert appended.seq is whole.seq is None


def test_a_px4_that_has_flown_on_during_the_upload_goes_on_there():
    progress = flying(ITEMS, 0)
    to_set = ItemToSet(progress, atomic=True)
    to_set.choose(WHOLE, 2, False, 1.0)
    assert to_set.seq == progress.current == 2


@pytest.mark.parametrize(('completed', 'seq'), [('A', 1), ('', None)])
def test_a_px4_does_not_fly_again_what_it_flew_after_an_earlier_try(completed, seq):
    progress = flying(ITEMS, 1)
    progress.completed.update(dict.fromkeys(completed))
    to_set = ItemToSet(progress, atomic=True)
    to_set.choose(WHOLE, 0, True, 1.0)
    assert to_set.seq == seq


@pytest.mark.parametrize(('completed', 'seq'), [('', None), ('A', 1), ('AB', 2), ('ABC', None)])
def test_a_completed_task_is_passed_while_an_upload_goes_on(completed, seq):
    progress = flying(ITEMS, 0)
    progress.completed.update(dict.fromkeys(completed))
    assert ItemToSet(progress, atomic=True).while_uploading() == seq


def test_what_an_ardupilot_flies_before_its_current_item_is_set_is_credited():
    progress = flying(ITEMS, 0)
    to_set = ItemToSet(progress, atomic=False)
    to_set.choose(WHOLE, 0, False, 0.0)
    to_set.note_flown(0, 0.1)
    for n in range(10):
        t = 0.2 * n
        progress.add_position(PositionSample(t, (t, 0.0, 50.0), (1.0, 0.0, 0.0)), True, t)
    to_set.note_flown(1, 2.0)
    assert list(progress.completed) == ['A']
    assert to_set.seq == 1
    to_set.note_set(1, 2.1)
    assert to_set.seq is None
    assert progress.current == 1
