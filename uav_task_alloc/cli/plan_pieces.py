# SPDX-License-Identifier: Apache-2.0
"""A scenario cut into pieces for `plan`, and ids of pieces in short: `field strips 1-7`."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby

from uav_task_alloc.piece_ids import split_piece
from uav_task_alloc.scenario.values import Scenario, TimedTask
from uav_task_alloc.terrain import Terrain
from uav_task_alloc.work.pieces import pieces_of
from uav_task_alloc.work.values import Kind

_WORDS = {Kind.LINE: 'part', Kind.AREA: 'strip', Kind.ORBIT: 'arc'}


def with_pieces(loaded: Scenario, terrain: Terrain | None = None) -> Scenario:
    """Cut the work of a scenario into pieces, around all its zones.

    Args:
        loaded: with tasks of any kind.
        terrain: the ground, for work whose heights are above it.

    Returns:
        With a task for each piece; points stay what they are.

    Raises:
        InvalidValue: there would be too many pieces, or the ground is not known.
        TerrainError: the terrain does not reach as far.
    """
    zones = loaded.no_fly_zones()
    return replace(loaded, tasks=tuple(
        TimedTask(timed.at, piece, timed.work) for timed in loaded.tasks for piece in (
            pieces_of(timed.work, zones, loaded.clearance, terrain) if timed.work
            else (timed.task,))))


def piece_kinds(loaded: Scenario) -> dict[str, str]:
    """What the pieces of a whole task are called, by its id: part, strip or arc.

    A task of one piece is not among them: its own id says all.

    Args:
        loaded: as `with_pieces` returns it.
    """
    return {split_piece(timed.task.id)[0]: _WORDS[timed.work.kind] for timed in loaded.tasks
            if timed.work is not None and split_piece(timed.task.id)[1] > 1}


def short_names(names: Iterable[str], kinds: dict[str, str]) -> list[str]:
    """Ids of tasks and pieces in their order, pieces of one task in a row as one text.

    Args:
        names: ids.
        kinds: as `piece_kinds` returns them.

    Returns:
        'field strips 1-3, 7' for field#1, field#2, field#3 and field#7 in a row.
    """
    found = []
    for whole, group in groupby(map(split_piece, names), lambda each: each[0]):
        numbers = [number for _, number in group]
        if whole in kinds and numbers != [0]:
            plural = 's' * (len(numbers) > 1)
            found.append(f'{whole} {kinds[whole]}{plural} {_runs(numbers)}')
        else:
            found.append(whole)
    return found


def _runs(numbers: Sequence[int]) -> str:
    """Numbers in their order, runs up or down as their ends: 1-3, 7, 6-4."""
    parts: list[list[int]] = []
    for number in numbers:
        last = parts[-1] if parts else []
        step = last[1] - last[0] if len(last) > 1 else 0
        if last and number - last[-1] in ((step,) if step else (1, -1)):
            last.append(number)
        else:
            parts.append([number])
    return ', '.join(f'{part[0]}-{part[-1]}' if len(part) > 2 else ', '.join(map(str, part))
                     for part in parts)
