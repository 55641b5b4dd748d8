# SPDX-License-Identifier: Apache-2.0
"""Tasks begun, completed, failed or passed over on board, as events; marked for a restart."""
from __future__ import annotations

from uav_task_alloc.mavlink.gcs.authority_watch import AuthorityWatch
from uav_task_alloc.mavlink.gcs.onboard_mission import OnboardMission
from uav_task_alloc.mavlink.mission.task_progress import TaskProgress
from uav_task_alloc.mavlink.transport.notes import OperatorNote


def task_events(onboard: OnboardMission, watch: AuthorityWatch, now: float) -> list[TaskProgress]:
    """What became of tasks since the last call; each that is completed is marked in the record."""
    events, progress, revision = [], onboard.progress, onboard.revision
    while progress.events:
        made = progress.events.popleft()
        event = 'COMPLETED' if made.completed else 'STARTED'
        latest = onboard.tasks.revision if made.while_offline and onboard.tasks else revision
        if made.completed:
            watch.mark_task(made.task, progress.completed.get(made.task), True, now)
        events.append(TaskProgress(made.task, event, latest))
    while onboard.failed:
        failed = onboard.failed.popleft()
        events.append(TaskProgress(failed.task, 'FAILED', failed.revision, failed.reason))
    return events


def passed_over(onboard: OnboardMission, watch: AuthorityWatch, now: float) -> list[OperatorNote]:
    """Notes of tasks passed over since the last call; what was left is marked in the record."""
    progress, notes = onboard.progress, []
    while progress.passed_over:
        item = progress.passed_over.popleft()
        if item.task not in progress.completed:
            watch.mark_task(item.task, item.position, False, now)
    while progress.skipped:
        task = progress.skipped.popleft()
        notes.append(OperatorNote('warning', f'{task} was passed over, not by the bridge: '
                          'it is still to be flown'))
    return notes
