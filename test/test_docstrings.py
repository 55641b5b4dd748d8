# SPDX-License-Identifier: Apache-2.0
"""Docstrings of what a room offers to others: arguments with units and shapes, results, fields."""
import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / 'uav_task_alloc'
SOURCES = {path: path.read_text() for path in sorted(PACKAGE.rglob('*.py'))}
MODULES = {'.'.join(path.relative_to(PACKAGE.parent).with_suffix('').parts)
           .removesuffix('.__init__'): path for path in SOURCES}


@cache
def tree(path):
    """The syntax tree of a file; parsed in the one process that runs these tests."""
    return ast.parse(SOURCES[path])


@cache
def nodes(path):
    """All nodes of that tree."""
    return list(ast.walk(tree(path)))


def used_names(user):
    """(module, name) of what a file takes from modules of the package."""
    modules = {}
    for node in nodes(user):
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                if f'{node.module}.{alias.name}' in MODULES:
                    modules[alias.asname or alias.name] = f'{node.module}.{alias.name}'
                elif node.module in MODULES:
                    yield MODULES[node.module], alias.name
    for node in nodes(user):
        if (isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
                and node.value.id in modules):
            yield MODULES[modules[node.value.id]], node.attr


@cache
def offered():
    """Functions and classes that a file of another folder uses, by file."""
    names = defaultdict(set)
    for user in SOURCES:
        for path, name in used_names(user):
            if path.parent != user.parent:
                names[path].add(name)
    for path in [path for path in SOURCES if path.stem == '__init__']:
        for module, name in used_names(path):  # what it passes on
            if name in names[path] or f"'{name}'" in SOURCES[path]:
                names[module].add(name)
    return [(path, node) for path in SOURCES for node in tree(path).body
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and node.name in names[path]]


def section(node, title):
    """The text of one section of a docstring; '' where there is none."""
    found = re.search(rf'^{title}:\n((?:    .*\n|\n)*)', (ast.get_docstring(node) or '') + '\n',
                      re.MULTILINE)
    return found[1] if found else ''


def undescribed(names, text):
    return [name for name in names
            if not name.startswith('_') and not re.search(rf'\b{name}\b.*:', text)]


def arguments(function):
    every = function.args
    named = [*every.posonlyargs, *every.args, every.vararg, *every.kwonlyargs, every.kwarg]
    return [arg.arg for arg in named if arg and arg.arg not in ('self', 'cls')]


def is_record(cls):
    """Whether its fields are the arguments of a class."""
    parts = [ast.unparse(part) for part in (*cls.decorator_list, *cls.bases)]
    return any('dataclass' in part or part == 'NamedTuple' for part in parts)


def fields_without_comment(path, cls):
    """Fields of a class that neither a comment nor `param` nor the docstring describes."""
    lines = SOURCES[path].splitlines()
    for field in cls.body:
        if isinstance(field, ast.AnnAssign):
            own, above = lines[field.lineno - 1:field.end_lineno], lines[field.lineno - 2]
            if not ('param(' in ast.unparse(field) or above.strip().startswith('#')
                    or any('  # ' in line for line in own)):
                yield field.target.id


def gaps(path, node):
    """What the docstring of a function or class leaves out."""
    described = section(node, 'Args') + section(node, 'Attributes')
    if isinstance(node, ast.ClassDef):
        init = [part for part in node.body if getattr(part, 'name', '') == '__init__']
        if is_record(node) and not init:
            return undescribed(fields_without_comment(path, node), described)
        return undescribed(arguments(init[0]), described) if init else []
    missing = undescribed(arguments(node), described)
    returns = ast.unparse(node.returns) if node.returns else 'None'
    if returns not in ('None', 'NoReturn', 'Never') and not section(node, 'Returns'):
        missing.append('Returns')
    return missing


def methods(path, cls):
    """Public methods with a docstring whose names occur in files of other folders."""
    for node in cls.body:
        if (isinstance(node, ast.FunctionDef) and not node.name.startswith('_')
                and ast.get_docstring(node)
                and any(node.name in names for user, names in attributes().items()
                        if user.parent != path.parent)):
            yield node


def undescribed_arguments(cls, method):
    """Arguments that neither the method's docstring nor that of its class describes."""
    text = ast.get_docstring(method)
    mentioned = ''.join(f'{name}:\n' for name in re.findall(r'`(\w+)`', text))
    return undescribed(arguments(method), section(method, 'Args') + mentioned
                       + section(cls, 'Arguments of methods') + section(cls, 'Args'))


@cache
def attributes():
    """By file, the names that it takes as attributes."""
    return {path: {node.attr for node in nodes(path) if isinstance(node, ast.Attribute)}
            for path in SOURCES}


def test_many_functions_and_classes_are_used_by_other_rooms():
    assert len(offered()) > 250


def test_what_other_rooms_use_describes_arguments_and_result():
    missing = {f'{path.relative_to(PACKAGE)}: {node.name}': left_out
               for path, node in offered() if (left_out := gaps(path, node))}
    assert missing == {}


def test_methods_that_other_rooms_use_have_described_arguments():
    missing = {f'{path.relative_to(PACKAGE)}: {cls.name}.{method.name}': left_out
               for path, cls in offered() if isinstance(cls, ast.ClassDef)
               for method in methods(path, cls)
               if (left_out := undescribed_arguments(cls, method))}
    assert missing == {}


@pytest.mark.parametrize(('text', 'expected'), [
    ('def f(a: int) -> None:\n    """Do.\n\n    Args:\n        a: [m].\n    """', []),
    ('def f(a: int, b: int) -> int:\n    """Do.\n\n    Args:\n        a: [m].\n    """',
     ['b', 'Returns']),
    ('@dataclass\nclass A:\n    """One."""\n\n    a: int  # [m]\n    b: int\n', ['b']),
    ('class A:\n    """One."""\n\n    def __init__(self, a: int) -> None:\n        pass', ['a']),
])
def test_a_gap_is_seen(text, expected, monkeypatch):
    monkeypatch.setitem(SOURCES, 'here', text)
    assert gaps('here', ast.parse(text).body[0]) == expected


MESSAGES = sorted(path for kind in ('msg', 'srv')
                  for path in (PACKAGE.parent / 'msg_defs' / kind).glob(f'*.{kind}'))


@pytest.mark.parametrize('path', MESSAGES, ids=lambda path: path.name)
def test_a_message_says_what_it_is_and_comments_each_field(path):
    lines = path.read_text().splitlines()
    assert lines[0].startswith('# ')
    fields = [line for line in lines if line.strip() not in ('', '---') and line[0] != '#']
    assert [line for line in fields if '#' not in line and '=' not in line] == []
