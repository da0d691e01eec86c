"""The tutorial adds an effect by one new file: its code is run as written."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from effects_page import effects_page

ROOT = Path(__file__).parents[3]
TUTORIAL = (ROOT / "docs/tutorials/adding_an_effect.md").read_text("utf-8")
NAME = "crossover_distortion"
FOLDER = "afm_scan_ros/core/effects"


def blocks(language: str) -> list[str]:
    """Text of each fenced block of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", TUTORIAL, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the new file, and a module that makes it a part of the effects' package."""
    folder = tmp_path_factory.mktemp("one_more")
    assert f"`{FOLDER}/{NAME}.py`" in TUTORIAL
    (folder / "effects").mkdir()
    (folder / "effects" / f"{NAME}.py").write_text(blocks("python")[0], "utf-8")
    added = f"effects.__path__.append({str(folder / 'effects')!r})"
    (folder / "one_file_more.py").write_text(
        f"from afm_scan_ros.core import effects\n{added}\n", "utf-8"
    )
    return folder


def run(beside: Path, *arguments: str) -> str:
    """Run Python, for which the new file is one of the package."""
    path = os.pathsep.join((str(beside), str(ROOT), os.environ.get("PYTHONPATH", "")))
    done = subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": path},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def arguments_of(program: str) -> list[str]:
    """What the tutorial gives a program that it runs."""
    (found,) = re.findall(rf"^python {program} (.*)$", "".join(blocks("bash")), re.MULTILINE)
    return str(found).split()


@pytest.mark.evidence
def test_the_effect_obeys_the_laws(beside: Path) -> None:
    options = ("-p", "one_file_more", "-p", "no:cacheprovider")
    message = run(beside, "-m", "pytest", *options, *arguments_of("-m pytest"), "-vv")
    for law in ("neutral", "blocks", "inverse_undoes", "equal_elements", "model_with_an_effect"):
        assert re.search(rf"{law}.*\[{NAME}-\] PASSED", message), law


def test_the_effect_stands_on_the_catalogue_page(beside: Path, tmp_path: Path) -> None:
    program = "docs/effects_page.py"
    assert arguments_of(program) == ["docs/reference/effects.md"]
    page = tmp_path / "effects.md"
    code = f"import one_file_more, runpy; runpy.run_path({program!r}, run_name='__main__')"
    run(beside, "-c", code, str(page))
    written = page.read_text("utf-8")
    assert f"### {NAME}\n\nCrossover distortion: " in written
    assert "- Parameters (drive): `width` (0 to 1 V)." in written
    assert f"- Confusable with: {NAME}, hysteretic_stiffness, parameter_shift" in written
    changed = set(effects_page().splitlines()) - set(written.splitlines())
    assert all("backlash" in line or "static_nonlinearity" in line for line in changed)


@pytest.mark.evidence
def test_the_effect_is_diagnosed(beside: Path) -> None:
    script = beside / "diagnose_it.py"
    script.write_text(f"import one_file_more\n{blocks('py')[0]}", "utf-8")
    (expected,) = blocks("text")
    assert run(beside, str(script)) == expected
