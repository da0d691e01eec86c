"""Pictures and progress in notebooks.

Pictures are as in reports: they zoom, show values, and share axes and cursor. A notebook that is
read without being run shows an image in the place of each.
"""

import io
from base64 import b64encode
from collections.abc import Sequence
from functools import cache

from bokeh.resources import Resources
from PIL import Image

from afm_scan_ros.core.types import ProgressCallback
from afm_scan_ros.progress import timed
from afm_scan_ros.report.interactive import drawn
from afm_scan_ros.report.page import filled
from afm_scan_ros.report.paper import paper_figure
from afm_scan_ros.report.picture import BLUE, GREY, ORANGE, Curve, Map, Panel, Picture

__all__ = ["BLUE", "GREY", "LIBRARY", "ORANGE", "Curve", "Map", "Panel", "progress_line", "show"]

LIBRARY = "bokeh_library"
"""Key in the metadata of the output that brings Bokeh's library, once a kernel: 1.3 MB."""


def show(*rows: Panel | Sequence[Panel], caption: str = "", height: float = 1.0) -> None:
    """Show panels below each other, those of a sequence side by side.

    ``caption`` says what is seen, and ``height`` is that of a row over a report's.
    """
    from IPython.display import display  # noqa: PLC0415 - where there is a notebook

    _load_library()
    side_by_side = [[row] if isinstance(row, Panel) else row for row in rows]
    display({"text/html": html_of(Picture("picture", caption, side_by_side, height))}, raw=True)


def progress_line() -> ProgressCallback:
    """Return a progress callback that shows a line: what is being done, the time, and what is left.

    It is for one computation, as ``afm.identify(records, progress=progress_line())``.
    """
    from IPython.display import display  # noqa: PLC0415 - as above

    line = display({"text/plain": "begun"}, raw=True, display_id=True)
    return timed(lambda text: line.update({"text/plain": text}, raw=True))


def html_of(picture: Picture) -> str:
    """Return a picture as a part of a page, which may have Bokeh's library or not."""
    raw, still, mapped = io.BytesIO(), io.BytesIO(), any(panel.maps for panel in picture.panels)
    paper_figure(picture).savefig(raw, format="png", dpi=50 if mapped else 72)
    fewer = Image.open(raw).convert("RGB").quantize(128, method=Image.Quantize.FASTOCTREE)
    fewer.save(still, format="png", optimize=True)
    image = b64encode(still.getvalue()).decode()
    return filled("notebook.html", of=picture, drawn=drawn([picture]), still=image)


@cache
def _load_library() -> None:
    """Bring the library of all pictures to the page, once."""
    from IPython.display import display  # noqa: PLC0415 - as above

    library = Resources(mode="inline", components=["bokeh"]).render_js()
    display({"text/html": library}, raw=True, metadata={LIBRARY: True})
