# SPDX-License-Identifier: Apache-2.0
"""Pieces of a new cut against those in force: by their ways, each of which counts once."""
from dataclasses import replace

import pytest

from uav_task_alloc.allocator.records import TaskRecord, TaskState
from uav_task_alloc.allocator.state.matched_pieces import MatchedPiece, match_pieces
from uav_task_alloc.model import Task


def strip(task_id, y, start=0.0, end=100.0, **values):
    path = (start, y, 50.0), (end, y, 50.0)
    return Task(task_id, path[0], path=path, reversible=True, **values)


def record(task, state=TaskState.PENDING):
    return TaskRecord(task, task, state)


def completed(task):
    return record(task, TaskState.COMPLETED)


def ids(matched):
    return [(each.known, each.flown) for each in matched]


def test_pieces_with_the_ways_of_those_in_force_are_known_in_either_direction():
    new = [strip('field#1', 0.0), strip('field#2', 20.0, 100.0, 0.0), strip('field#3', 40.0)]
    found = match_pieces(new, [record(strip('field#7', 20.0)), record(strip('field#8', 0.0))], [])
    assert ids(found) == [('field#8', False), ('field#7', False), ('', False)]
    assert [each.task for each in found] == new


def test_a_piece_in_force_is_one_of_two_with_equal_ways():
    new = [strip('cable#1', 0.0), strip('cable#2', 0.0)]
    assert ids(match_pieces(new, [record(strip('cable#9', 0.0))], [])) == [
        ('cable#9', False), ('', False)]


def test_a_piece_that_is_flown_as_a_whole_is_flown():
    new = [strip('field#1', 0.0), strip('field#2', 20.0)]
    found = match_pieces(new, [record(strip('field#4', 0.0))], [completed(strip('field#5', 0.0))])
    assert found == [MatchedPiece(new[0], 'field#5', flown=True), MatchedPiece(new[1])]


def test_of_a_piece_that_is_flown_in_part_the_rest_is_left_with_its_share():
    new = [strip('field#1', 0.0, value=8.0, service_time=4.0)]
    found, = match_pieces(new, [], [completed(strip('field#3', 0.0, 0.0, 75.0))])
    assert found.task.path == ((75.0, 0.0, 50.0), (100.0, 0.0, 50.0))
    assert (found.known, found.flown) == ('', False)
    assert found.task.position == found.task.path[0]
    assert (found.task.value, found.task.service_time) == pytest.approx((2.0, 1.0))


def test_the_rest_of_a_piece_is_the_one_in_force_with_its_way():
    rest = strip('field#4', 0.0, 60.0, 100.0)
    found = match_pieces([strip('field#1', 0.0)], [record(rest)],
                         [completed(strip('field#3', 0.0, 0.0, 60.0))])
    assert ids(found) == [('field#4', False)]


def test_a_piece_that_is_flown_in_parts_is_left_out():
    parts = [completed(strip('field#3', 0.0, 0.0, 60.0)),
             completed(strip('field#4', 0.0, 60.0, 100.0))]
    assert match_pieces([strip('field#1', 0.0)], [], parts) == []


def test_a_flown_way_counts_for_its_own_piece_only():
    new = [strip('cable#1', 0.0), replace(strip('cable#2', 0.0, 0.0, 50.0), value=3.0)]
    found = match_pieces(new, [], [completed(strip('cable#1', 0.0))])
    assert found == [MatchedPiece(new[0], 'cable#1', flown=True), MatchedPiece(new[1])]
