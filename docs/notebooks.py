"""Runs notebooks: ``python docs/notebooks.py examples/first_scan.ipynb`` writes what they show.

Bokeh's library is left out of what is written: the site has it once for all.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from afm_scan_ros.notebook import LIBRARY

PATIENCE = 900
"""Seconds for a cell, also where the machine has other work."""


def executed(path: Path, folder: Path) -> Any:  # noqa: ANN401 - nbformat's own
    """Return a notebook that was run from top to bottom in a folder, without the library."""
    import nbformat  # noqa: PLC0415 - of the extra docs
    from nbclient import NotebookClient  # noqa: PLC0415

    notebook = nbformat.read(path, as_version=4)
    where = {"metadata": {"path": str(folder)}}
    NotebookClient(notebook, timeout=PATIENCE, resources=where, record_timing=False).execute()
    for cell in notebook["cells"]:
        shown = cell.get("outputs", ())
        if shown:
            cell["outputs"] = [each for each in shown if LIBRARY not in each.get("metadata", {})]
    return notebook


def _write(path: Path) -> None:
    import nbformat  # noqa: PLC0415 - as above

    with TemporaryDirectory() as folder:
        nbformat.write(executed(path, Path(folder)), path)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        _write(Path(name))
