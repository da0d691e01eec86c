"""The report on one scan, as a page."""

from afm_scan_ros.report import html
from afm_scan_ros.report.analysis import Analysis
from afm_scan_ros.report.figures import tracking_figure
from afm_scan_ros.report.tables import HEADINGS, error_rows, scan_rows
from afm_scan_ros.report.view import View

DEFINITION = (
    "The error is achieved minus desired displacement at the same sample, with no delay, gain or"
    " offset fitted; its rms is about zero, and percentages are of the desired peak-to-peak of the"
    " axis. The first to-and-fro, the approach and the preparation stand apart."
)
CAPTION = "Grey bands are turn-arounds in the x error, and steps in the y error."


def scan_report(analysis: Analysis, view: View) -> str:
    """Return the report as a self-contained HTML page."""
    notes = [html.warning(text) for text in (*analysis.shortcomings, *analysis.warnings)]
    tables = [
        part
        for tracking in (analysis.true, analysis.measured)
        if tracking is not None
        for part in (
            html.heading(f"Error of the {tracking.displacement} displacement"),
            html.table(HEADINGS, error_rows(tracking)),
        )
    ]
    return html.page(
        f"Scan {analysis.scan.scan_id}",
        *notes,
        html.table((), scan_rows(analysis)),
        html.heading("Desired and achieved"),
        html.picture(tracking_figure(view), CAPTION),
        *tables,
        html.paragraph(DEFINITION),
    )
