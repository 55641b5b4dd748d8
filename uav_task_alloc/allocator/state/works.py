# SPDX-License-Identifier: Apache-2.0
"""Work that is flown in pieces: cut when it is accepted, and again when zones or content change.

A piece is a task of the registry. What is flown is never cut again: a new cut leaves out the ways
of the pieces that are COMPLETED.
"""
from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from uav_task_alloc.allocator.records import TaskRecord, TaskState, TaskVerdict
from uav_task_alloc.allocator.state.flown_strips import pieces_around_flown
from uav_task_alloc.allocator.state.matched_pieces import MatchedPiece, match_pieces
from uav_task_alloc.allocator.state.task_state_machine import TaskTransition
from uav_task_alloc.allocator.state.tasks import MAX_OPEN, UNCHANGED, TaskRegistry
from uav_task_alloc.allocator.state.work_state import record_of_whole, state_of_pieces
from uav_task_alloc.allocator.work_records import WorkRecord
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.model import Task
from uav_task_alloc.piece_ids import piece_id, split_piece
from uav_task_alloc.terrain import TerrainError
from uav_task_alloc.work.area import NOTHING_FLOWN, FlownStrips
from uav_task_alloc.work.pieces import Work
from uav_task_alloc.work.recut import FlownWays, main_direction
from uav_task_alloc.work.values import Kind

CutWork = Callable[[Work, FlownStrips], Sequence[Task]]
_NO_CUT = InvalidValue, TerrainError


