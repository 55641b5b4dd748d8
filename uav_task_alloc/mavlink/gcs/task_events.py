# SPDX-License-Identifier: Apache-2.0
"""Task events and notes from the progress of the onboard mission; marks for a restart."""
from __future__ import annotations

from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.mavlink.transport.notes import OperatorNote


def task_events(onboard: OnboardMission, watch: AuthorityWatch, now: float) -> list[TaskProgress]:
    """Events of tasks since the last call; completed ones are marked in the authority record."""
    events: list[TaskProgress] = []
    progress, revision = onboard.progress, onboard.revision
    while progress.events:
        event = progress.events.popleft()
        kind = 'COMPLETED' if event.completed else 'STARTED'
        latest = onboard.tasks.revision if event.while_offline and onboard.tasks else (
            onboard.list.revision_with(event.task, revision))
        if event.completed:
            watch.mark_task(event.task, progress.completed.get(event.task), True, now)
        events.append(TaskProgress(event.task, kind, latest))
    while onboard.list.failed:
        failed = onboard.list.failed.popleft()
        events.append(TaskProgress(failed.task, 'FAILED', failed.revision, failed.reason))
    return events


def passed_over(onboard: OnboardMission, watch: AuthorityWatch, now: float) -> list[OperatorNote]:
    """Notes on tasks skipped by another station; unflown ones are marked in the record."""
    progress, notes = onboard.progress, []
    while progress.passed_over:
        item = progress.passed_over.popleft()
        if item.task not in progress.completed:
            watch.mark_task(item.task, item.place, False, now)
    while progress.uncovered:
        task = progress.uncovered.popleft()
        notes.append(OperatorNote('warning', f'{task}: its end was reached, but a part of its '
                                  'way was not flown: that is flown now'))
    while progress.skipped:
        task = progress.skipped.popleft()
        notes.append(OperatorNote('warning', f'{task} was skipped, not by the bridge: '
                          'it is still to be flown'))
    return notes
