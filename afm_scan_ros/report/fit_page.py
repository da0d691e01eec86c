"""The fit report as a page: what was fitted on what, and how well."""

from afm_scan_ros.core.identification.identify import Identification
from afm_scan_ros.report import html
from afm_scan_ros.report.effect_status_text import intervals_text, status_text
from afm_scan_ros.report.fit_figures import residual_figure, response_figure, slow_figure
from afm_scan_ros.report.fit_summary import finding_text
from afm_scan_ros.report.table import Rows


def fit_page(found: Identification) -> str:
    """Return the fit report as a self-contained HTML page."""
    warned = [(name, one) for name, axis in found.axes.items() for one in axis.warnings]
    known = [
        (f"{axis}, {effect}", status_text(status), intervals_text(status))
        for axis in found.model.axes
        for effect, status in found.model.axis(axis).effects.each()
    ]
    return html.page(
        "identification.html",
        findings=[f"{name}: {finding_text(one)}" for name, one in warned],
        known=Rows(("", "known, and where it holds", "95 % intervals"), known),
        axes=found.axes,
        pictures={
            "response": html.png(response_figure(found)),
            "slow": html.png(slow_figure(found)),
            "residual": html.png(residual_figure(found)),
        },
    )
