# SPDX-License-Identifier: Apache-2.0
"""Ids of pieces are made of the id of the task and a number, and taken apart again."""
import pytest

from uav_task_alloc.piece_ids import piece_id, split_piece


@pytest.mark.parametrize(('task_id', 'piece', 'full'), [
    ('field', 3, 'field#3'), ('field', 0, 'field'), ('a#b', 12, 'a#b#12')])
def test_an_id_is_made_and_taken_apart(task_id, piece, full):
    assert piece_id(task_id, piece) == full
    assert split_piece(full) == (task_id, piece)


@pytest.mark.parametrize('full', ['', '#3', 'field#', 'field#x', 'field#-1'])
def test_other_texts_are_ids_of_whole_tasks(full):
    assert split_piece(full) == (full, 0)
