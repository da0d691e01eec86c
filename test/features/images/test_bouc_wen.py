"""Bouc's and Wen's model is found from one loop, and then predicts smaller ones."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from afm_scan_ros.core.effects.hysteresis.duhem import Duhem, DuhemSlopes
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.models import Positions, model_of
from afm_scan_ros.features.images.loops.bouc_wen import BoucWenFit, fit_bouc_wen
from afm_scan_ros.features.images.loops.density import CellGrid
from afm_scan_ros.features.images.loops.fit import COARSE, held_out_by_density
from afm_scan_ros.features.images.loops.moving import LinearDynamics, MovingRecord, Swept, swept
from afm_scan_ros.features.images.loops.search import NO_CREEP, at_once
from afm_scan_ros.features.images.positions import LineDrive
from afm_scan_ros.features.images.scan_image import ScanImage

ALPHA, BETA, GAMMA = 0.35, 1.2, 0.3
SIZE, RANGE = 128, 40e-6
"""Pixels, and m: drives are in µm commanded."""


def image(size: float) -> ScanImage:
    flat = np.zeros((SIZE, SIZE))
    return ScanImage(flat, flat, size, size, line_time=1.0)


def moved(size: float) -> tuple[Array, Array]:
    """Trace and retrace (pixels,), m, by the equation itself: its integration is SciPy's."""
    reach = size / RANGE
    places = reach * ((2.0 * np.arange(SIZE) + 1.0) / SIZE - 1.0)

    def slope(way: float, v: float, h: Array) -> Array:
        del v
        return ALPHA - way * BETA * h - GAMMA * np.abs(h)

    h, sides = np.zeros(1), []
    for turn in range(13):
        way = 1.0 if turn % 2 else -1.0
        ends = (0.0 if turn == 0 else -way * reach), way * reach
        seen = places[:: int(way)] if turn else None
        found = solve_ivp(
            lambda v, h, w=way: slope(w, v, h), ends, h, t_eval=seen, rtol=1e-9, atol=1e-12
        )
        after = solve_ivp(lambda v, h, w=way: slope(w, v, h), ends, h, rtol=1e-9, atol=1e-12)
        h = after.y[:, -1]
        sides.append((found.t, found.y[0]))
    back, there = ([t + 0.05 * t**2 - h for t, h in sides[-2:]][k] for k in (1, 0))
    return 0.5 * RANGE * there, 0.5 * RANGE * back[::-1]


def rows(size: float) -> tuple[list[Swept], CellGrid]:
    line = LineDrive.of(image(size), 1e6, 1.0)
    seen = line.moved(*moved(size))
    record = MovingRecord("loop", line.drive, seen, line.sample_period, line.imaged())
    grid = CellGrid(-0.5e6 * RANGE, 0.5e6 * RANGE, COARSE)
    return list(swept([record], grid)), grid


def fitted() -> tuple[BoucWenFit, list[Swept]]:
    found, grid = rows(RANGE)
    dynamics = LinearDynamics(at_once(1.0, found[0].record.sample_period), NO_CREEP)
    return fit_bouc_wen(found, dynamics, grid.lower, grid.upper), found


def test_its_numbers_are_found_and_predict_smaller_loops() -> None:
    fit, found = fitted()
    assert np.exp(fit.numbers[0]) == pytest.approx(BETA, rel=0.05)
    assert fit.numbers[2] == pytest.approx(GAMMA / BETA, abs=0.05)
    dynamics = LinearDynamics(at_once(1.0, found[0].record.sample_period), NO_CREEP)
    assert fit.held_out < held_out_by_density(found, dynamics, 1e-7)
    line, effect = LineDrive.of(image(0.5 * RANGE), 1e6, 1.0), Duhem(fit.slopes())
    predicted = line.at_pixels(effect.apply(effect.at_rest(), line.drive)[1])
    missed = fit.gain * np.concatenate(predicted) - np.concatenate(moved(0.5 * RANGE))
    assert np.std(missed) < 2e-3 * 0.5 * RANGE
    assert float(effect.apply(effect.at_rest(), np.zeros(1))[1][0]) == pytest.approx(0.0, abs=1e-12)


def test_a_model_of_images_takes_the_form_that_predicts_better() -> None:
    there, back = moved(RANGE)
    y = np.linspace(-0.5 * RANGE, 0.5 * RANGE, SIZE)
    sides = [np.stack(np.meshgrid(x, y), axis=2) for x in (there, back)]
    found = Positions(sides[0], sides[1], np.full((SIZE, SIZE), 1e-9))
    axis = model_of([image(RANGE)], [found], (1e6, 1e6), lambda _: None).axis("x")
    assert isinstance(axis.hysteresis.forward, DuhemSlopes)
