# SPDX-License-Identifier: Apache-2.0
"""Parser of the docs: the blocks of a page, and the marks that say how to test them.

A mark is a comment on the line before a block, invisible to readers of the page:

    <!-- file: NAME -->    the block is written to NAME, in the working directory of its page
    <!-- until: TEXT -->   the commands stay in the background once they have printed TEXT
    <!-- fails: TEXT -->   the commands end with an error that contains TEXT
    <!-- needs: WHAT -->   WHAT is not available: only names and options are checked
    <!-- says: WHAT -->    an example of output or of a file: not run

Without a mark, `bash` and `python` blocks run, in order, and `yaml` and `json` blocks are parsed.
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
    """The text between two fences."""

    page: Path
    line: int  # of the first fence
    language: str
    text: str
    mark: str = ''
    what: str = ''

    def __str__(self):
        return f'{self.page.relative_to(ROOT)}:{self.line}'


def blocks(page):
    """The blocks of a page in order. Raises AssertionError for an open fence."""
    parsed, mark, opened = [], ('', ''), None
    lines = page.read_text().splitlines()
    for number, line in enumerate(lines, 1):
        fence = _FENCE.match(line)
        if opened is None and fence:
            opened = number, fence[1]
        elif opened is not None and line == '```':
            text = '\n'.join(lines[opened[0]:number - 1]) + '\n'
            parsed.append(Block(page, *opened, text, *mark))
            opened, mark = None, ('', '')
        elif opened is None and line:
            match = _MARK.fullmatch(line)
            mark = match.groups() if match else ('', '')
    assert opened is None, f'{page}:{opened[0]}: expected a closing fence'
    return parsed


def prose(page):
    """The lines of a page outside its blocks, numbered."""
    inside = set()
    for block in blocks(page):
        inside |= set(range(block.line, block.line + block.text.count('\n') + 2))
    return [(number, line) for number, line in enumerate(page.read_text().splitlines(), 1)
            if number not in inside]
