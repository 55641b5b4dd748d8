# SPDX-License-Identifier: Apache-2.0
"""The house speaks one language: words, names, the glossary and the map of rooms are true."""
import ast
import importlib.util
import re
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / 'uav_task_alloc'
FILES = sorted(PACKAGE.rglob('*.py'))
TEXTS = sorted({*FILES, ROOT / 'README.md', *(
    path for folder in ('docs', 'config', 'msg_defs', 'launch', 'uav_task_alloc/live/page')
    for path in (ROOT / folder).rglob('*')
    if path.suffix in ('.md', '.rst', '.yaml', '.msg', '.srv', '.py', '.js', '.html'))})
# images and old names that a reader of ROS 2, MAVLink and routing texts would stumble over
WORDS = ('told', 'heard', 'anew', 'laid', 'deaf', 'behind', 'helm', 'teller', 'keeper', 'painter',
         'gulps?', 'pity', 'recall', 'reminder', 'rehearsal', 'habits', 'twin', 'by and by',
         'hurry', 'cautious', 'worries', 'by itself')
GONE = re.compile(rf'\b({"|".join(WORDS)})\b', re.IGNORECASE)
# the same meaning wherever they are: entry points, and the solvers of one registry
SAME_MEANING = {'main', 'solve'}
ALLOWED_TWICE: set[str] = set()  # at most five


def definitions(path):
    """Public names that a module defines at its top level."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, ast.Assign):
            yield from (part.id for target in node.targets
                        for part in getattr(target, 'elts', [target])
                        if isinstance(part, ast.Name))
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.target.id


def test_no_word_of_a_private_language_is_left():
    assert len(TEXTS) > 400
    assert [f'{path.relative_to(ROOT)}:{number}: {line.strip()}' for path in TEXTS
            for number, line in enumerate(path.read_text().splitlines(), 1)
            if GONE.search(re.sub('_', ' ', line))] == []


def test_no_word_of_a_private_language_is_in_the_unreleased_changes():
    section = (ROOT / 'CHANGELOG.md').read_text().split('\n## ')[1]
    assert section.startswith('Unreleased')
    lines = re.sub('`[^`]*`', '', section).splitlines()  # keys of former versions may be named
    assert [line for line in lines if GONE.search(line)] == []


def test_a_top_level_name_has_one_meaning():
    where = defaultdict(set)
    for path in FILES:
        for name in definitions(path):
            if not name.startswith('_'):
                where[name].add(path.relative_to(PACKAGE).as_posix())
    twice = {name: sorted(places) for name, places in where.items()
             if len(places) > 1 and name not in SAME_MEANING | ALLOWED_TWICE}
    assert twice == {}
    assert len(ALLOWED_TWICE) <= 5


def test_files_and_functions_are_short():
    long = []
    for path in [*FILES, *sorted((ROOT / 'test').rglob('*.py'))]:
        text = path.read_text()
        lengths = [(node.name, node.end_lineno - node.lineno + 1 - described(node))
                   for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
        long += [(path.relative_to(ROOT), name, lines) for name, lines in lengths if lines > 40]
        long += [path.relative_to(ROOT)] * (len(text.splitlines()) > 400)
    assert long == []


def described(node):
    """Lines of a docstring."""
    first = node.body[0]
    return first.end_lineno - first.lineno + 1 if ast.get_docstring(node) else 0


def test_each_class_of_the_glossary_is_where_it_says():
    text = (ROOT / 'docs' / 'glossary.md').read_text()
    names = re.findall(r'`((?:\w+\.)+[A-Z]\w+)`', text)
    assert len(names) > 40
    wrong = []
    for name in names:
        module, _, cls = name.rpartition('.')
        path = PACKAGE / (module.replace('.', '/') + '.py')
        if not path.exists() or cls not in definitions(path):
            wrong.append(name)
    assert wrong == []


def test_the_map_of_rooms_names_each_file_and_none_that_is_gone():
    text = (ROOT / 'docs' / 'architecture.md').read_text()
    named = set(re.findall(r'`((?!test/)(?:\w+/)*\w+\.py)`', text))
    there = {path.relative_to(PACKAGE).as_posix() for path in FILES if path.stem != '__init__'}
    assert (sorted(there - named), sorted(named - there)) == ([], [])


def test_the_map_of_rooms_is_as_generated():
    spec = importlib.util.spec_from_file_location('file_index', ROOT / 'tools/docs/file_index.py')
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    assert tool.page_text() == tool.PAGE.read_text(), 'run `make docs`'


def test_the_table_of_questions_names_files_that_answer_them():
    text = (ROOT / 'docs' / 'architecture.md').read_text().partition('## Where is')[2]
    text = text.partition('## Rooms')[0]
    rows = [re.split(r' *\| *', line.strip('| ')) for line in text.splitlines()
            if line.startswith('| ') and '?' in line]
    assert len(rows) >= 30
    wrong = []
    for question, file, names, *_ in rows:
        path = PACKAGE / file.strip('`')
        source = path.read_text() if path.exists() else ''
        wrong += [(question, name) for name in re.findall(r'`(\w+)`', names)
                  if not re.search(rf'\b(def|class) {name}\b|^{name}\b', source, re.MULTILINE)]
        wrong += [] if re.findall(r'`(\w+)`', names) and source else [(question, file)]
    assert wrong == []
