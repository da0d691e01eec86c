"""The report: every section on one page, and its numbers as JSON."""

from base64 import b64encode
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any

from attrs import asdict
from matplotlib.figure import Figure

from afm_scan_bench.paper.section import Section
from afm_scan_ros.report.page import filled
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.table import Rows

HEADINGS = ("", "paper", "ours")


def page(sections: Iterable[Section]) -> str:
    """Return the report as a self-contained HTML page."""
    parts = [
        {
            "title": each.title,
            "compared": Rows(HEADINGS, [row.row() for row in each.compared]),
            "text": each.text,
            "pictures": [(drawn.caption, _png(drawn.figure)) for drawn in each.pictures],
            "details": each.details and Rows(each.details[0], each.details[1:]),
        }
        for each in sections
    ]
    return filled("paper.html", Path(__file__).parent / "templates", sections=parts)


@styled
def _png(figure: Figure) -> str:
    """Draw a figure as a PNG file, in the characters that a page's address of it has."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=160)
    return b64encode(stream.getvalue()).decode("ascii")


def document(sections: Iterable[Section]) -> dict[str, Any]:
    """Return all numbers for JSON: published and ours by section, and the details."""
    return {
        each.name: {
            "title": each.title,
            "compared": [
                asdict(row, filter=lambda a, _: a.name != "form") for row in each.compared
            ],
            "numbers": each.numbers,
            "text": each.text,
        }
        for each in sections
    }
