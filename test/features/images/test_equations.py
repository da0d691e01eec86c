"""Laws of the equations of an image's motion: smoothness, and what leaving out a cell shows."""

import numpy as np
import pytest

from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.equations import Missed, MotionEquations
from afm_scan_ros.features.images.grating.motion import MotionForm, middles

FORM = MotionForm(lines=24, pixels=20, pixel_intervals=3, line_intervals=4)


def coefficients_of(motion: Array) -> Array:
    """Coefficients (count,) of a motion (lines, pixels) that is the same in both directions."""
    line, pixel = np.meshgrid(middles(FORM.lines), middles(FORM.pixels), indexing="ij")
    basis = np.vstack([FORM.rows(d, line.ravel(), pixel.ravel()) for d in range(2)])
    return np.asarray(np.linalg.lstsq(basis, np.tile(motion.ravel(), 2), rcond=None)[0])


@pytest.mark.parametrize(("power", "rough"), [(2, False), (3, True)])
def test_all_third_differences_of_a_power_of_the_line_are_alike(power: int, *, rough: bool) -> None:
    """None of a parabola, and the same of a cube, up to the last coefficient, which is zero."""
    motion = np.outer(middles(FORM.lines) ** power, np.ones(FORM.pixels))
    differences = FORM.roughness()[1] @ coefficients_of(motion)
    assert len(differences) == FORM.line_intervals
    assert differences == pytest.approx(np.full(len(differences), differences[0]), abs=1e-9)
    assert bool(abs(differences[0]) > 1e-3) == rough


def test_the_uncertainty_is_that_of_leaving_out_each_cell() -> None:
    """All equations are solved anew without each cell. The prior is too weak to matter."""
    rng = np.random.default_rng(2)
    shape = FORM.lines, FORM.pixels
    missed = [
        Missed(*np.zeros((2, *shape)), *rng.standard_normal((3, *shape)), np.full(shape, 4.0))
        for _ in range(2)
    ]
    weights = [rng.uniform(0.5, 1.0, shape) for _ in missed]
    cells = [rng.integers(0, 40, shape) for _ in missed]
    prior = 1e-6 * np.eye(2 * FORM.count)
    whole = MotionEquations.of(FORM, missed, weights)

    line, pixel = np.meshgrid(middles(FORM.lines), middles(FORM.pixels), indexing="ij")
    rows = [FORM.rows(d, line.ravel(), pixel.ravel()) for d in range(2)]
    factors = np.vstack(
        [
            np.hstack([each.slope_u.reshape(-1, 1) * row, each.slope_v.reshape(-1, 1) * row])
            for each, row in zip(missed, rows, strict=True)
        ]
    )
    wanted = np.concatenate([each.residual.ravel() for each in missed])
    counts = np.concatenate([(4.0 * each).ravel() for each in weights])
    number = np.concatenate([each.ravel() for each in cells])

    def solved(kept: Array) -> Array:
        gram = (factors.T * (counts * kept)) @ factors / whole.excess + prior
        return np.asarray(
            np.linalg.solve(gram, factors.T @ (counts * kept * wanted) / whole.excess)
        )

    everything = solved(np.ones(len(wanted)))
    changes = np.array([solved((number != cell).astype(float)) - everything for cell in range(40)])
    left = [
        Missed(each.u, each.v, part.reshape(shape), each.slope_u, each.slope_v, each.weight)
        for each, part in zip(missed, np.split(wanted - factors @ everything, 2), strict=True)
    ]
    fitted = MotionEquations(FORM, whole.gram, whole.moments)
    found = fitted.uncertainty(prior, left, weights, cells)
    expected = 39.0 / 40.0 * changes.T @ changes
    assert found == pytest.approx(expected, rel=1e-2, abs=1e-3 * np.abs(expected).max())
