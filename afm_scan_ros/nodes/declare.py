"""Declares parameters: all are fixed when the node starts."""

import math
import sys
from collections.abc import Iterable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files.records import from_mapping
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.parameters import NodeParameter, Value, scan_spec_parameters

_LARGEST_INT = 2**31 - 1  # which a slider of rqt_reconfigure can hold
_LARGEST_FLOAT = sys.float_info.max


def declare(node: Node, parameters: Iterable[NodeParameter]) -> dict[str, Any]:
    """Declare parameters and return their values; raises InputError for one that does not fit."""
    return {parameter.name: _declare(node, parameter) for parameter in parameters}


def undeclared(node: Node) -> list[str]:
    """Names that the command line or a parameter file set and the node never declared."""
    given = node._parameter_overrides  # noqa: SLF001 - rclpy has no public name for it
    return sorted(
        name
        for name in given
        if not name.startswith("qos_overrides.") and not node.has_parameter(name)
    )


def scan_spec(node: Node) -> ScanSpec:
    """Declare the parameters of a scan and return it; raises InputError naming what is wrong."""
    return from_mapping(ScanSpec, declare(node, scan_spec_parameters()), node.get_name())


def _declare(node: Node, parameter: NodeParameter) -> Value:
    name, default, choices = parameter.name, parameter.default, parameter.choices
    try:
        value: Value = node.declare_parameter(name, default, _descriptor(parameter)).value
    except ParameterException as error:
        raise InputError(f"parameter {name}: {error}") from error
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"parameter {name}: {value} is not finite; give a number")
    if choices and value not in choices:
        raise InputError(f"parameter {name}: '{value}' is not one of {', '.join(choices)}")
    return value


def _descriptor(parameter: NodeParameter) -> Message:
    descriptor = ParameterDescriptor(description=parameter.description, read_only=True)
    if parameter.choices:
        descriptor.additional_constraints = f"one of {', '.join(parameter.choices)}"
    low, high = parameter.low, parameter.high
    if low is None and high is None:
        return descriptor
    whole = isinstance(parameter.default, int)
    number, largest = (int, _LARGEST_INT) if whole else (float, _LARGEST_FLOAT)
    start = number(-largest if low is None else low)
    stop = number(largest if high is None else high)
    if whole:
        descriptor.integer_range = [IntegerRange(from_value=start, to_value=stop, step=1)]
    else:
        descriptor.floating_point_range = [FloatingPointRange(from_value=start, to_value=stop)]
    return descriptor
