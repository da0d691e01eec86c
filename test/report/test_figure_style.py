"""How figures are drawn: in this package's style to the end, each scale beside what it is of."""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.report.html import png
from afm_scan_ros.report.scan_figures import Images, image_figure
from afm_scan_ros.report.style import STYLE

LABELS = "axes.formatter.min_exponent"


def test_a_figure_s_labels_are_written_in_its_style() -> None:
    """Matplotlib writes them only when the file is drawn."""
    seen = []

    class Watched(Figure):
        def savefig(self, *_: Any, **__: Any) -> None:  # noqa: ANN401 - Figure's
            seen.append(mpl.rcParams[LABELS])

    png(Watched())
    assert seen == [STYLE[LABELS]] != [mpl.rcParams[LABELS]]


def test_the_scale_of_errors_stands_beside_the_errors_alone() -> None:
    heights = np.arange(12.0).reshape(3, 4)
    figure = image_figure(
        Images(ScanSpec(), heights, (1.2 * heights, 1.1 * heights), ("without", "with"))
    )
    png(figure)
    imaged, _, wrong, _, heights_scale, scale = (axes.get_position() for axes in figure.axes)
    assert heights_scale.y0 > wrong.y1
    assert scale.y1 < imaged.y0
    assert scale.y1 <= wrong.y1 + 0.01
