# SPDX-License-Identifier: Apache-2.0
"""The errors that a caller may handle; expected failures are returned, not raised."""

from collections.abc import Iterable

_MAX_SHOWN = 200  # characters of a value that are shown


class AllocError(Exception):
    """Base of all errors of this package."""


class InvalidValue(AllocError, ValueError):
    """A value is out of range or of the wrong type; the text names place, value and expectation.

    Args:
        place: name of the value: 'task t1: position'.
        value: shortened where it is long.
        expected: what it must be: 'three finite coordinates [m]'.
    """

    def __init__(self, place: str, value: object, expected: str) -> None:
        super().__init__(f'{place} = {shown(value)}: expected {expected}')
        self.place, self.value, self.expected = place, value, expected


def shown(value: object) -> str:
    """Show a value as one line of text, shortened where it is long: input may be hostile.

    Args:
        value: of any kind.

    Returns:
        Its repr, at most some 230 characters.
    """
    try:
        text = repr(value).replace('\n', ' ')  # of an array it has several lines
    except Exception:  # of an integer of thousands of digits, for one
        text = f'a value of type {type(value).__name__}'
    return text if len(text) <= _MAX_SHOWN else f'{text[:_MAX_SHOWN]}... ({len(text)} characters)'


def first_of(texts: Iterable[str], most: int = 5, separator: str = ', ', kind: str = '') -> str:
    """The first texts of a list, and how many more there are: `a, b, c and 4 more`.

    Args:
        texts: of the whole list.
        most: how many are shown.
        separator: between two.
        kind: follows the number: `and 4 more UAVs` for ' UAVs'.

    Returns:
        One text; '' for no texts.
    """
    listed = list(texts)
    more = len(listed) - most
    return separator.join(listed[:most]) + (f' and {more} more{kind}' if more > 0 else '')


def counted(number: int, word: str) -> str:
    """A number of things in words: `1 task`, `2 tasks`.

    Args:
        number: of them.
        word: for one; its plural ends with s.

    Returns:
        The number and the word.
    """
    return f'{number} {word}' + 's' * (number != 1)


def damage(error: Exception) -> str:
    """Why a document that others wrote cannot be read, for an error text.

    Args:
        error: raised where a value was taken from it.

    Returns:
        One line; of an error of any other kind its name and text.
    """
    if isinstance(error, KeyError):
        return f'{shown(error.args[0] if error.args else "")} is missing'
    if isinstance(error, IndexError):
        return 'a list is too short'
    if isinstance(error, (TypeError, AttributeError)):
        return f'a value is of another kind ({error})'
    return f'{type(error).__name__}: {error}'


class UnknownName(AllocError, KeyError):
    """A name of a solver, UAV, task or parameter that is not declared.

    Args:
        kind: of thing: 'solver'.
        name: as given.
        known: names that are declared; empty: they are not listed.
    """

    def __init__(self, kind: str, name: object, known: object) -> None:
        super().__init__(f'{kind} {name!r}: expected one of {", ".join(map(str, known))}'  # type: ignore[call-overload]
                         if known else f'{kind} {name!r} is unknown')

    def __str__(self) -> str:
        return str(self.args[0])


class ScenarioError(AllocError, ValueError):
    """A scenario file violates its schema; the text names file, line and reason."""


class JournalError(AllocError):
    """The journal on disk cannot be written or read."""


class JournalCorrupt(JournalError):
    """The journal file is corrupt or not a journal."""


class JournalUnreadable(JournalError):
    """The journal is there, but cannot be read: what it holds would be forgotten."""


class JournalForeign(JournalError):
    """The journal must not be changed: a newer version or another program wrote it."""


class JournalInUse(JournalForeign):
    """Another process has the journal open."""


class OriginMismatch(JournalForeign):
    """The journal has another origin: its coordinates are other positions."""


class MissionError(AllocError, ValueError):
    """A route cannot be expressed as mission items for an autopilot.

    Args:
        text: the reason.
        task: id of the task at fault; '' for none.
    """

    def __init__(self, text: str, task: str = '') -> None:
        super().__init__(text)
        self.task = task
