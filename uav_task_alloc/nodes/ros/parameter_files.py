# SPDX-License-Identifier: Apache-2.0
"""Parameter files of a command line, checked: ROS ignores what it does not find in them."""
from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from uav_task_alloc.errors import AllocError, first_of

_KEY = 'ros__parameters'
_FLAG = '--params-file'
Sections = Mapping[str, Mapping[str, Any]]  # parameters by the pattern of nodes' names


class ParameterFileError(AllocError, ValueError):
    """A parameter file that cannot be read, or that says nothing about a node.

    Args:
        path: of the file.
        reason: what is wrong.
        expected: what it must be.
    """

    def __init__(self, path: str, reason: str, expected: str = 'a parameter file') -> None:
        self.text = f'{path}: expected {expected}: {reason}'
        super().__init__(f'{_FLAG} {self.text}')


def files_of(argv: Sequence[str]) -> list[str]:
    """The parameter files that a command line names, in order."""
    return [path for flag, path in pairwise(argv) if flag == _FLAG]


def read_sections(path: str) -> Sections:
    """Read a parameter file.

    Returns:
        Parameters by pattern: `/**`, `/**/allocator`, `/fleet/allocator`.

    Raises:
        ParameterFileError: it cannot be read, or contains no `ros__parameters`.
    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except OSError as error:
        raise ParameterFileError(path, str(error.strerror)) from None
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise ParameterFileError(path, ' '.join(str(error).split())) from None
    sections: dict[str, dict[str, Any]] = {}
    for pattern, values in _sections(content):
        if not isinstance(values, dict | None):
            raise ParameterFileError(path, f'{pattern}: {_KEY} = {values!r} are no names and '
                                           'values')
        sections.setdefault(pattern, {}).update(values or {})
    if not sections:
        raise ParameterFileError(path, f'there is no `{_KEY}:` in a section `NODE:`')
    return sections


def _sections(content: Any, above: str = '') -> Iterator[tuple[str, Any]]:
    for key, value in content.items() if isinstance(content, dict) else ():
        if key == _KEY:
            yield above or '/**', value
        else:
            yield from _sections(value, f'{above}/{str(key).strip("/")}')


def check_files(argv: Sequence[str], node: str) -> None:
    """Check that each parameter file has parameters for a node, as ROS reads none otherwise.

    Args:
        argv: the command line.
        node: fully qualified name, `/fleet/allocator`.

    Raises:
        ParameterFileError: a file cannot be read, or is for other nodes only.
    """
    for path in files_of(argv):
        patterns = list(read_sections(path))
        if not any(_matches(pattern, node) for pattern in patterns):
            raise ParameterFileError(path, f'it is for {first_of(patterns)}',
                                     f'parameters for {node} or /**')


def shared_names(argv: Sequence[str]) -> set[str]:
    """The names of parameters that files give to all nodes: `/**`, `/*`."""
    return {name for path in files_of(argv)
            for pattern, values in read_sections(path).items() if pattern.endswith('*')
            for name in _flat(values)}


def _flat(values: Mapping[str, Any], above: str = '') -> Iterator[str]:
    """`origin: {latitude: 1.0}` is origin.latitude."""
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f'{above}{key}.')
        else:
            yield f'{above}{key}'


def _matches(pattern: str, node: str) -> bool:
    """Whether the pattern of a section includes a node: `*` is one level, `**` any number."""
    parts = ('(/[^/]+)*' if part == '**' else '/[^/]+' if part == '*' else '/' + re.escape(part)
             for part in pattern.strip('/').split('/'))
    return re.fullmatch(''.join(parts), node) is not None
