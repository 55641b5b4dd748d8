# SPDX-License-Identifier: Apache-2.0
"""Pages of the docs taken apart into blocks, with what their marks say about how to test them.

A mark is a comment on the line before a block, which a reader of the page does not see:

    <!-- file: NAME -->    the block is written to NAME, in the folder that its page runs in
    <!-- until: TEXT -->   the commands run on in the background, once they have printed TEXT
    <!-- fails: TEXT -->   the commands end with an error that holds TEXT
    <!-- needs: WHAT -->   WHAT is not here: the commands are only looked over
    <!-- says: WHAT -->    not to be run: what commands, files or people say

Without one, `bash` and `python` blocks run, in order, and `yaml` and `json` blocks are read.
"""
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]
LANGUAGES = ('bash', 'python', 'yaml', 'json', 'mermaid', 'text')
MARKS = ('file', 'until', 'fails', 'needs', 'says')
_MARK = re.compile(rf'<!-- ({"|".join(MARKS)}): (.+?) -->')
_FENCE = re.compile(r'```(\w*)$')


@dataclass(frozen=True)
class Block:
    """What stands between two fences."""

    page: Path
    line: int  # of the first fence
    language: str
    text: str
    mark: str = ''
    what: str = ''

    def __str__(self):
        return f'{self.page.relative_to(ROOT)}:{self.line}'


def blocks(page):
    """The blocks of a page in order; AssertionError where a fence stays open."""
    found, mark, opened = [], ('', ''), None
    lines = page.read_text().splitlines()
    for number, line in enumerate(lines, 1):
        fence = _FENCE.match(line)
        if opened is None and fence:
            opened = number, fence[1]
        elif opened is not None and line == '```':
            text = '\n'.join(lines[opened[0]:number - 1]) + '\n'
            found.append(Block(page, *opened, text, *mark))
            opened, mark = None, ('', '')
        elif opened is None and line:
            match = _MARK.fullmatch(line)
            mark = match.groups() if match else ('', '')
    assert opened is None, f'{page}:{opened[0]}: expected a closing fence'
    return found


def prose(page):
    """The lines of a page outside its blocks, numbered."""
    inside = set()
    for block in blocks(page):
        inside |= set(range(block.line, block.line + block.text.count('\n') + 2))
    return [(number, line) for number, line in enumerate(page.read_text().splitlines(), 1)
            if number not in inside]
