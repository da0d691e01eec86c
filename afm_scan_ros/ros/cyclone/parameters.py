"""Parameters under rclpy's names, with a fixed type and a range."""

import math
from collections.abc import Mapping
from enum import IntEnum
from typing import Any, ClassVar

from attrs import Factory, define, frozen

from afm_scan_ros.files.yaml import Value
from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone.message_types import message_class

ParameterDescriptor = message_class("rcl_interfaces/msg/ParameterDescriptor")
FloatingPointRange = message_class("rcl_interfaces/msg/FloatingPointRange")
IntegerRange = message_class("rcl_interfaces/msg/IntegerRange")

_TOLERANCE = 1e-6  # rclpy's Node.PARAM_REL_TOL


class ParameterType(IntEnum):
    """Numbers as in rcl_interfaces/ParameterType."""

    BOOL = 1
    INTEGER = 2
    DOUBLE = 3
    STRING = 4
    BOOL_ARRAY = 6
    INTEGER_ARRAY = 7
    DOUBLE_ARRAY = 8
    STRING_ARRAY = 9


_SCALARS = {
    bool: ParameterType.BOOL,
    int: ParameterType.INTEGER,
    float: ParameterType.DOUBLE,
    str: ParameterType.STRING,
}
_ARRAY_OFFSET = ParameterType.BOOL_ARRAY - ParameterType.BOOL


class ParameterException(Exception):  # noqa: N818 - rclpy's name
    """A parameter was declared, given or asked for wrongly."""


class InvalidParameterTypeException(ParameterException):
    """A value of another type than the default's was given, as ``5`` for a double."""


class InvalidParameterValueException(ParameterException):
    """A value outside the declared range was given."""


class ParameterNotDeclaredException(ParameterException):
    """A parameter was asked for that the node has not declared."""


class ParameterAlreadyDeclaredException(ParameterException):
    """A parameter was declared twice."""


@frozen
class Parameter:
    """A name with a value of one of ROS 2's parameter types."""

    Type: ClassVar[type[ParameterType]] = ParameterType
    name: str
    value: Any

    @property
    def type_(self) -> ParameterType:
        """Type of the value; raises ParameterException if ROS 2 has none for it."""
        return _type_of(self.name, self.value)


@define(eq=False)
class Parameters:
    """The parameters of one node, and the values that the command line gave for them."""

    overrides: Mapping[str, Value]
    _declared: dict[str, Parameter] = Factory(dict)

    def declare(self, name: str, default: Value, descriptor: Message) -> Parameter:
        """Return the parameter with the value given for it, else with its default.

        Raises InvalidParameterTypeException and InvalidParameterValueException for a value that
        does not suit, ParameterAlreadyDeclaredException for a name declared before.
        """
        if name in self._declared:
            raise ParameterAlreadyDeclaredException(f"parameter '{name}' is declared already")
        expected = Parameter(name, default).type_
        parameter = Parameter(name, self.overrides.get(name, default))
        if parameter.type_ != expected:
            raise InvalidParameterTypeException(
                f"Trying to set parameter '{name}' to '{parameter.value}' of type"
                f" '{parameter.type_.name}', expecting type '{expected.name}'"
            )
        for limits in (*descriptor.floating_point_range, *descriptor.integer_range):
            _check_range(parameter, limits)
        self._declared[name] = parameter
        return parameter

    def has(self, name: str) -> bool:
        """Return whether a parameter was declared."""
        return name in self._declared

    def get(self, name: str) -> Parameter:
        """Return a declared parameter; raises ParameterNotDeclaredException for any other."""
        if name not in self._declared:
            raise ParameterNotDeclaredException(f"parameter '{name}' is not declared")
        return self._declared[name]


def _type_of(name: str, value: Value) -> ParameterType:
    if type(value) in _SCALARS:
        return _SCALARS[type(value)]
    kinds = {type(item) for item in value} if isinstance(value, (list, tuple)) else set()
    if len(kinds) == 1 and (kind := kinds.pop()) in _SCALARS:
        return ParameterType(_SCALARS[kind] + _ARRAY_OFFSET)
    raise ParameterException(
        f"parameter '{name}' = {value!r}: give a bool, an integer, a double, a string,"
        " or a list of one of them that is not empty"
    )


def _check_range(parameter: Parameter, limits: Message) -> None:
    if parameter.type_ not in (ParameterType.INTEGER, ParameterType.DOUBLE):
        return
    value, low, high = parameter.value, limits.from_value, limits.to_value
    if not (low <= value <= high or _close(value, low) or _close(value, high)):
        raise InvalidParameterValueException(
            f"Invalid parameter value ({value}) for parameter '{parameter.name}'. Reason:"
            f" Parameter {parameter.name} out of range. Min: {low}, Max: {high}, value: {value}"
        )


def _close(value: float, limit: float) -> bool:
    return isinstance(value, float) and math.isclose(value, limit, rel_tol=_TOLERANCE)
