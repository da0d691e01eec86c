"""The notebooks run from top to bottom, and what is committed of them is what they show."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from notebooks import executed

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
LARGEST = 400_000
"""Bytes of a notebook with its outputs."""
DATA = "AFM_SCAN_DATA"
"""Names the folder of measurements that some notebooks need."""


def shown_by(cells: Sequence[Mapping[str, Any]]) -> list[str]:
    """Kinds of what the cells of a notebook show beside text, in their order."""
    outputs = [output for cell in cells for output in cell.get("outputs", ())]
    return [kind for output in outputs for kind in output.get("data", ())]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("nbclient", reason="the extra docs is not installed")
    pytest.importorskip("ipykernel", reason="the extra docs is not installed")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    if DATA in path.read_text("utf-8"):
        folder = Path(os.environ.get(DATA) or ROOT.parent / "shared/data")
        if not folder.is_dir():
            pytest.skip(f"{DATA}: {folder} holds no measurements")
        monkeypatch.setenv(DATA, str(folder))
    shown = shown_by(executed(path, tmp_path)["cells"])
    committed = shown_by(json.loads(path.read_text("utf-8"))["cells"])
    assert shown.count("text/html") == committed.count("text/html")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_with_its_outputs(path: Path) -> None:
    assert path.stat().st_size < LARGEST
    cells = json.loads(path.read_text("utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["execution_count"] for cell in code)
    outputs = [output for cell in code for output in cell["outputs"]]
    assert any("text" in output or "data" in output for output in outputs)
    assert not any(output["output_type"] == "error" for output in outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_pictures_of_a_notebook_are_interactive(path: Path) -> None:
    """And an image stands in their place where no script runs."""
    cells = json.loads(path.read_text("utf-8"))["cells"]
    assert "image/png" not in shown_by(cells)
    outputs = [output.get("data", {}) for cell in cells for output in cell.get("outputs", ())]
    for page in ("".join(data["text/html"]) for data in outputs if "text/html" in data):
        assert "root.Bokeh.embed.embed_items" in page
        assert '<img alt="' in page
