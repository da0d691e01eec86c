"""The launch file: its nodes, and how it ends. ROS's launch is replaced, for it is not here."""

import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
from attrs import frozen

from afm_scan_ros.core.errors import InputError

FILE = Path(__file__).parents[1] / "launch/scan.launch.py"
GIVEN = {"bag": "scan1", "namespace": "lab"}


SETTINGS = """\
amplifier: {voltage_limit_v: 5.0, slew_limit_v_per_s: 2.0e5, ramp_down_slew_v_per_s: 40.0}
x: {sensor_scale_m_per_v: 8.0e-6, sensor_offset_v: 0.0, sensor_low_v: -9.0, sensor_high_v: 9.0}
y: {sensor_scale_m_per_v: 8.0e-6, sensor_offset_v: 0.0, sensor_low_v: -9.0, sensor_high_v: 9.0}
latency_samples: 0
response_time_s: 0.005
drive_resolution_v: 0.1
sampling_instant: after_update
trigger_offset_s: 2.0e-6
"""


@frozen
class Text:
    """ROS's ParameterValue: a text that is not read as YAML."""

    text: str
    value_type: type


Launch = Callable[..., SimpleNamespace]


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch) -> Launch:
    """Return what runs the file with arguments, and returns its own names and its nodes."""
    declared: dict[str, str] = {}
    given = dict(GIVEN)

    def declare(name: str, **words: str) -> SimpleNamespace:
        declared[name] = given.get(name, words["default_value"])
        return SimpleNamespace(name=name)

    def value(name: str) -> SimpleNamespace:
        return SimpleNamespace(perform=lambda _: declared[name])

    modules = {
        "launch": {"LaunchContext": object, "LaunchDescription": list},
        "launch.actions": {"DeclareLaunchArgument": declare, "OpaqueFunction": dict},
        "launch.events": {},
        "launch.events.process": {"ProcessExited": object},
        "launch.substitutions": {"LaunchConfiguration": value},
        "launch_ros": {},
        "launch_ros.actions": {"Node": SimpleNamespace},
        "launch_ros.parameter_descriptions": {"ParameterValue": Text},
    }
    for name, members in modules.items():
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)

    def run(**arguments: str) -> SimpleNamespace:
        given.update(arguments)
        names = runpy.run_path(str(FILE))
        return SimpleNamespace(nodes=names["nodes"](None), judge=names["judge"])

    return run


@pytest.fixture
def launched(launch: Launch) -> SimpleNamespace:
    """Return the file's own names, and the nodes that it makes."""
    return launch()


def parameters(launched: SimpleNamespace, name: str) -> dict[str, object]:
    """Return the parameters of a node that are not in a file."""
    (node,) = (node for node in launched.nodes if node.executable == name)
    return {k: v for each in node.parameters if isinstance(each, dict) for k, v in each.items()}


def names(launched: SimpleNamespace) -> set[str]:
    return {node.executable for node in launched.nodes}


def test_the_simulation_scans_by_default(launched: SimpleNamespace) -> None:
    assert "piezoscanner_sim" in names(launched)
    assert parameters(launched, "piezoscanner_sim")["plant_file"].text.endswith("plant.yaml")
    assert "piezoscanner_sim" in parameters(launched, "trajectory_generator")["required_nodes"]
    assert "true_displacement" in parameters(launched, "scan_recorder")["topics"]


def test_a_scanner_that_runs_already_is_waited_for(launch: Launch) -> None:
    launched = launch(scanner="external", model="own.yaml")
    assert parameters(launched, "inversion_compensator")["model_file"] == Text("own.yaml", str)
    assert not names(launched) & {"piezoscanner_sim", "scanner_driver"}
    assert "scanner_driver" in parameters(launched, "trajectory_generator")["required_nodes"]
    assert "true_displacement" not in parameters(launched, "scan_recorder")["topics"]


@pytest.mark.parametrize("scanner", ["external", "mylab:Stage:stage.yaml"])
def test_a_real_scanner_needs_its_own_model(launch: Launch, scanner: str) -> None:
    with pytest.raises(RuntimeError, match="give this scanner's model as model:=FILE"):
        launch(scanner=scanner)


def test_a_driver_is_started_with_its_settings(launch: Launch, tmp_path: Path) -> None:
    (tmp_path / "stage.yaml").write_text(SETTINGS, "utf-8")
    file = str(tmp_path / "stage.yaml")
    launched = launch(scanner=f"simulated:{file}")
    assert "piezoscanner_sim" not in names(launched)
    given = parameters(launched, "scanner_driver")
    assert given["driver"] == "simulated"
    assert given["settings_file"] == Text(file, str)
    sim = parameters(launch(scanner="sim"), "piezoscanner_sim")
    assert given["min_subscriptions"] == sim["min_subscriptions"]
    source = parameters(launched, "trajectory_generator")
    assert source["sampling_instant"] == "after_update"
    assert source["trigger_offset_s"] == 2e-6


def test_line_feedback_has_the_compensator_read_what_was_achieved(launch: Launch) -> None:
    without, fed_back = launch(), launch(line_feedback="true")
    assert not parameters(without, "inversion_compensator")["line_feedback"]
    assert parameters(fed_back, "inversion_compensator")["line_feedback"]
    readers = [
        parameters(each, "piezoscanner_sim")["min_subscriptions"] for each in (without, fed_back)
    ]
    assert readers[1] == readers[0] + 1


def test_adaptation_has_compensator_and_monitor_adapt(launch: Launch) -> None:
    without, adapted = launch(), launch(adapt="true")
    for name in ("inversion_compensator", "residual_monitor"):
        assert not parameters(without, name)["adapt"]
        assert parameters(adapted, name)["adapt"]
    readers = [
        parameters(each, "piezoscanner_sim")["min_subscriptions"] for each in (without, adapted)
    ]
    assert readers[1] == readers[0] + 1


def test_another_scanner_is_refused_with_what_to_give(launch: Launch) -> None:
    with pytest.raises(InputError, match=r"scanner 'stage': give sim, .*module:Class, and :FILE"):
        launch(scanner="stage", model="own.yaml")


def exited(status: int) -> SimpleNamespace:
    return SimpleNamespace(returncode=status, process_name="scan_recorder-7")


def running(*, shuts_down: bool) -> SimpleNamespace:
    return SimpleNamespace(is_shutdown=shuts_down)


def test_every_node_lives_in_the_namespace_and_is_judged(launched: SimpleNamespace) -> None:
    assert {node.namespace for node in launched.nodes} == {"lab"}
    assert {node.on_exit for node in launched.nodes} == {launched.judge}


def test_a_node_that_ends_well_ends_no_other(launched: SimpleNamespace) -> None:
    assert launched.judge(exited(0), running(shuts_down=False)) is None


@pytest.mark.parametrize("status", [1, 2, 3, -9])
def test_the_first_node_that_fails_ends_the_launch_and_alone_is_named(
    launched: SimpleNamespace, status: int
) -> None:
    with pytest.raises(RuntimeError, match=f"^scan_recorder-7 ended with status {status}$"):
        launched.judge(exited(status), running(shuts_down=False))
    assert launched.judge(exited(status), running(shuts_down=True)) is None
