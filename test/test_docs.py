"""The documents: commands and code work, and links lead somewhere."""

import ast
import csv
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

from afm_scan_ros.cli.main import COMMANDS, cli
from afm_scan_ros.files import version
from afm_scan_ros.report import diagnosis_json

ROOT = Path(__file__).parents[1]
DOCUMENTS = [
    *sorted(ROOT.glob("*.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
TABLES = sorted((ROOT / "docs").rglob("tables/*.csv"))
MOST_README_LINES = 120


def relative(path: Path) -> str:
    return str(path.relative_to(ROOT))


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
def test_afm_scan_accepts_the_documented_commands(words: list[str]) -> None:
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
    monkeypatch.chdir(tmp_path)
    (block,) = (b for name, b in blocks("bash") if name == "docs/how_to/bags.md" and "savetxt" in b)
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


@pytest.mark.parametrize("path", DOCUMENTS, ids=relative)
def test_links_lead_somewhere(path: Path) -> None:
    """In a checkout, which has no page that the site's build makes."""
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", path.read_text("utf-8")):
        assert "://" in target or (path.parent / target).exists(), target


def test_the_readme_is_short() -> None:
    lines = (ROOT / "README.md").read_text("utf-8").splitlines()
    assert len(lines) <= MOST_README_LINES


def test_the_citation_is_of_this_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"\nversion: {version()}\n" in citation


def test_troubleshooting_quotes_messages_that_exist() -> None:
    """Of each message the parts in code are in a text of the package; dots stand for the rest."""
    text = (ROOT / "docs/how_to/troubleshooting.md").read_text("utf-8")
    cells = [line.split(" | ")[0] for line in text.splitlines() if line.startswith("| `")]
    known = "\n".join(texts_of_the_package())
    quoted = [part for cell in cells for part in re.findall(r"`([^`]+)`", cell)]
    assert len(quoted) > len(cells) > 30
    foreign = {"No executable found", "ros2 run", "ros2 bag record", "ambiguous", "unexplained"}
    missing = [part for part in quoted if part not in known and part not in foreign]
    assert not missing


def test_the_page_on_diagnosis_json_has_its_keys() -> None:
    page = (ROOT / "docs/reference/diagnosis_json.md").read_text("utf-8")
    writers = ("account_document", "diagnosis_document", "_effect", "_alternative")
    writers += ("_parameter", "residual_section", "_described")
    found = set()
    for path in (ROOT / "afm_scan_ros").rglob("*.py"):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.FunctionDef) and ast.unparse(node.returns or node) in DOCUMENT:
                found.add(node.name)
                missing = [key for key in keys_of(node) if f"`{key}`" not in page]
                assert node.name not in writers or not missing, missing
    assert found >= set(writers)
    tables = (diagnosis_json.LIMIT, diagnosis_json.DESCRIPTION, diagnosis_json.LOCKED)
    assert not [key for table in tables for key in table if f"`{key}`" not in page]


DOCUMENT = ("Document",)
"""What the functions return that write diagnosis.json."""


def keys_of(function: ast.FunctionDef) -> Iterator[str]:
    for node in ast.walk(function):
        if isinstance(node, ast.Dict):
            yield from (k.value for k in node.keys if isinstance(k, ast.Constant))


@pytest.fixture(scope="module")
def generator() -> dict[str, Any]:
    """Names of the program that makes pages for the site."""
    return runpy.run_path(str(ROOT / "docs/generate.py"))


def test_the_site_s_links_lead_to_pages_of_notebooks(generator: dict[str, Any]) -> None:
    sources = [(path, path.read_text("utf-8")) for path in (ROOT / "docs").rglob("*.md")]
    linked = [path for path, text in sources if ".ipynb)" in text]
    assert linked
    for path in linked:
        made = generator["on_page_markdown"](path.read_text("utf-8"))
        pages = re.findall(r"\]\(([^)]*examples/[^)]*)\)", made)
        known = {(ROOT / "docs" / name).resolve() for name in generator["NOTEBOOKS"]}
        assert pages
        assert {(path.parent / page).resolve() for page in pages} <= known


def test_the_site_s_links_lead_to_the_pages_that_it_makes(generator: dict[str, Any]) -> None:
    made = generator["on_page_markdown"]
    assert made("[a](../../config) [b](../../msg)") == (
        "[a](../reference/files.md) [b](../reference/messages.md)"
    )
    assert set(generator["SOURCES"]) <= set(generator["PAGES"])
    left = re.compile(r"\]\((\.\./)+(config|msg|afm_scan_ros|launch|docs)\b[^)]*\)")
    pages = [made(path.read_text("utf-8")) for path in (ROOT / "docs").rglob("*.md")]
    assert not [page for page in pages if left.search(page)]


@pytest.mark.parametrize("path", TABLES, ids=relative)
def test_a_page_shows_each_table(path: Path) -> None:
    with path.open(encoding="utf-8", newline="") as file:
        heads, *rows = csv.reader(file)
    assert rows
    assert all(len(row) == len(heads) for row in rows)
    assert any(f"tables/{path.name})" in page.read_text("utf-8") for page in DOCUMENTS)


def test_a_link_to_a_table_is_the_table_where_it_is_a_paragraph(generator: dict[str, Any]) -> None:
    page = "[Parts](tables/inverse.csv)\n\nMore is in [all sizes](tables/reach.csv).\n"
    made = generator["on_page_markdown"](page)
    assert made.startswith("| what | command | result |\n")
    assert made.endswith("\n\nMore is in [all sizes](tables/reach.md).\n")


@pytest.mark.parametrize("name", COMMANDS)
def test_the_reference_gives_every_option_a_meaning(generator: dict[str, Any], name: str) -> None:
    """Arguments are explained by the text above the options."""
    _, _, after = generator["commands"]().partition(f"\n## {name}\n")
    text = after.partition("\n## ")[0]
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    options = [each.opts[0] for each in command.params if isinstance(each, click.Option)]
    assert bool(options) == ("| option |" in text)
    rows = re.findall(r"^\| `(\S+)\b.*?` \| \S", text, re.MULTILINE)
    assert set(options) <= set(rows)
    assert "|  |" not in text


def test_the_page_without_ros_names_the_commands_that_start_no_node() -> None:
    page = (ROOT / "docs/how_to/without_ros.md").read_text("utf-8")
    assert not [name for name in COMMANDS if f"`{name}`" not in page and f"scan {name}" not in page]


def texts_of_the_package() -> Iterator[str]:
    """Every text in the code and every sentence, the fixed parts of those with values apart."""
    catalogue = (ROOT / "afm_scan_ros/report/templates/sentences.yaml").read_text("utf-8")
    yield " ".join(catalogue.split())
    for path in (ROOT / "afm_scan_ros").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value


def executables() -> set[str]:
    lines = (ROOT / "resource/executables.txt").read_text("utf-8").splitlines()
    return {line.split(" = ")[0] for line in lines}
