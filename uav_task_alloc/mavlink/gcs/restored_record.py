# SPDX-License-Identifier: Apache-2.0
"""Passes what the previous run of the bridge recorded of a vehicle to the parts that continue."""
from __future__ import annotations

from uav_task_alloc.mavlink.autopilots import ModeFunction, Profile
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.mission.flown_path import PositionSample

_SEEN = 7  # values of a position in the authority record


def restore_record(record: AuthorityRecord | None, onboard: OnboardMission,
                   watch: AuthorityWatch, profile: Profile) -> None:
    """Pass a record on, before the first message of this run.

    Args:
        record: of the previous run; None: this is the first one.
        onboard: of the vehicle, whose progress is continued.
        watch: of the vehicle, with the marks of the record.
        profile: of its autopilot.
    """
    resume = onboard.resume
    if record is not None:
        onboard.list.stored_pieces, resume.recorded_upload = record.pieces, record.uploading
        resume.recorded = record.mission, record.current, record.arrived
        resume.passed, onboard.progress.coverage.recorded = record.passed, True
        resume.flown.ahead = {mark.task: mark[1:4] for mark in record.ahead}
        for mark in record.ahead:
            if mark.flown:
                resume.flown.seen_passed.add(mark.task, mark[1:4])
        for first in range(0, len(record.seen) - _SEEN + 1, _SEEN):
            t, x, y, z, east, north, up = record.seen[first:first + _SEEN]
            resume.note_seen(PositionSample(t, (x, y, z), (east, north, up)))
        resume.was_disarmed, resume.was_in_mission = not record.armed, (
            profile.mode_function(record.mode or 0) is ModeFunction.MISSION)
        # the current item may be of the replaced mission, or set by another party
        resume.was_replacing = not profile.atomic and bool(record.uploading) and (
            record.replacing_since is not None or not resume.was_in_mission)
        resume.current_unreliable = resume.was_replacing or (
            record.state is AuthorityState.LOST and not resume.was_in_mission)
    for mark in watch.marks.values():
        resume.flown.note_mark(mark.task, mark[1:4], mark.flown)
