"""Pictures of ``afm-scan grating``: a spike does not hide the rest, and all lines are named."""

import numpy as np
from attrs import evolve

from afm_scan_ros.features.images.grating.models import Positions
from afm_scan_ros.features.images.report import (
    ROWS,
    SIDES,
    correction_picture,
    deviation_picture,
)
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.report.picture import Curve

RNG = np.random.default_rng(1)
TRACE, RETRACE = 1e-9 * RNG.normal(size=(2, 256, 192))
IMAGE = ScanImage(TRACE, RETRACE, 48e-6, 64e-6, line_time=1.0, name="some/where/cells.nid")


def colours(before: ScanImage, after: ScanImage) -> list[tuple[float, float]]:
    drawn = [one for panel in correction_picture(before, after).panels for one in panel.maps]
    assert len(drawn) == len(ROWS) * len(SIDES)
    return [(one.low, one.high) for one in drawn]


def test_a_spike_does_not_set_the_colours() -> None:
    spiked = TRACE.copy()
    spiked[3, 5] = 1e-6
    found = colours(IMAGE, evolve(IMAGE, trace=spiked))
    np.testing.assert_allclose(found, colours(IMAGE, IMAGE), rtol=0.01)


def test_before_and_after_have_the_same_colours() -> None:
    found = colours(IMAGE, evolve(IMAGE, trace=3.0 * TRACE, retrace=3.0 * TRACE))
    assert found[: len(SIDES)] == found[len(SIDES) :]
    assert found[0] == found[1]
    assert found[2][0] == -found[2][1]


def test_every_panel_of_deviations_names_its_lines() -> None:
    place = np.stack(np.meshgrid(np.arange(192.0), np.arange(256.0)), axis=2) * 1e-7
    positions = Positions(place, place + 1e-8, np.ones(TRACE.shape))
    panels = deviation_picture([IMAGE, IMAGE], [positions, positions]).panels
    assert len(panels) == 4
    for panel in panels:
        assert [one.name for one in panel.marks if isinstance(one, Curve)] == ["trace", "retrace"]
        assert panel.title.startswith("cells.nid: ")
