"""The command as a shell sees it: one line on stderr and a status, whatever was given."""

import re
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import entry_points

import click
import pytest

from afm_scan_ros.cli import main as command
from afm_scan_ros.core.errors import InputError, ScanError

BENCHMARKS = entry_points(group=command.PLUGINS, name="bench")
HEAVY = ("numpy", "scipy", "matplotlib", "bokeh", "numba", "rosbags")

Run = Callable[..., tuple[int, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    def afm_scan(*arguments: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["afm-scan", *arguments])
        with pytest.raises(SystemExit) as end:
            command.main()
        return int(end.value.code or 0), capsys.readouterr().err

    return afm_scan


def test_help_does_not_wait_for_numerics() -> None:
    code = f"""
import sys
from afm_scan_ros.cli.main import main
sys.argv = ["afm-scan", "--help"]
try:
    main()
finally:
    print([name for name in {HEAVY} if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("[]\n")
    assert all(name in done.stdout for name in command.COMMANDS)


@pytest.mark.parametrize("name", command.COMMANDS)
def test_every_command_is_there(name: str) -> None:
    with click.Context(command.cli) as context:
        assert isinstance(command.cli.get_command(context, name), click.Command)


def test_without_a_command_it_says_which_there_are(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["afm-scan"])
    with pytest.raises(SystemExit) as end:
        command.main()
    message = capsys.readouterr()
    assert (end.value.code or 0, message.err) == (0, "")
    assert all(f"\n  {name}" in message.out for name in command.COMMANDS)


def test_the_help_lists_each_exit_status() -> None:
    """Those that the command ends with, in the sentence that lists them, and no others."""
    said = " ".join(str(command.cli.help).split())
    listed = re.findall(r"(?:^|; )(\d+) ", said.partition("Exit status: ")[2])
    ends = (command.BAD_INPUT, command.DOES_NOT_HOLD, command.INTERRUPTED)
    assert [int(status) for status in listed] == [0, *ends]


def test_version(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    del capsys
    assert run("--version") == (0, "")
    assert re.fullmatch(r"\d+\.\d+\.\d+", command.version())


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["scn"], "No such command 'scn'"),
        (["--loud"], "No such option"),
        (["analyze"], "Missing argument"),
        (["bench", "nothing"], "'nothing' is not one of" if BENCHMARKS else "are not installed"),
    ],
)
def test_bad_usage_is_one_line_and_2(run: Run, arguments: list[str], reason: str) -> None:
    status, message = run(*arguments)
    assert status == 2
    assert reason in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(
    ("raised", "status"),
    [
        (InputError("scan.yaml: wrong\nin two lines"), 2),
        (ScanError("sample 3 of x is 6 V"), 3),
        (PermissionError(13, "Permission denied", "out/file"), 2),
        (KeyboardInterrupt(), 130),
    ],
)
def test_every_end_is_one_line_and_a_status(
    run: Run, monkeypatch: pytest.MonkeyPatch, raised: BaseException, status: int
) -> None:
    @click.command()
    def demo() -> None:
        raise raised

    monkeypatch.setattr(command.cli, "get_command", lambda *_: demo)
    ended, message = run("demo")
    assert ended == status
    assert message.strip().count("\n") == 0
    assert message.strip().startswith("afm-scan: ")
