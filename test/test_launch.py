"""The launch file: its nodes, and how it ends. ROS's launch is replaced, for it is not here."""

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

FILE = Path(__file__).parents[1] / "launch/scan.launch.py"
GIVEN = {"bag": "scan1", "namespace": "lab"}


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Return the file's own names, and the nodes that it makes."""
    declared: dict[str, str] = {}

    def declare(name: str, **words: str) -> SimpleNamespace:
        declared[name] = GIVEN.get(name, words["default_value"])
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
        "launch_ros.parameter_descriptions": {"ParameterValue": lambda text, **_: text},
    }
    for name, members in modules.items():
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    names = runpy.run_path(str(FILE))
    return SimpleNamespace(nodes=names["nodes"](None), judge=names["judge"])


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
