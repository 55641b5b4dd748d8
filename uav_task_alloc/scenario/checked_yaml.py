# SPDX-License-Identifier: Apache-2.0
"""YAML read against declared tables of keys; errors name file, line, value and expectation."""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from uav_task_alloc.errors import ScenarioError
from uav_task_alloc.scenario.key_hints import key_hint

REQUIRED: Any = object()
INFINITE = {'.inf': math.inf, '+.inf': math.inf, '-.inf': -math.inf}  # YAML's spelling


@dataclass(frozen=True, slots=True)
class ValueKind:
    """The kind of a value: its description, for the docs and for errors, and its reader."""

    description: str
    read: Callable[[str, yaml.Node], Any]  # (place, node); raises ScenarioError


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a table; null, or leaving it out, means the default."""

    kind: ValueKind
    text: str
    default: Any = REQUIRED


KeyTable = Mapping[str, Key]


@dataclass(frozen=True, slots=True)
class YamlRow:
    """The values of a mapping by key, and their nodes in the file."""

    place: str
    node: yaml.Node
    nodes: dict[str, yaml.Node]
    values: dict[str, Any]

    def __getitem__(self, key: str) -> Any:
        return self.values[key]

    def refuse(self, key: str, expected: str) -> ScenarioError:
        """The error for the value of `key`, or for its absence."""
        node = self.nodes.get(key)
        if node is None:
            return refusal(self.node, f'{self.place}.{key} is missing: expected {expected}')
        return refusal(node, f'{self.place}.{key} = {shown_yaml(node)}: expected {expected}')


def refusal(node: yaml.Node, reason: str) -> ScenarioError:
    """`file:line: reason` for a node of a composed document."""
    return ScenarioError(f'{node.start_mark.name}:{node.start_mark.line + 1}: {reason}')


def shown_yaml(node: yaml.Node) -> str:
    """A value as errors show it, at most 45 characters."""
    if isinstance(node, yaml.MappingNode):
        return 'a mapping'
    if isinstance(node, yaml.SequenceNode):
        inner = ', '.join(shown_yaml(child) for child in node.value[:4])
        return f'[{inner}{", ..." if len(node.value) > 4 else ""}]'[:45]
    return repr(node.value[:40]) if node.style else str(node.value[:40]) or 'null'


def compose(text: str, name: str) -> yaml.Node:
    """Parse a document into nodes with line numbers. Raises ScenarioError where it is no YAML."""
    try:
        loader = yaml.SafeLoader(text)
        loader.name = name
        node = loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        raise ScenarioError(f'{name}:{line}: {error.problem}: expected YAML') from None
    except yaml.reader.ReaderError as error:
        line = text.count('\n', 0, error.position) + 1
        raise ScenarioError(f'{name}:{line}: character {text[error.position]!r}: '
                            'expected printable text') from None
    except RecursionError:
        raise ScenarioError(f'{name}:1: nested too deep: expected a scenario') from None
    if node is None:
        raise ScenarioError(f'{name}:1: the file is empty: expected a scenario')
    _refuse_cycles(node, (), set())
    return node


def _refuse_cycles(node: yaml.Node, above: tuple[int, ...], done: set[int]) -> None:
    if id(node) in above:
        raise refusal(node, 'a value contains itself: expected a scenario')
    if isinstance(node, yaml.ScalarNode) or id(node) in done:
        return
    for child in node.value:
        for each in child if isinstance(child, tuple) else (child,):
            _refuse_cycles(each, (*above, id(node)), done)
    done.add(id(node))


def read_row(table: KeyTable, place: str, node: yaml.Node) -> YamlRow:
    """Read a mapping by a table of keys.

    Args:
        table: of the keys.
        place: of the mapping in the document, for errors.
        node: of the mapping.

    Raises:
        ScenarioError: a key is unknown, repeated or missing, or a value is invalid.
    """
    if not isinstance(node, yaml.MappingNode):
        raise refusal(node, f'{place} = {shown_yaml(node)}: expected a mapping with '
                            f'{", ".join(table)}')
    row = YamlRow(place, node, _children(table, place, node), {})
    for key, entry in table.items():
        given = row.nodes.get(key)
        if given is not None and not is_null(given):
            row.values[key] = entry.kind.read(f'{place}.{key}', given)
        elif entry.default is REQUIRED:
            raise row.refuse(key, entry.kind.description)
        else:
            row.values[key] = entry.default
    return row


def _children(table: KeyTable, place: str, node: yaml.MappingNode) -> dict[str, yaml.Node]:
    lines: dict[str, int] = {}
    for name, _ in node.value:
        key = name.value if isinstance(name, yaml.ScalarNode) else shown_yaml(name)
        if key not in table:
            raise refusal(name, f'{place}: unknown key {key!r}: expected one of '
                                f'{", ".join(table)}; {key_hint(key, table)}')
        if key in lines:
            raise refusal(name, f'{place}: key {key!r} is given twice: expected it once; '
                                f'first in line {lines[key]}')
        lines[key] = name.start_mark.line + 1
    return {name.value: child for name, child in node.value}


def is_null(node: yaml.Node) -> bool:
    """Whether a value is null, ~ or empty."""
    return bool(node.tag == 'tag:yaml.org,2002:null')


def scalar(description: str, convert: Callable[[str], Any]) -> ValueKind:
    """A scalar; `convert` raises ValueError for an invalid text."""
    def read(place: str, node: yaml.Node) -> Any:
        try:
            if not isinstance(node, yaml.ScalarNode):
                raise ValueError
            return convert(node.value)
        except ValueError:
            raise refusal(node, f'{place} = {shown_yaml(node)}: expected {description}') from None
    return ValueKind(description, read)


def number_value(low: float = -math.inf, high: float = math.inf, *, open_low: bool = False,
           infinite: bool = False) -> ValueKind:
    """A number in [low, high], or in (low, high] with `open_low`; inf only with `infinite`."""
    def convert(text: str) -> float:
        value = INFINITE.get(text.lower())
        value = float(text) if value is None else value
        if not low <= value <= high or (open_low and value == low):
            raise ValueError
        if math.isinf(value) and not infinite:
            raise ValueError
        return value
    if (low, high) == (-math.inf, math.inf):
        return scalar('a number', convert)
    left = '(' if open_low or math.isinf(low) else '['
    right = ']' if infinite or math.isfinite(high) else ')'
    return scalar(f'a number in {left}{low:g}, {high:g}{right}', convert)


def whole_number(low: int, high: int) -> ValueKind:
    """A whole number in [low, high]."""
    def convert(text: str) -> int:
        value = int(text)
        if not low <= value <= high:
            raise ValueError
        return value
    return scalar(f'a whole number in [{low}, {high}]', convert)


def choice(*names: str) -> ValueKind:
    """One of these names."""
    def convert(text: str) -> str:
        if text not in names:
            raise ValueError
        return text
    return scalar(f'one of {", ".join(names)}', convert)


def text_value(description: str, accepts: Callable[[str], object] = str.strip) -> ValueKind:
    """A string for which `accepts` is true."""
    def convert(value: str) -> str:
        if not accepts(value):
            raise ValueError
        return value
    return scalar(description, convert)


def list_of(kind: ValueKind, description: str, least: int = 0,
            most: float = math.inf) -> ValueKind:
    """A list of values of one kind, read as a tuple."""
    def read(place: str, node: yaml.Node) -> tuple[Any, ...]:
        if not isinstance(node, yaml.SequenceNode) or not least <= len(node.value) <= most:
            raise refusal(node, f'{place} = {shown_yaml(node)}: expected {description}')
        return tuple(kind.read(f'{place}[{i}]', child) for i, child in enumerate(node.value))
    return ValueKind(description, read)


def or_mapping(kind: ValueKind, table: KeyTable, description: str,
               node_type: type[yaml.Node] = yaml.SequenceNode) -> ValueKind:
    """A list (or a scalar: `node_type`) of this kind, or a mapping, which is a YamlRow then."""
    def read(place: str, node: yaml.Node) -> Any:
        if isinstance(node, yaml.MappingNode):
            return read_row(table, place, node)
        if isinstance(node, node_type):
            return kind.read(place, node)
        raise refusal(node, f'{place} = {shown_yaml(node)}: expected {description}')
    return ValueKind(description, read)


def mapping(table: KeyTable, description: str) -> ValueKind:
    """A nested mapping, read as a YamlRow."""
    return ValueKind(description, lambda place, node: read_row(table, place, node))
