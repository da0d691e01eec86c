"""``--order`` is two numbers or one word."""

import click
import pytest
from click.testing import CliRunner

from afm_scan_ros.cli.identify import OrderCommand, order_option
from afm_scan_ros.core.identification.vibration.rational_fit import Order


@click.command(cls=OrderCommand)
@order_option
@click.option("--levels", type=int, default=51)
def show(order: Order | None, levels: int) -> None:
    click.echo(f"{order}; {levels}")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "None; 51"),
        (["--order", "2", "1"], "2 poles, 1 zeros; 51"),
        (["--order", "auto"], "None; 51"),
        (["--order", "auto", "--levels", "13"], "None; 13"),
    ],
)
def test_both_forms(words: list[str], said: str) -> None:
    assert CliRunner().invoke(show, words).output.strip() == said


@pytest.mark.parametrize("words", [["2", "auto"], ["0", "0"], ["two", "1"], ["2", "-1"]])
def test_anything_else_is_refused_by_its_name(words: list[str]) -> None:
    done = CliRunner().invoke(show, ["--order", *words])
    assert done.exit_code == 2
    assert "Invalid value for '--order'" in done.output
