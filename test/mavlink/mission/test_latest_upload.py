# SPDX-License-Identifier: Apache-2.0
"""What is known of an upload that runs, was taken, or has ended without an answer."""
import pytest
from flight_bench import flying
from mission_bench import task_list
from test_findings_kills import items_at

from uav_task_alloc.mavlink.mission.diff import DiffKind, MissionDiff
from uav_task_alloc.mavlink.mission.latest_upload import LatestUpload

DIFF = MissionDiff(DiffKind.REPLACE, items_at(0.0, 100.0), 0)
LIST = task_list('AB')


def begun(diff=DIFF):
    upload = LatestUpload()
    upload.begin(diff, LIST, 10.0)
    return upload


def test_an_upload_is_open_until_the_vehicle_has_taken_all_items():
    upload = LatestUpload()
    assert not upload.is_open
    upload.begin(DIFF, LIST, 10.0)
    assert upload.is_open
    assert upload.unknown is DIFF
    upload.note_taken(DIFF, 14.0)
    assert not upload.is_open
    assert upload.running == (DIFF, LIST)  # until it is verified
    upload.end()
    assert upload.running is None


def test_a_mission_that_may_be_stored_is_unknown_until_it_is_read_back():
    upload = begun()
    assert upload.leave(may_be_stored=True) is None
    assert upload.running is None
    assert upload.is_unconfirmed
    assert upload.unknown is DIFF
    assert upload.take_unconfirmed() == (DIFF, LIST)
    assert upload.take_unconfirmed() is None
    assert not upload.is_open


@pytest.mark.parametrize(('taken', 'may_be_stored'), [(False, False), (True, True)])
def test_a_mission_that_was_taken_or_cannot_have_been_is_known(taken, may_be_stored):
    upload = begun()
    if taken:
        upload.note_taken(DIFF, 12.0)
    assert upload.leave(may_be_stored) is DIFF
    assert not upload.is_open


def test_one_without_an_answer_counts_while_the_next_one_is_taken():
    upload = begun(MissionDiff(DiffKind.APPEND, DIFF.items, 0))
    upload.leave(may_be_stored=True)
    upload.begin(DIFF, LIST, 20.0)
    upload.note_taken(DIFF, 22.0)
    assert upload.is_open
    assert upload.appends


def test_nothing_is_open_after_a_restart_of_the_vehicle():
    upload = begun()
    upload.leave(may_be_stored=True)
    upload.begin(DIFF, LIST, 20.0)
    upload.forget()
    assert not upload.is_open
    assert upload.running is None


@pytest.mark.parametrize('kind', ['ardupilot', 'px4'])
def test_a_restart_of_the_vehicle_ends_the_upload_of_its_mission(kind):
    bench = flying(kind, 'ABCD', delay=(0.02, 0.02), tick=0.02)
    bench.assign(task_list('DCBA', 2))
    assert bench.run(lambda: bench.onboard().latest_upload.is_open, 10.0)
    assert bench.onboard().state.name == 'UPLOADING'
    bench.onboard().restarted()
    assert not bench.onboard().latest_upload.is_open
    assert bench.onboard().state.name == 'UNKNOWN'


def test_it_is_outdated_once_there_is_a_later_list():
    upload = begun()
    assert not upload.is_outdated(LIST)
    assert upload.is_outdated(task_list('BC', 2))
    assert not upload.is_outdated(None)
    upload.end()
    assert not upload.is_outdated(task_list('BC', 2))


def test_the_time_of_an_item_is_smoothed():
    upload = begun()
    upload.note_taken(DIFF, 14.0)  # two items in 4 s
    assert upload.item_time == 1.0
    upload.begin(DIFF, LIST, 20.0)
    upload.note_taken(DIFF, 26.0)
    assert upload.item_time == 2.0
