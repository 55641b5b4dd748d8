# SPDX-License-Identifier: Apache-2.0
"""Declares the parameters of params.py on a node, and checks every later change."""
from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import Field, fields, replace
from difflib import get_close_matches
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from uav_task_alloc import parameter_field, params
from uav_task_alloc.errors import AllocError, InvalidValue
from uav_task_alloc.nodes.ros.parameter_files import check_files, shared_names

_Params = TypeVar('_Params', bound=parameter_field.CheckedParams)
_BIG = 1.7e308  # a ROS range has no infinity


class UnknownParameter(AllocError):
    """A name that is no parameter of a node.

    Args:
        name: as it was given.
        known: names of the node's parameters.
        owners: other nodes that have a parameter of this name.
    """

    def __init__(self, name: str, known: Sequence[str], owners: Sequence[str]) -> None:
        nearest = get_close_matches(name, known, 1, 0.0)[0]
        super().__init__(f'unknown parameter {name!r}: expected one that --help lists; ' + (
            f'it is one of {", ".join(owners)}' if owners else f'nearest is {nearest!r}'))


class LiveParameters(Generic[_Params]):
    """The parameters of a node as they are now: `live.now.solve_budget`."""

    def __init__(self, now: _Params) -> None:
        self.now = now


def declare(node: Node, kind: type[_Params]) -> LiveParameters[_Params]:
    """Declare every field of a parameter class on a node.

    Args:
        node: whose overrides (`-p NAME:=VALUE`, --params-file) are the start values.
        kind: AllocatorParams or the like.

    Returns:
        The values, which follow every later change that is valid.

    Raises:
        InvalidValue: a start value has another type or is outside its range.
        UnknownParameter: a name is not declared.
        ParameterFileError: a parameter file is for other nodes only.
    """
    _check_names(node, kind)
    values = {spec.name: _declare_one(node, spec) for spec in _specs(kind)}
    live = LiveParameters(kind(**values))
    node.add_on_set_parameters_callback(lambda changed: _change(live, changed))
    return live


def given(name: str, value: str, what: str) -> str:
    """A start value that has no default.

    Args:
        name: of the parameter.
        value: as declared; '' where it was not given.
        what: it must be.

    Returns:
        The value.

    Raises:
        InvalidValue: it was not given.
    """
    if not value:
        raise InvalidValue(name, value, f'{what}, by --ros-args -p {name}:=...')
    return value


def _specs(kind: type[parameter_field.CheckedParams]) -> tuple[Field[Any], ...]:
    return fields(kind)  # type: ignore[arg-type]  # every subclass is a dataclass


def _check_names(node: Node, kind: type[parameter_field.CheckedParams]) -> None:
    """Refuse what ROS would ignore, as the node would fly with a default instead.

    A name that a file gives to all nodes need only be a parameter of one of them.
    """
    check_files(sys.argv, node.get_fully_qualified_name())
    known = [*map(parameter_field.ros_name, _specs(kind))]
    shared = shared_names(sys.argv)
    for name in sorted({*node._parameter_overrides} - {*known}):
        if node.has_parameter(name) or name.startswith('qos_overrides.'):
            continue
        owners = [other for other, owner in params.NODES.items()
                  if name in map(parameter_field.ros_name, _specs(owner))]
        if not (owners and name in shared):
            raise UnknownParameter(name, known, owners)


def _declare_one(node: Node, spec: Field[Any]) -> Any:
    """Declare one parameter; return its start value."""
    name = parameter_field.ros_name(spec)
    default = list(spec.default) if isinstance(spec.default, tuple) else spec.default
    _accept_whole_number(node, spec)
    try:
        value = node.declare_parameter(name, default, descriptor(spec)).value
    except (InvalidParameterTypeException, InvalidParameterValueException):
        given = node._parameter_overrides[name].value
        raise InvalidValue(name, given, parameter_field.expectation(spec)) from None
    return () if value is None else value


def _accept_whole_number(node: Node, spec: Field[Any]) -> None:
    """`-p solve_budget:=1` means 1.0."""
    name = parameter_field.ros_name(spec)
    given = node._parameter_overrides.get(name)
    if type(spec.default) is float and given is not None and type(given.value) is int:
        node._parameter_overrides[name] = Parameter(name, value=float(given.value))


def descriptor(spec: Field[Any]) -> ParameterDescriptor:
    """The ROS descriptor of a declared field: text, range, choices."""
    meta, result = spec.metadata, ParameterDescriptor()
    result.description = f'{meta["text"]} Expected: {parameter_field.expectation(spec)}.'
    result.description += ' Read at the start only.' if meta['fixed'] else ''
    result.additional_constraints = ', '.join(meta['choices'])
    if isinstance(spec.default, tuple):
        result.dynamic_typing = True  # an empty list has no type of its own
    low, high = meta['low'], meta['high']
    if type(spec.default) is float and (low is not None or high is not None):
        result.floating_point_range = [FloatingPointRange(
            from_value=-_BIG if low is None else low, to_value=_BIG if high is None else high)]
    if type(spec.default) is int and (low is not None or high is not None):
        result.integer_range = [IntegerRange(
            from_value=-2**63 if low is None else low,
            to_value=2**63 - 1 if high is None else high, step=1)]
    return result


def _change(live: LiveParameters[_Params], changed: list[Parameter]) -> SetParametersResult:
    """Apply all changes or, where one is invalid, none."""
    specs = {parameter_field.ros_name(spec): spec for spec in _specs(type(live.now))}
    values = {}
    for parameter in changed:
        spec = specs.get(parameter.name)
        if spec is None:  # of rclpy itself: use_sim_time
            continue
        if spec.metadata['fixed']:
            return SetParametersResult(
                successful=False, reason=f'{parameter.name} is read at the start only')
        values[spec.name] = parameter.value
    try:
        live.now = replace(live.now, **values)  # type: ignore[type-var]
    except InvalidValue as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)
