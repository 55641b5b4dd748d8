# SPDX-License-Identifier: Apache-2.0
"""Ids of a scenario from the names in map files: letters, digits and _, each once of its kind."""
from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from uav_task_alloc.errors import counted


class ScenarioIds:
    """The ids that are taken, and which names had to be changed.

    Args:
        taken: by kind: `tasks`, `zones` or `uavs`.
    """

    def __init__(self, taken: Mapping[str, Iterable[object]]) -> None:
        self._taken = {kind: set(ids) for kind, ids in taken.items()}
        self._changed: list[str] = []  # file and element, and its id

    def take(self, kind: str, name: str, where: str) -> str:
        """Take the id of a new element.

        Args:
            kind: of its row.
            name: '' for none.
            where: file and element, for the note of a changed name.

        Returns:
            The name as scenarios allow it, that nothing else of the kind has.
        """
        stem = re.sub(r'[^A-Za-z0-9]+', '_', name).strip('_') or kind[:-1]
        stem = stem if stem[0].isalpha() else f'{kind[0]}{stem}'
        identifier, number = stem, 2
        while identifier in self._taken[kind]:
            identifier, number = f'{stem}_{number}', number + 1
        self._taken[kind].add(identifier)
        if name and identifier != name:
            self._changed.append(f'{where}: its id is {identifier}')
        return identifier

    def notes(self) -> list[str]:
        """The first name that was changed, and how many more; empty where none was."""
        more = len(self._changed) - 1
        others = f'; {counted(more, "more name")} {"is" if more == 1 else "are"} changed'
        return [text + others * bool(more) for text in self._changed[:1]]
