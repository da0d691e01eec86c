"""What the documents tell people to type is what the package takes."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from afm_scan_ros.cli.main import cli

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(language: str) -> list[tuple[str, str]]:
    """Document and text of each fenced block of a language."""
    fence = re.compile(rf"^```{language}\n(.*?)^```$", re.MULTILINE | re.DOTALL)
    return [
        (str(path.relative_to(ROOT)), block)
        for path in DOCUMENTS
        for block in fence.findall(path.read_text("utf-8"))
    ]


def commands(word: str) -> list[list[str]]:
    """Words of each command in the documents that begins with ``word``."""
    text = "\n".join(block for _, block in blocks("bash")).replace("\\\n", " ")
    lines = [line.split(" #")[0] for line in text.splitlines()]
    return [shlex.split(line) for line in lines if line.startswith(f"{word} ")]


@pytest.mark.parametrize(("document", "code"), blocks("python"))
def test_python_runs(document: str, code: str, tmp_path: Path) -> None:
    script = tmp_path / "example.py"
    script.write_text(f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{code}", "utf-8")
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert done.returncode == 0, f"{document}: {done.stderr}"


@pytest.mark.parametrize("words", commands("afm-scan"), ids=" ".join)
def test_afm_scan_takes_what_is_told(words: list[str]) -> None:
    context = click.Context(cli)
    if words[1].startswith("-"):
        assert words[1] in {name for each in cli.get_params(context) for name in each.opts}
        return
    command = cli.get_command(context, words[1])
    assert command is not None, words[1]
    if words[1] == "run":
        assert words[2] in executables()
        return
    known = {name for each in command.get_params(context) for name in each.opts}
    assert {word.split("=")[0] for word in words[2:] if word.startswith("--")} <= known


def test_what_is_imported_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all that people type in the README this alone reads a file of their own."""
    monkeypatch.chdir(tmp_path)
    (block,) = (b for name, b in blocks("bash") if name == "README.md" and "import-csv" in b)
    *before, words = (shlex.split(line) for line in block.replace("\\\n", " ").splitlines())
    for program, *arguments in before:
        assert program == "python"
        subprocess.run([sys.executable, *arguments], check=True)
    done = CliRunner().invoke(cli, words[1:])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "measured/metadata.yaml").is_file()


@pytest.mark.parametrize("words", commands("make"), ids=" ".join)
def test_make_has_the_target(words: list[str]) -> None:
    assert f"\n{words[1]}:" in (ROOT / "Makefile").read_text("utf-8")


@pytest.mark.parametrize("words", commands("ros2 run afm_scan_ros"), ids=" ".join)
def test_ros2_run_has_the_executable(words: list[str]) -> None:
    assert words[3] in executables()


@pytest.mark.parametrize("words", commands("ros2 launch afm_scan_ros"), ids=" ".join)
def test_ros2_launch_has_the_file(words: list[str]) -> None:
    assert (ROOT / "launch" / words[3]).is_file()


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", path.read_text("utf-8")):
        assert "://" in target or (path.parent / target).exists(), target


def executables() -> set[str]:
    lines = (ROOT / "resource/executables.txt").read_text("utf-8").splitlines()
    return {line.split(" = ")[0] for line in lines}
