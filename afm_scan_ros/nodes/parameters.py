"""Declared parameters: name, type, description, range; all are fixed when the node starts."""

import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from attrs import Attribute, frozen
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.learning import TIME_CONSTANT
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec, human_name, scan_parameters
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.records import from_mapping, naming
from afm_scan_ros.nodes.messages import Message

Value: TypeAlias = bool | int | float | str | list[str]

_LARGEST_INT = 2**31 - 1  # which a slider of rqt_reconfigure can hold
_LARGEST_FLOAT = sys.float_info.max


@frozen
class NodeParameter:
    """A parameter with its default; its type is that of the default."""

    name: str
    default: Value
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()


MODEL_FILE = NodeParameter(
    "model_file", str(share_directory() / "config/model.yaml"), "Model of the scanner"
)
DRIVE_LIMITS = (
    NodeParameter("voltage_limit_v", 5.0, "Largest drive voltage", low=0.0),
    NodeParameter("slew_limit_v_per_s", 2e5, "Largest slew rate of the drive", low=0.0),
)


ADAPTATION = (
    NodeParameter(
        "adapt",
        default=False,
        description="Whether changes of gain, resonance and slow creep are tracked",
    ),
    NodeParameter(
        "adapt_time_constant_s", TIME_CONSTANT, "With adapt: memory of the estimator", low=0.0
    ),
)


def drive_limits(settings: Mapping[str, Any]) -> DriveLimits:
    """Return the limits among a node's parameters; raises InputError where one is zero."""
    try:
        return DriveLimits(settings["voltage_limit_v"], settings["slew_limit_v_per_s"])
    except ValueError as error:
        raise InputError(f"voltage_limit_v and slew_limit_v_per_s: {error}") from error


def model_of(settings: Mapping[str, Any]) -> ScannerModel:
    """Load the model that a node's parameter names; raises InputError naming parameter and file."""
    with naming("parameter model_file"):
        return load_model(Path(settings["model_file"]))


def declare(node: Node, parameters: Iterable[NodeParameter]) -> dict[str, Any]:
    """Declare parameters and return their values; raises InputError for one that does not fit."""
    return {parameter.name: _declare(node, parameter) for parameter in parameters}


def undeclared_parameters(node: Node) -> list[str]:
    """Names that the command line or a parameter file set and the node never declared."""
    given = node._parameter_overrides  # noqa: SLF001 - rclpy has no public name for it
    return sorted(
        name
        for name in given
        if not name.startswith("qos_overrides.") and not node.has_parameter(name)
    )


def scan_spec_parameters() -> list[NodeParameter]:
    """Return the parameters of a scan in their file units, such as ``range_x_um``."""
    return [_for_people(attribute) for attribute in scan_parameters()]


def scan_spec(node: Node) -> ScanSpec:
    """Declare the parameters of a scan and return it; raises InputError naming what is wrong."""
    return from_mapping(ScanSpec, declare(node, scan_spec_parameters()), node.get_name())


def inverses_of(names: Iterable[str], known: Iterable[str]) -> frozenset[str]:
    """Return the inverses that a parameter names; ``none`` stands for none of them."""
    given = frozenset(names)
    if "none" in given and len(given) > 1:
        raise InputError(f"inverses: 'none' cannot be combined with {', '.join(sorted(given))}")
    chosen = given - {"none"}
    if unknown := sorted(chosen - frozenset(known)):
        raise InputError(f"inverses: '{unknown[0]}' is not one of {', '.join(known)}, none")
    return chosen


def _for_people(attribute: "Attribute[Any]") -> NodeParameter:
    """Return a scan's parameter in the unit of its name, with the range that its checks allow."""
    default: Any = attribute.default
    scale = attribute.metadata["scale"]
    bounds: dict[str, Any] = {}
    for check in attribute.metadata["checks"]:
        if hasattr(check, "options"):
            bounds["choices"] = tuple(check.options)
        else:
            side = "low" if check.compare_op.startswith(">") else "high"
            bounds[side] = _in_unit(check.bound, scale)
    if isinstance(default, float):
        default = _in_unit(default, scale)
    return NodeParameter(human_name(attribute), default, attribute.metadata["help"], **bounds)


def _in_unit(value: float, scale: float) -> float:
    return float(f"{value / scale:.12g}")  # 40e-6 / 1e-6 is 39.99… otherwise


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
