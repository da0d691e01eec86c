"""Images at several line rates show what one cannot: a resonance, creep, drift of y."""

import numpy as np
import pytest
from attrs import evolve
from scipy import signal

from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.models import Positions, model_of
from afm_scan_ros.features.images.grating.registered_image import (
    ImageQuantity,
    RegisteredImage,
    both_directions,
)
from afm_scan_ros.features.images.positions import PER_PIXEL, LineDrive
from afm_scan_ros.features.images.scan_image import ScanImage

SIZE, RANGE = 128, 40e-6
RESONANCE, DAMPING = 300.0, 0.03
FINE = 16
"""Samples of a pixel in the simulated line."""


def image_at(line_time: float, *, upward: bool = True) -> ScanImage:
    flat = np.zeros((SIZE, SIZE))
    return ScanImage(flat, flat, RANGE, RANGE, line_time, upward)


def line_of(line_time: float) -> tuple[Array, Array]:
    """Trace and retrace (pixels,), m, of a resonator that follows a triangle, once it repeats."""
    count = 2 * SIZE * FINE
    time = line_time * np.arange(4 * count) / count
    triangle = 0.5 * RANGE * signal.sawtooth(2.0 * np.pi * time / line_time, 0.5)
    omega = 2.0 * np.pi * RESONANCE
    system = ([omega**2], [1.0, 2.0 * DAMPING * omega, omega**2])
    moved = signal.lsim(system, triangle, time)[1][-count:]
    there, back = moved.reshape(2, SIZE, FINE).mean(axis=2)
    return there, back[::-1]


def positions_at(line_time: float) -> Positions:
    sides = []
    for x in line_of(line_time):
        y = np.linspace(-0.5 * RANGE, 0.5 * RANGE, SIZE)
        sides.append(np.stack(np.meshgrid(x, y), axis=2))
    uncertainty = np.full((SIZE, SIZE), 1e-9)
    uncertainty[0] = np.inf
    return Positions(sides[0], sides[1], uncertainty)


@pytest.mark.evidence
def test_a_second_rate_shows_the_resonance() -> None:
    times = (1.0, 0.1)
    images, found = [image_at(t) for t in times], [positions_at(t) for t in times]
    axis = model_of(images, found, (1e6, 1e6), lambda _: None).axis("x")
    known = {each.name: each for each in axis.effects.vibration.intervals}
    assert known["resonance"].lower == pytest.approx(RESONANCE, rel=0.02)
    assert known["resonance"].upper == pytest.approx(RESONANCE, rel=0.02)
    assert axis.effects.vibration.status.value == "identified"
    assert axis.effects.hysteresis.frequencies == pytest.approx((1.0, 10.0))


@pytest.mark.evidence
def test_the_angle_of_the_fastest_image_is_shared_by_both_axes() -> None:
    """The slow image also drifts; half of what is left of the angle is in each axis."""
    times, angles = (1.0, 0.1), (0.05, 0.02)
    images, found = [image_at(t) for t in times], [positions_at(t) for t in times]
    for each, angle in zip(found, angles, strict=True):
        for side in (each.trace, each.retrace):
            side[..., 0] += angle * side[..., 1]
    model = model_of(images, found, (1e6, 1e6), lambda _: None)
    for name in ("x", "y"):
        (added,) = model.axis(name).added
        assert (added.name, added.kind) == ("cross_coupling", "static")
        assert added.values[0] == pytest.approx(0.5 * angles[1], rel=1e-6)
    alone = model_of(images[:1], found[:1], (1e6, 1e6), lambda _: None)
    assert alone.axis("x").added == alone.axis("y").added == ()


def test_a_line_that_repeats_counts_once() -> None:
    """Parts of a record predict each other, unless one of them repeats another."""
    line = LineDrive.of(image_at(1.0), 1e6, 1.0)
    shown = line.drive[line.imaged()]
    assert len(shown) == 2 * SIZE * PER_PIXEL
    assert np.all(np.diff(shown[: len(shown) // 2]) > 0.0)


def test_one_rate_leaves_creep_and_resonance_unknown() -> None:
    axis = model_of([image_at(1.0)], [positions_at(1.0)], (1e6, 1e6), lambda _: None).axis("x")
    assert axis.effects.creep.status.value == "unknown"
    assert axis.effects.vibration.status.value == "unknown"


def test_a_line_lags_by_less_than_a_tenth_of_a_pixel() -> None:
    """A motion without a loop has none in the model: no sample of the record is late."""
    straight = (2.0 * np.arange(SIZE) + 1.0) / SIZE - 1.0
    y = np.linspace(-1.0, 1.0, SIZE)
    side = 0.5 * RANGE * np.stack(np.meshgrid(straight, y), axis=2)
    found = Positions(side, side, np.full((SIZE, SIZE), 1e-9))
    axis = model_of([image_at(1.0)], [found], (1e6, 1e6), lambda _: None).axis("x")
    surface = axis.hysteresis.surface
    middle = len(surface.values) // 2
    bulge = surface.values[-1, 0] - 2.0 * surface.values[middle, 0]
    assert abs(bulge) < 0.1 / SIZE * (surface.output_upper - surface.output_lower)


def seen(scale: float, angle: float, *, upward: bool) -> RegisteredImage:
    figures = (
        ImageQuantity("scale", "y", "1", scale, scale - 1e-3, scale + 1e-3),
        ImageQuantity("angle to a right one", "y", "°", angle, angle - 0.01, angle + 0.01),
    )
    return RegisteredImage(image_at(1.0, upward=upward), positions_at(0.1), figures)


def test_both_directions_separate_scale_and_drift() -> None:
    """Drift adds upwards what it takes downwards."""
    up, down = seen(1.02, 0.3, upward=True), seen(0.98, 0.1, upward=False)
    assert both_directions([up]) == ()
    scale, angle, y, x = both_directions([up, down])
    speed = 1e9 * RANGE / SIZE
    assert scale.value == pytest.approx(1.0)
    assert angle.value == pytest.approx(0.2)
    assert y.value == pytest.approx(0.02 * speed)
    assert x.value == pytest.approx(np.radians(0.1) * speed, rel=1e-3)
    assert scale.upper - scale.lower == pytest.approx(2e-3 / np.sqrt(2.0))
    assert both_directions([down, evolve(up)])[2].value == pytest.approx(y.value)
