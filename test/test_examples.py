"""The notebooks run from top to bottom, and what is committed of them is what they show."""

import json
import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
LARGEST = 300_000
"""Bytes of a notebook with its outputs."""
DATA = "AFM_SCAN_DATA"
"""Names the folder of measurements that some notebooks need."""
PATIENCE = 900.0
"""Seconds for a cell, also where the machine has other work."""


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbclient = pytest.importorskip("nbclient", reason="the extra docs is not installed")
    nbformat = pytest.importorskip("nbformat", reason="it comes with nbclient")
    pytest.importorskip("ipykernel", reason="the extra docs is not installed")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    if DATA in path.read_text("utf-8"):
        folder = Path(os.environ.get(DATA) or ROOT.parent / "shared/data")
        if not folder.is_dir():
            pytest.skip(f"{DATA}: {folder} holds no measurements")
        monkeypatch.setenv(DATA, str(folder))
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = nbformat.read(path, as_version=4)
    where = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=PATIENCE, resources=where).execute()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_with_its_outputs(path: Path) -> None:
    assert path.stat().st_size < LARGEST
    cells = json.loads(path.read_text("utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["execution_count"] for cell in code)
    outputs = [output for cell in code for output in cell["outputs"]]
    assert any("text" in output or "data" in output for output in outputs)
    assert not any(output["output_type"] == "error" for output in outputs)
