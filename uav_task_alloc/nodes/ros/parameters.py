# SPDX-License-Identifier: Apache-2.0
"""Declares the parameters of params.py on a node, and keeps them checked."""
from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from uav_task_alloc import params
from uav_task_alloc.errors import InvalidValue

_P = TypeVar('_P', bound=params.Checked)
_BIG = 1.7e308
_TYPES = {bool: Parameter.Type.BOOL, int: Parameter.Type.INTEGER, float: Parameter.Type.DOUBLE,
          str: Parameter.Type.STRING}


class LiveParameters:
    """The parameters of a node as they are now: `live.now.solve_budget`."""

    def __init__(self, now: Any) -> None:
        self.now = now


def descriptor(spec: Any) -> ParameterDescriptor:
    """The ROS descriptor of a declared field."""
    meta, described = spec.metadata, ParameterDescriptor()
    described.description = f'{meta["text"]} Expected: {params.expectation(spec)}.'
    described.description += ' Read at the start only.' if meta['fixed'] else ''
    described.additional_constraints = ', '.join(meta['choices'])
    if isinstance(spec.default, tuple):
        described.dynamic_typing = True  # an empty list has no type of its own
    low, high = meta['low'], meta['high']
    if type(spec.default) is float and (low is not None or high is not None):
        described.floating_point_range = [FloatingPointRange(
            from_value=-_BIG if low is None else low, to_value=_BIG if high is None else high)]
    if type(spec.default) is int and (low is not None or high is not None):
        described.integer_range = [IntegerRange(
            from_value=-2**63 if low is None else low,
            to_value=2**63 - 1 if high is None else high, step=1)]
    return described


def declare(node: Node, kind: type[_P]) -> LiveParameters:
    """Declare every field of `kind` on `node`; raise InvalidValue for a bad start value."""
    values = {}
    for spec in fields(kind):
        name = params.ros_name(spec)
        default = list(spec.default) if isinstance(spec.default, tuple) else spec.default
        _accept_whole(node, spec)
        try:
            value = node.declare_parameter(name, default, descriptor(spec)).value
        except (InvalidParameterTypeException, InvalidParameterValueException):
            given = node._parameter_overrides[name].value
            raise InvalidValue(name, given, params.expectation(spec)) from None
        values[spec.name] = () if value is None else value
    for name in sorted({*node._parameter_overrides} - {*map(params.ros_name, fields(kind))}):
        if not node.has_parameter(name) and not name.startswith('qos_overrides.'):
            node.get_logger().warning(f'parameter {name} is unknown: ignored')
    live = LiveParameters(kind(**values))
    node.add_on_set_parameters_callback(lambda changed: _change(live, changed))
    return live


def _accept_whole(node: Node, spec: Any) -> None:
    """`-p solve_budget:=1` means 1.0."""
    name = params.ros_name(spec)
    given = node._parameter_overrides.get(name)
    if type(spec.default) is float and given is not None and type(given.value) is int:
        node._parameter_overrides[name] = Parameter(name, value=float(given.value))


def _change(live: LiveParameters, changed: list[Parameter]) -> SetParametersResult:
    specs = {params.ros_name(spec): spec for spec in fields(live.now)}
    new = {}
    for parameter in changed:
        spec = specs.get(parameter.name)
        if spec is None:  # another library's, use_sim_time say
            continue
        if spec.metadata['fixed']:
            return SetParametersResult(
                successful=False, reason=f'{parameter.name} is read at the start only')
        new[spec.name] = parameter.value
    try:
        live.now = replace(live.now, **new)
    except InvalidValue as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)
