"""Pictures of ``afm-scan grating``: a spike does not hide the rest, and all lines are named."""

import numpy as np
from attrs import evolve
from matplotlib.figure import Figure

from afm_scan_ros.features.images.grating.models import Positions
from afm_scan_ros.features.images.report import (
    ROWS,
    SIDES,
    correction_figure,
    deviation_figure,
)
from afm_scan_ros.features.images.scan_image import ScanImage

RNG = np.random.default_rng(1)
TRACE, RETRACE = 1e-9 * RNG.normal(size=(2, 256, 192))
IMAGE = ScanImage(TRACE, RETRACE, 48e-6, 64e-6, line_time=1.0, name="some/where/cells.nid")


def colours(figure: Figure) -> list[tuple[float, float]]:
    drawn = [image for axes in figure.axes for image in axes.get_images()]
    assert len(drawn) == len(ROWS) * len(SIDES)
    return [image.get_clim() for image in drawn]


def test_a_spike_does_not_set_the_colours() -> None:
    spiked = TRACE.copy()
    spiked[3, 5] = 1e-6
    clean = colours(correction_figure("cells", IMAGE, IMAGE))
    found = colours(correction_figure("cells", IMAGE, evolve(IMAGE, trace=spiked)))
    np.testing.assert_allclose(found, clean, rtol=0.01)


def test_before_and_after_have_the_same_colours() -> None:
    after = evolve(IMAGE, trace=3.0 * TRACE, retrace=3.0 * TRACE)
    found = colours(correction_figure("cells", IMAGE, after))
    assert found[: len(SIDES)] == found[len(SIDES) :]
    assert found[0] == found[1]
    assert found[2][0] == -found[2][1]


def test_every_panel_of_deviations_names_its_lines() -> None:
    place = np.stack(np.meshgrid(np.arange(192.0), np.arange(256.0)), axis=2) * 1e-7
    positions = Positions(place, place + 1e-8, np.ones(TRACE.shape))
    panels = deviation_figure([IMAGE, IMAGE], [positions, positions]).axes
    assert len(panels) == 4
    for panel in panels:
        _, labels = panel.get_legend_handles_labels()
        assert labels == ["trace", "retrace"]
        assert panel.get_legend() is not None
        assert panel.get_title(loc="left").startswith("cells.nid: ")
