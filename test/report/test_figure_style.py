"""How figures are drawn: in this package's style to the end, each scale beside what it is of."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.report.paper import STYLE, paper_figure, save
from afm_scan_ros.report.scan_pictures import Images, image_picture

LABELS = "axes.formatter.min_exponent"


def test_a_figure_s_labels_are_written_in_its_style(tmp_path: Path) -> None:
    """Matplotlib writes them only when the file is drawn."""
    seen = []

    class Watched(Figure):
        def savefig(self, path: Any, **given: Any) -> None:  # noqa: ANN401 - Figure's
            seen.append(mpl.rcParams[LABELS])
            super().savefig(path, **given)

    save(Watched(), tmp_path / "a.svg")
    assert seen == [STYLE[LABELS]] != [mpl.rcParams[LABELS]]


def test_each_scale_stands_beside_its_image(tmp_path: Path) -> None:
    heights = np.arange(12.0).reshape(3, 4)
    images = Images(ScanSpec(), heights, (1.2 * heights, 1.1 * heights), ("without", "with"))
    figure = paper_figure(image_picture("grating", images, ""))
    save(figure, tmp_path / "a.png")
    scales = [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
    imaged = [axes for axes in figure.axes if axes.get_images() and axes not in scales]
    assert len(scales) == len(imaged) == 4
    for scale, image in zip(scales, imaged, strict=True):
        here, there = scale.get_position(), image.get_position()
        assert abs(here.y0 - there.y0) < 0.02
        assert abs(here.y1 - there.y1) < 0.02
        assert 0.0 <= here.x0 - there.x1 < 0.05
