"""``--order`` is two numbers."""

import pytest
from click.testing import CliRunner

from afm_scan_ros.cli.identify import identify


@pytest.mark.parametrize("words", [["2", "auto"], ["0", "0"], ["two", "1"], ["2", "-1"]])
def test_anything_else_is_refused_by_its_name(words: list[str]) -> None:
    done = CliRunner().invoke(identify, ["--order", *words])
    assert done.exit_code == 2
    assert "Invalid value for '--order'" in done.output
