"""What 'afm-scan run' offers is what is installed for 'ros2 run'."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from afm_scan_ros.cli.main import run
from afm_scan_ros.nodes import NODES

LIST = Path(__file__).parents[2] / "resource/executables.txt"


def test_the_nodes_are_the_executables() -> None:
    lines = LIST.read_text("utf-8").splitlines()
    assert {line.split(" = ")[0] for line in lines} == {"afm-scan", *NODES}


@pytest.mark.parametrize("arguments", [["nobody"], []])
def test_an_unknown_node_is_refused(arguments: list[str]) -> None:
    assert CliRunner().invoke(run, arguments).exit_code == 2
