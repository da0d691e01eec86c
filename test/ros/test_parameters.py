"""Parameters as rclpy declares them: typed by their default, kept within their range."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros import ros
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.ros.cyclone.node import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterNotDeclaredException,
    Parameters,
)

SCALARS = st.one_of(st.booleans(), st.integers(), st.floats(), st.text())
PLAIN = ros.ParameterDescriptor()


def ranged(low: float, high: float) -> ros.Message:
    limits = ros.FloatingPointRange(from_value=low, to_value=high)
    return ros.ParameterDescriptor(floating_point_range=[limits])


@given(SCALARS, SCALARS)
def test_only_a_value_of_the_defaults_type_is_taken(default: object, value: object) -> None:
    parameters = Parameters({"name": value})
    if type(value) is type(default):
        assert parameters.declare("name", default, PLAIN).value is value
    else:
        with pytest.raises(InvalidParameterTypeException, match="expecting type"):
            parameters.declare("name", default, PLAIN)


@given(st.floats(allow_nan=False), st.floats(0.1, 10.0))
def test_a_declared_range_is_enforced(value: float, width: float) -> None:
    parameters = Parameters({"name": value})
    if -width <= value <= width:
        assert parameters.declare("name", 0.0, ranged(-width, width)).value == value
    elif abs(value) > 1.01 * width:  # rclpy takes an edge within 1e-6 of it
        with pytest.raises(InvalidParameterValueException, match="out of range"):
            parameters.declare("name", 0.0, ranged(-width, width))


def test_not_a_number_is_out_of_every_range() -> None:
    with pytest.raises(InvalidParameterValueException):
        Parameters({"name": float("nan")}).declare("name", 0.0, ranged(-1.0, 1.0))


@pytest.mark.parametrize("default", [[], [1, 2.0], None, {}])
def test_a_default_without_a_type_is_refused(default: object) -> None:
    with pytest.raises(ros.ParameterException, match="name"):
        Parameters({}).declare("name", default, PLAIN)


def test_a_parameter_is_declared_once_before_it_is_asked_for() -> None:
    parameters = Parameters({"spelt_wrong": 1})
    parameters.declare("name", ["creep"], PLAIN)
    assert parameters.get("name").value == ["creep"]
    with pytest.raises(ParameterAlreadyDeclaredException):
        parameters.declare("name", ["creep"], PLAIN)
    with pytest.raises(ParameterNotDeclaredException):
        parameters.get("spelt_wrong")  # as in rclpy, an override alone declares nothing


def test_a_node_reads_its_part_of_the_command_line() -> None:
    arguments = ["-r", "__ns:=/lab", "-r", "blocks:=desired", "-p", "tested:gain:=2.0"]
    ros.init(args=["program", "--ros-args", *arguments, "-p", "rate:=5"])
    try:
        node = ros.Node("tested")
        assert node.get_fully_qualified_name() == "/lab/tested"
        assert node.declare_parameter("rate", 1).value == 5
        assert node.declare_parameter("gain", 1.0).value == 1.0  # the key means /tested
        assert node.create_publisher(ros.NodeState, "blocks", 1).topic_name == "/lab/desired"
    finally:
        ros.shutdown()


def test_simulated_time_is_refused() -> None:
    ros.init(args=["--ros-args", "-p", "use_sim_time:=true"])
    try:
        with pytest.raises(InputError, match="use_sim_time"):
            ros.Node("tested")
    finally:
        ros.shutdown()
