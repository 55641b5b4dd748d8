# SPDX-License-Identifier: Apache-2.0
"""The errors a caller may handle; what can be expected is returned, not raised."""

_LONGEST = 200  # characters of a value that are shown


class AllocError(Exception):
    """Any error of this package."""


class InvalidValue(AllocError, ValueError):
    """A value is outside what it may be; the text names value, expectation and place."""

    def __init__(self, place: str, value: object, expected: str) -> None:
        super().__init__(f'{place} = {shown(value)}: expected {expected}')
        self.place, self.value, self.expected = place, value, expected


def shown(value: object) -> str:
    """A value as a line of text, cut where it is long: whoever sent it may be hostile."""
    text = repr(value)
    return text if len(text) <= _LONGEST else f'{text[:_LONGEST]}... ({len(text)} characters)'


class UnknownName(AllocError, KeyError):
    """A name (solver, UAV, task, parameter) that nobody has declared."""

    def __init__(self, kind: str, name: object, known: object) -> None:
        super().__init__(f'{kind} {name!r}: expected one of {", ".join(map(str, known))}'  # type: ignore[call-overload]
                         if known else f'{kind} {name!r} is unknown')

    def __str__(self) -> str:
        return str(self.args[0])


class ScenarioError(AllocError, ValueError):
    """A scenario file is not as its schema says; the text names file, line and reason."""


class JournalError(AllocError):
    """The journal on disk could not be written or read."""


class JournalCorrupt(JournalError):
    """The file of the journal is damaged, or is none."""


class JournalForeign(JournalError):
    """The journal is not ours to touch: a newer version wrote it, or another process has it."""


class JournalInUse(JournalForeign):
    """Another process has the journal open."""


class OriginMismatch(JournalForeign):
    """The journal is of another origin: its coordinates mean other places."""


class MissionError(AllocError, ValueError):
    """A route cannot be expressed as mission items for a profile; `task` is the one at fault."""

    def __init__(self, text: str, task: str = '') -> None:
        super().__init__(text)
        self.task = task