class Works:
    """Accepted work by task id.

    Args:
        tasks: has the pieces.
        saved: restored from the journal.
        cut: cuts work around the present zones; may raise InvalidValue or TerrainError.
        refusal: (piece, stamp) -> why it cannot be kept, '' if it may be.

    Arguments of methods:
        work: as announced.
        task_id: of work, or of any task where the text says so.
        stamp: [s] clock of the node.
        why: that pieces are cut again.
        known: accepted work.
    """

    def __init__(self, tasks: TaskRegistry, saved: Iterable[WorkRecord], cut: CutWork,
                 refusal: Callable[[Task, float], str]) -> None:
        self._tasks, self._cut, self._refusal = tasks, cut, refusal
        self.records = {record.id: record for record in saved}
        self.unsaved: set[str] = set()  # not yet on disk
        self._drop_orphans()

    def _drop_orphans(self) -> None:
        """Forget pieces whose work is not in the journal: a crash was between the two rows."""
        self._tasks.forget([task_id for task_id in self._tasks.records
                            if split_piece(task_id)[1]
                            and split_piece(task_id)[0] not in self.records])

    # announcements

    def add(self, work: Work, stamp: float) -> TaskVerdict:
        """Accept and cut new work; a replay changes nothing."""
        known = self.records.get(work.task.id)
        if known is not None:
            return self._known_again(known, work)
        if work.task.id in self._tasks.records:
            return TaskVerdict(work.task.id, False,
                               'duplicate id: another task was announced under it')
        try:
            pieces = self._cut(work, NOTHING_FLOWN)
        except _NO_CUT as error:
            return self._tasks.reject(work.task.id, str(error), stamp)
        whys = [self._refusal(piece, stamp) for piece in pieces]
        if self._tasks.open_count + len(pieces) > MAX_OPEN:
            whys = [_no_room()]
        if all(whys):
            return self._tasks.reject(work.task.id, whys[0], stamp)
        self._tasks.rejected.pop(work.task.id, None)
        for piece in pieces:
            self._tasks.add_new(piece, stamp)
        self._put(WorkRecord(work, work, tuple(piece.id for piece in pieces), len(pieces)))
        return TaskVerdict(work.task.id, True)

    def _known_again(self, known: WorkRecord, work: Work) -> TaskVerdict:
        state = self.state(known)
        ended = '' if self.is_open(known.id) else f': it is {state.name}'
        if work in (known.work, known.announced):
            return TaskVerdict(known.id, True, UNCHANGED + ended)
        return TaskVerdict(known.id, False,
                           f'duplicate id: another task was announced under it{ended}')

    def refuse_point(self, task_id: str) -> TaskVerdict:
        """Refuse a point that has the id of work."""
        kind = self.records[task_id].work.kind.name
        return TaskVerdict(task_id, False, f'duplicate id: {task_id} was announced as {kind}')

    def update(self, work: Work, stamp: float) -> TaskVerdict:
        """Replace the content of work; pieces that are flown stay as they are."""
        known = self.records.get(work.task.id)
        if known is None and work.task.id in self._tasks.records:
            return TaskVerdict(work.task.id, False, str(InvalidValue(
                'kind', work.kind.name, 'POINT, as it was announced')))
        if known is None:
            return self._tasks.update(work.task, stamp)  # refuses it
        state = self.state(known)
        if state in (TaskState.COMPLETED, TaskState.CANCELLED):
            return TaskVerdict(known.id, False, f'is {state.name}: nothing to update')
        if work == known.work and self.is_open(known.id):
            return TaskVerdict(known.id, True, UNCHANGED)
        new = known.updated(work)
        try:
            pieces = self._cut_rest(new) if self._flown(new) else self._cut(work, NOTHING_FLOWN)
        except _NO_CUT as error:
            return TaskVerdict(known.id, False, str(error))
        whys = [self._refusal(piece, stamp) for piece in pieces]
        if whys and all(whys):
            return TaskVerdict(known.id, False, whys[0])
        matched = self._matched(new, pieces)
        if not self._has_room(new, matched, renew=True):
            return TaskVerdict(known.id, False, _no_room())
        self._recut(new, matched, stamp, 'changed', renew=True)
        return TaskVerdict(known.id, True)

    def cancel(self, task_id: str, stamp: float) -> TaskVerdict:
        """Withdraw all pieces that are not flown."""
        if self._lacks_pieces(self.records[task_id]):
            self._recut_one(self.records[task_id], stamp, 'restart')
        known = self.records[task_id]
        state = self.state(known)
        if state is TaskState.CANCELLED:
            return TaskVerdict(task_id, True, UNCHANGED)
        if state is TaskState.COMPLETED:
            return TaskVerdict(task_id, False, 'is COMPLETED: nothing to cancel')
        present = self._present(known)
        for record in present:
            if record.state is not TaskState.COMPLETED:
                self._tasks.step(record.task.id, TaskTransition.CANCEL, stamp)
        self._put(replace(known, pieces=tuple(record.task.id for record in present)))
        return TaskVerdict(task_id, True)

    # cutting again

    def recut_all(self, stamp: float, why: str) -> list[str]:
        """Cut all open work again, as zones have changed.

        Returns:
            The ids of work whose pieces have changed.
        """
        return [known.id for known in list(self.records.values())
                if (self.is_open(known.id) or self._lacks_pieces(known))
                and self._recut_one(known, stamp, why)]

    def _lacks_pieces(self, known: WorkRecord) -> bool:
        """Whether a crash was between the row of the work and those of its pieces."""
        return any(each not in self._tasks.records for each in known.pieces)

    def _recut_one(self, known: WorkRecord, stamp: float, why: str) -> bool:
        try:
            pieces = self._cut_rest(known)
        except _NO_CUT:
            return False  # too many pieces with these zones, or no terrain: it stays as it is
        matched = self._matched(known, pieces)
        return self._has_room(known, matched) and self._recut(known, matched, stamp, why)

    def _cut_rest(self, known: WorkRecord) -> Sequence[Task]:
        """Cut work as it was cut before; raises as the cut does."""
        work = self._as_cut(known)
        return pieces_around_flown(
            work, self._cut(work, NOTHING_FLOWN), FlownStrips(tuple(
                (record.task.path, known.strip_width(split_piece(record.task.id)[1]))
                for record in self._flown(known))), lambda flown: self._cut(work, flown))

    def _flown(self, known: WorkRecord) -> list[TaskRecord]:
        return [record for record in self._present(known) if record.state is TaskState.COMPLETED]

    def _as_cut(self, known: WorkRecord) -> Work:
        """The work with the direction that its strips have."""
        work, paths = known.work, [record.task.path for record in self._present(known)]
        if work.kind is not Kind.AREA or work.direction is not None or not paths:
            return work
        return replace(work, direction=main_direction(paths))

    def _matched(self, known: WorkRecord, pieces: Sequence[Task]) -> list[MatchedPiece]:
        """The pieces of a new cut against those in force."""
        unflown = [record for record in self._present(known)
                   if record.state is not TaskState.COMPLETED]
        # flown strips that were narrower count for what they have covered only
        wide = [record for record in self._flown(known) if not _is_narrow(known, record.task.id)]
        return match_pieces(pieces, unflown, wide)

    def _has_room(self, known: WorkRecord, matched: Sequence[MatchedPiece],
                  renew: bool = False) -> bool:
        """Whether a cut opens no more pieces than there are, or than may be open with all tasks.

        `renew`: pieces that have failed are opened again.
        """
        before = {record.task.id for record in self._present(known) if record.open}
        after = sum(not found.flown and (renew or not found.known or found.known in before)
                    for found in matched)
        return after <= max(len(before), MAX_OPEN - self._tasks.open_count + len(before))

    def _recut(self, known: WorkRecord, matched: Sequence[MatchedPiece], stamp: float, why: str,
               renew: bool = False) -> bool:
        """Take over a new cut: equal pieces keep their ids, and what is flown is left out."""
        present = {record.task.id: record for record in self._present(known)}
        stay = {found.known for found in matched}
        ended = [each for each in known.pieces if each in present and each not in stay
                 and present[each].state is TaskState.COMPLETED]
        gone = [each for each in present if each not in stay and each not in ended]
        for each in gone:
            self._tasks.step(each, TaskTransition.REPLACE, stamp, why=why)
        kept, last, changed = list[str](), known.last, bool(gone)
        for found in matched:
            task_id = found.known
            if not task_id:
                last, changed = last + 1, True
                task_id = piece_id(known.id, last)
                self._tasks.add_new(replace(found.task, id=task_id), stamp)
            elif renew and not found.flown:
                changed |= self._renew(present[task_id], found.task, stamp)
            kept.append(task_id)
        self._put(replace(known, pieces=(*ended, *kept), last=last))
        return changed

    def _renew(self, record: TaskRecord, part: Task, stamp: float) -> bool:
        """Give a piece the content of a new cut; its way stays as it was."""
        task = replace(part, id=record.task.id, position=record.task.position,
                       path=record.task.path)
        if task == record.task and record.open:
            return False
        self._tasks.step(task.id, TaskTransition.UPDATE, stamp, record.uav, record.reason,
                         task=task, failed_on=())
        return True

    def is_replaced(self, task_id: str) -> bool:
        """Return whether a task is a piece that was cut again, and may still be flown."""
        whole, piece = split_piece(task_id)
        known = self.records.get(whole)
        return bool(piece) and known is not None and (
            task_id in self._tasks.records and task_id not in known.pieces)

    def flown_after_all(self, task_id: str, uav_id: str, stamp: float) -> bool:
        """Count the way of a replaced piece as flown; the rest is cut without it.

        Work that has ended is not cut again.

        Args:
            task_id: of the replaced piece.
            uav_id: that has flown it.

        Returns:
            Whether any of it was not flown before; False for a strip that was cut for a smaller
            strip_width, which leaves a part of the new one.
        """
        known, task = self.records[split_piece(task_id)[0]], self._tasks.records[task_id].task
        if _is_narrow(known, task_id) or not FlownWays(
                record.task.path for record in self._flown(known)).unflown_parts(task.path):
            return False
        is_open, last = self.is_open(known.id), known.last + 1
        self._tasks.add_completed(replace(task, id=piece_id(known.id, last)), uav_id, stamp)
        known = replace(known, pieces=(*known.pieces, piece_id(known.id, last)), last=last)
        self._put(known)
        if is_open:
            self._recut_one(known, stamp, 'flown as it was cut before')
        return True

    # questions

    def _present(self, known: WorkRecord) -> list[TaskRecord]:
        return [self._tasks.records[each] for each in known.pieces
                if each in self._tasks.records]

    def is_open(self, task_id: str) -> bool:
        """Return whether work has pieces that are still to be flown."""
        return any(record.open for record in self._present(self.records[task_id]))

    def open_pieces(self, task_id: str) -> tuple[str, ...]:
        """Return the ids of the pieces that are still to be flown; of a point its own id."""
        known = self.records.get(task_id)
        if known is None:
            return (task_id,)
        return tuple(record.task.id for record in self._present(known) if record.open)

    def state(self, known: WorkRecord) -> TaskState:
        """Return the state of accepted work, as its pieces have it."""
        return state_of_pieces(self._present(known))

    def whole_record(self, known: WorkRecord) -> tuple[TaskRecord, int]:
        """Return accepted work as the record of one task, see `record_of_whole`."""
        return record_of_whole(known, self._present(known))

    # forgetting

    def all_pieces(self) -> set[str]:
        """Return the ids of the pieces of all work, which are forgotten with it only."""
        return {each for known in self.records.values() for each in known.pieces}

    def forget_ended(self, keep: int, listed: Iterable[str]) -> set[str]:
        """Forget the oldest work that has ended, until it has at most `keep` pieces.

        Args:
            keep: pieces of ended work that stay.
            listed: tasks that are still in a list, whose work stays, too.

        Returns:
            The ids of the pieces that were forgotten.
        """
        busy = {split_piece(task_id)[0] for task_id in listed}
        ended = sorted((known for known in self.records.values()
                        if known.id not in busy and not self.is_open(known.id)),
                       key=lambda known: self.whole_record(known)[0].stamp)
        excess = sum(len(known.pieces) for known in ended) - keep
        gone: set[str] = set()
        for known in ended:
            if excess <= 0:
                break
            excess -= len(known.pieces)
            gone.update(task_id for task_id in self._tasks.records
                        if split_piece(task_id)[0] == known.id)
            del self.records[known.id]
            self.unsaved.add(known.id)
        self._tasks.forget(gone)
        return gone

    def _put(self, record: WorkRecord) -> None:
        self.records[record.id] = record
        self.unsaved.add(record.id)


def _no_room() -> str:
    return f'open tasks and pieces: expected at most {MAX_OPEN}'


def _is_narrow(known: WorkRecord, task_id: str) -> bool:
    """Whether a strip was cut for a smaller strip_width than the present one."""
    return known.strip_width(split_piece(task_id)[1]) < known.work.strip_width
