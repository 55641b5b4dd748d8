# SPDX-License-Identifier: Apache-2.0
"""Texts of message definitions with all their dependencies, as a recording stores them."""
from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

SEPARATOR = '=' * 80
_FIELD = re.compile(r'([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^]]*\])?\s+[A-Za-z]\w*\s*(?:=|\s|#|$)')
_PRIMITIVE = re.compile(r'bool|byte|char|u?int(8|16|32|64)|float(32|64)|w?string')


@cache
def definition(type_name: str) -> str:
    """Return the text of a message's definition, followed by those of the types of its fields.

    Args:
        type_name: `package/msg/Type`.

    Returns:
        As MCAP stores a schema of encoding `ros2msg` (https://mcap.dev/spec/registry).

    Raises:
        PackageNotFoundError, OSError: a definition is not installed.
    """
    parts, queue, seen = [], [type_name], {type_name}
    while queue:
        name = queue.pop(0)
        package, _, kind = name.split('/')
        text = Path(get_package_share_directory(package), 'msg', f'{kind}.msg').read_text('utf-8')
        parts.append(
            text if name == type_name else f'{SEPARATOR}\nMSG: {package}/{kind}\n{text}')
        for dependency in dependencies(text, package):
            if dependency not in seen:
                seen.add(dependency)
                queue.append(dependency)
    return '\n'.join(parts)


def dependencies(text: str, package: str) -> list[str]:
    """The types of the fields of a message of `package`, without the primitive ones."""
    names = []
    for line in text.splitlines():
        field = _FIELD.match(line.strip())
        if field and not _PRIMITIVE.fullmatch(field[1]):
            *other, kind = field[1].split('/')
            names.append(f'{other[0] if other else package}/msg/{kind}')
    return names
