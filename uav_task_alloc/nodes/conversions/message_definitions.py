# SPDX-License-Identifier: Apache-2.0
"""The text of message types with all they are made of, as a recording carries it."""
from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

RULE = '=' * 80
_FIELD = re.compile(r'([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^]]*\])?\s+[A-Za-z]\w*\s*(?:=|\s|#|$)')
_SIMPLE = re.compile(r'bool|byte|char|u?int(8|16|32|64)|float(32|64)|w?string')


@cache
def definition(type_name: str) -> str:
    """Of `package/msg/Type`. PackageNotFoundError or OSError where its file is not installed."""
    parts, todo, seen = [], [type_name], {type_name}
    while todo:
        name = todo.pop(0)
        package, _, kind = name.split('/')
        text = Path(get_package_share_directory(package), 'msg', f'{kind}.msg').read_text('utf-8')
        parts.append(text if name == type_name else f'{RULE}\nMSG: {package}/{kind}\n{text}')
        for part in used(text, package):
            if part not in seen:
                seen.add(part)
                todo.append(part)
    return '\n'.join(parts)


def used(text: str, package: str) -> list[str]:
    """The types of the fields of a message of `package`, apart from the simple ones."""
    found = []
    for line in text.splitlines():
        field = _FIELD.match(line.strip())
        if field and not _SIMPLE.fullmatch(field[1]):
            *given, kind = field[1].split('/')
            found.append(f'{given[0] if given else package}/msg/{kind}')
    return found
