"""Parameters: a scan's are ScanSpec's, files give what is declared, and the rest is refused."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files import share_directory, yaml
from afm_scan_ros.nodes import NODES
from afm_scan_ros.nodes.declare import declare, scan_spec
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.parameters import NodeParameter, inverses_of, scan_spec_parameters
from afm_scan_ros.nodes.run import node_class
from afm_scan_ros.nodes.scan_node import COMMON
from helpers.ros import joined

Start = Callable[..., Node]


@pytest.fixture
def start() -> Iterator[Start]:
    """Return a function that makes a node for which parameters were given."""
    with ExitStack() as ended:

        def make(*given: str) -> Node:
            ended.enter_context(joined(*given))
            node = Node("tested")
            ended.callback(node.destroy_node)
            return node

        yield make


def parameters_of(name: str) -> dict[str, NodeParameter]:
    scan = scan_spec_parameters() if name == "trajectory_generator" else []
    return {each.name: each for each in (*COMMON, *node_class(name).PARAMETERS, *scan)}


@pytest.mark.parametrize("value", [".nan", ".inf", "-.inf"])
def test_what_is_no_finite_number_is_refused(start: Start, value: str) -> None:
    with pytest.raises(InputError, match=r"parameter angle: .* is not finite"):
        declare(start(f"angle:={value}"), [NodeParameter("angle", 0.0, "any angle")])


@pytest.mark.parametrize("value", ["1e999", "-1e999", "1e-999"])
def test_a_number_beyond_the_doubles_is_a_string(start: Start, value: str) -> None:
    with pytest.raises(InputError, match=r"parameter angle: .*STRING"):
        declare(start(f"angle:={value}"), [NodeParameter("angle", 0.0, "any angle")])


def test_a_scan_is_declared_in_the_units_of_its_names(start: Start) -> None:
    assert scan_spec(start()) == ScanSpec()


def test_a_scan_is_read_in_the_units_of_its_names(start: Start) -> None:
    spec = scan_spec(start("range_x_um:=12.5", "y_step_ms:=1.5", "lines:=3", "pattern:=spiral"))
    assert spec.range_x == pytest.approx(12.5e-6, rel=1e-12)
    assert spec.y_step == pytest.approx(1.5e-3, rel=1e-12)
    assert (spec.lines, spec.pattern) == (3, "spiral")


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ("lines:=1", "lines"),
        ("line_rate_hz:=5", "line_rate_hz.*DOUBLE"),
        ("range_x_um:=-4.0", "range_x_um"),
        ("range_x_um:=0.0", "range_x_um: .*out of range"),
        ("pattern:=zigzag", "pattern: 'zigzag' is not one of raster"),
        ("samples_per_line:=4001", "samples_per_line = 4001 is odd"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(start: Start, given: str, named: str) -> None:
    node = start(given)
    with pytest.raises(InputError, match=named):
        scan_spec(node)


def test_a_slider_can_hold_every_range(monkeypatch: pytest.MonkeyPatch, start: Start) -> None:
    """That of rqt_reconfigure has 32 bits; what is fixed when a node starts is read only."""
    described, node = [], start()

    def note(_: Node, name: str, value: object, descriptor: Message) -> Parameter:
        described.append((value, descriptor))
        return Parameter(name, value=value)

    monkeypatch.setattr(Node, "declare_parameter", note)
    declare(node, [each for name in NODES for each in parameters_of(name).values()])
    for value, descriptor in described:
        assert descriptor.read_only
        assert descriptor.description
        for limits in descriptor.integer_range:
            assert -(2**31) <= limits.from_value <= value <= limits.to_value < 2**31
        for limits in descriptor.floating_point_range:
            assert limits.from_value <= value <= limits.to_value


def test_every_parameter_is_described(start: Start) -> None:
    node = start()
    for name in NODES:
        assert all(parameter.description for parameter in parameters_of(name).values())
    assert declare(node, COMMON) == {parameter.name: parameter.default for parameter in COMMON}


@pytest.mark.parametrize(
    ("file", "node"),
    [
        ("scan", "trajectory_generator"),
        ("inversion_compensator", "inversion_compensator"),
        ("piezoscanner_sim", "piezoscanner_sim"),
        ("scan_recorder", "scan_recorder"),
    ],
)
def test_the_files_give_what_the_nodes_declare(file: str, node: str) -> None:
    content = yaml.load(share_directory() / f"config/{file}.yaml")
    given = content[f"/**/{node}"]["ros__parameters"]
    declared = parameters_of(node)
    for name, value in given.items():
        assert type(value) is type(declared[name].default), name
    assert list(content) == [f"/**/{node}"]


def test_none_stands_for_no_inverse() -> None:
    known = ("creep", "hysteresis", "vibration")
    assert inverses_of(["none"], known) == frozenset()
    assert inverses_of(["creep", "vibration"], known) == {"creep", "vibration"}
    with pytest.raises(InputError, match="'creeep' is not one of creep"):
        inverses_of(["creeep"], known)


@pytest.mark.parametrize(
    ("node", "parameter", "others"),
    [
        ("inversion_compensator", "model_file", []),
        ("inversion_compensator", "learned_file", []),
        ("residual_monitor", "model_file", []),
        ("trajectory_generator", "model_file", []),
        ("piezoscanner_sim", "plant_file", []),
        ("scanner_driver", "settings_file", ["driver:=simulated"]),
    ],
)
def test_a_file_that_is_missing_is_named_with_its_parameter(
    start: Start, node: str, parameter: str, others: list[str]
) -> None:
    start(f"{parameter}:=nowhere.yaml", *others)
    with pytest.raises(InputError, match=rf"^parameter {parameter}: nowhere.yaml: no such file"):
        node_class(node)()
