"""An image that is refused leaves the others in use, and the result says so."""

import numpy as np
import pytest
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_ros.features.images.grating import registered_image
from afm_scan_ros.features.images.grating.models import Positions
from afm_scan_ros.features.images.grating.registered_image import (
    ImageQuantity,
    RegisteredImage,
    accurate_ones,
)
from afm_scan_ros.features.images.report import grating_table

pytestmark = pytest.mark.evidence

PITCH = 6e-6
"""m, along the turned coordinates."""


def grating(size: float) -> afm.ScanImage:
    """Image of a grating over a square of such a ``size`` (m)."""
    x, y = np.meshgrid(*2 * [0.9 * size * np.linspace(-0.5, 0.5, 96)])
    turned = x + 0.1 * y, y - 0.1 * x
    heights = 50e-9 * sum(np.cos(2.0 * np.pi * each / PITCH) ** 3 for each in turned)
    return afm.ScanImage(heights, heights, size, size, line_time=1.0, name="whole.npz")


def without_cells() -> afm.ScanImage:
    noise = 50e-9 * np.random.default_rng(0).standard_normal((96, 96))
    return afm.ScanImage(noise, noise, 20e-6, 20e-6, line_time=1.0, name="noise.npz")


def test_the_other_images_are_used() -> None:
    whole, noise = grating(40e-6), without_cells()
    found = afm.identify_from_images([noise, whole], PITCH / np.hypot(1.0, 0.1))
    alone = afm.identify_from_images([whole], PITCH / np.hypot(1.0, 0.1))
    assert found.images == (whole,)
    (reason,) = found.refused
    assert reason.startswith("noise.npz: ")
    assert np.array_equal(found.positions[0].trace, alone.positions[0].trace)
    shown = grating_table(found)
    assert reason in shown.title
    assert alone.refused == ()


def test_the_first_error_is_raised_where_all_are_refused() -> None:
    noise = without_cells()
    other = evolve(noise, name="other.npz")
    with pytest.raises(afm.InputError, match=r"^noise.npz: "):
        afm.identify_from_images([noise, other], PITCH)


def known_to(x: float, y: float, size: float) -> RegisteredImage:
    """Return a registered image whose pitch is known to x and y (% rms)."""
    image = evolve(without_cells(), range_x=size, range_y=size, name=f"{x} {y} {size}")
    figures = [
        ImageQuantity(registered_image.PITCH, axis, "% rms", each, each, each)
        for axis, each in (("x", x), ("y", y))
    ]
    return RegisteredImage(image, Positions(*np.empty((3, 0))), tuple(figures))


def test_an_image_that_is_not_accurate_is_refused() -> None:
    """One must be accurate in x and y; beside it half the uncertainty counts, of x if smaller."""
    large, small = 40e-6, 20e-6
    exact, faint, worse = (known_to(*each, large) for each in ((0.1, 0.2), (0.1, 0.6), (0.1, 0.8)))
    smaller, astray = known_to(0.6, 0.9, small), known_to(0.8, 0.1, small)
    used, errors = accurate_ones([smaller, astray, exact, faint, worse], 0.0035)
    assert used == [smaller, exact, faint]
    assert [str(error).split(":")[0] for error in errors] == ["0.8 0.1 2e-05", "0.1 0.8 4e-05"]
    assert "known to 0.8 % rms over the image (95 %), and 0.35 % is asked" in str(errors[0])
    used, errors = accurate_ones([smaller, faint], 0.0035)
    assert used == []
    assert len(errors) == 2
    assert accurate_ones([faint, smaller], 0.0095) == ([faint, smaller], [])
