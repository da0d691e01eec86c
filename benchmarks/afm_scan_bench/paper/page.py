"""The report: every section on one page, and its numbers as JSON."""

from collections.abc import Iterable, Sequence
from typing import Any

from attrs import asdict

from afm_scan_bench.paper.section import Section
from afm_scan_ros.report import html

ABOUT = (
    "The tables and figures of D. Croft, G. Shed and S. Devasia, Creep, Hysteresis, and Vibration"
    " Compensation for Piezoactuators: Atomic Force Microscopy Application, J. Dyn. Sys. Meas."
    " Control 123 (2001) 35-43, made anew on a simulated scanner. The scanner is that of"
    " config/plant.yaml: linear dynamics of the paper's Eqs. 5 to 9 with a resonance added, a"
    " hysteresis of another kind than the model's, sensor noise and 16 bits. The model is"
    " config/model.yaml, which calibration made of it. Published numbers stand beside ours; a"
    " published figure stands as what the paper states of it."
)
HEADINGS = ("", "paper", "ours")


def page(sections: Iterable[Section]) -> str:
    """Return the report as a self-contained HTML page."""
    parts = [part for each in sections for part in _section(each)]
    return html.page("The paper's results, reproduced", html.paragraph(ABOUT), *parts)


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


def _section(section: Section) -> Sequence[str]:
    pictures = [html.picture(drawn.figure, drawn.caption) for drawn in section.pictures]
    details = [html.table(section.details[0], section.details[1:])] if section.details else []
    return (
        html.heading(section.title),
        html.table(HEADINGS, [row.row() for row in section.compared]),
        html.paragraph(section.text),
        *pictures,
        *details,
    )
