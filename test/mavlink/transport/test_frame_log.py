# SPDX-License-Identifier: Apache-2.0
"""Unbounded frame numbers of 8-bit sequence numbers, with silences and late frames."""
import pytest

from uav_task_alloc.mavlink.transport.frame_log import FrameLog


def log_of(rate, seconds):
    """A log after some seconds of frames at a rate [1/s], the time [s], and the newest number."""
    log = FrameLog()
    for number in range(int(rate * seconds)):
        newest = log.note(number % 256, number / rate)
    return log, seconds, newest


@pytest.mark.parametrize('late', [1, 8, 100])
def test_a_late_frame_that_ends_a_short_silence_keeps_its_number(late):
    log, now, newest = log_of(14.0, 20.0)
    assert log.note((newest - late) % 256, now + 2.1) == newest - late
    assert log.note((newest + 31) % 256, now + 2.2) == newest + 31
    assert not log.whole(newest, newest + 31)


@pytest.mark.parametrize(('rate', 'silence'), [(14.0, 10.0), (100.0, 1.5)])
def test_a_silence_in_which_the_numbers_may_have_wrapped_has_missing_frames(rate, silence):
    log, now, newest = log_of(rate, 20.0)
    number = log.note((newest + 1) % 256, now + silence)
    assert number == newest + 257
    assert not log.whole(newest, number)


def test_a_silence_at_an_unknown_rate_has_missing_frames():
    log, now, newest = log_of(14.0, 3.0)
    assert log.note((newest + 1) % 256, now + 2.0) == newest + 257


def test_a_silence_lasts_through_frames_that_come_late():
    log, now, newest = log_of(14.0, 20.0)
    for at, late in ((2.0, 34), (3.9, 15)):
        assert log.note((newest - late) % 256, now + at) == newest - late
    assert log.note((newest + 170) % 256, now + 11.2) == newest + 170
