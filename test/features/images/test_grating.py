"""Laws of the registration of a grating: known motions are found, and what is none is refused."""

import numpy as np
import pytest
from attrs import evolve
from scipy import signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.models import Positions, model_of, positions_of
from afm_scan_ros.features.images.grating.motion import MotionForm, Ripple, middles, spline_basis
from afm_scan_ros.features.images.grating.registration import register
from afm_scan_ros.features.images.positions import common_rectangle, regridded
from afm_scan_ros.features.images.scan_image import ScanImage

SIZE, PITCH, RANGE = 128, 5e-6, 40e-6
PIXEL = RANGE / SIZE


def posts(x: Array, y: Array, angle: float) -> Array:
    """Heights of round posts on a square lattice, with edges of a twentieth of the pitch."""
    u = (x * np.cos(angle) + y * np.sin(angle)) / PITCH
    v = (y * np.cos(angle) - x * np.sin(angle)) / PITCH
    away = np.hypot(u - np.rint(u), v - np.rint(v))
    return np.asarray(100e-9 * np.clip((0.25 - away) / 0.05 + 0.5, 0.0, 1.0))


def motion(loop: float, bend: float, scale: float) -> tuple[Array, Array]:
    """True positions (lines, pixels, 2), m, of trace and retrace, whose loop closes at the ends."""
    place = (2.0 * np.arange(SIZE) + 1.0) / SIZE - 1.0
    y = 0.5 * RANGE * (place + bend * (1.0 - place**2))
    sides = []
    for sign in (-1.0, 1.0):
        x = 0.5 * RANGE * scale * (place + sign * 0.5 * loop * (1.0 - place**2))
        sides.append(np.stack(np.meshgrid(x, y), axis=2))
    return sides[0], sides[1]


def image_of(sides: tuple[Array, Array], angle: float, noise: float, seed: int) -> ScanImage:
    """Image of posts along the motions, with noise of the heights and an offset in each line."""
    rng = np.random.default_rng(seed)
    seen = [posts(side[..., 0], side[..., 1], angle) for side in sides]
    seen = [
        heights + rng.normal(0.0, noise, heights.shape) + rng.normal(0.0, 5e-9, (SIZE, 1))
        for heights in seen
    ]
    return ScanImage(*seen, range_x=RANGE, range_y=RANGE, line_time=1.0)


def errors(found: Positions, sides: tuple[Array, Array]) -> Array:
    """Errors in pixels of all positions, without the lattice's own angle and origin."""
    seen = np.concatenate([found.trace, found.retrace]).reshape(-1, 2)
    true = np.concatenate(sides).reshape(-1, 2)
    return (seen - seen.mean(axis=0) - true + true.mean(axis=0)) / PIXEL


@pytest.mark.evidence
@pytest.mark.parametrize("seed", range(2))
def test_a_known_motion_is_found(seed: int) -> None:
    draw = np.random.default_rng(seed).uniform
    sides = motion(draw(0.0, 0.3), draw(-0.1, 0.1), draw(0.92, 1.08))
    image = image_of(sides, draw(-0.15, 0.15), 1e-9, seed)
    found = positions_of(register(image, PITCH))
    missed = errors(found, sides)
    assert np.sqrt(np.mean(missed**2)) < 0.05


@pytest.mark.evidence
def test_a_loop_longer_than_a_pitch_is_found() -> None:
    """In the middle trace and retrace are 1.2 cells apart; at the turns they meet."""
    sides = motion(0.3, 0.0, 1.0)
    found = positions_of(register(image_of(sides, 0.05, 1e-9, 3), PITCH))
    apart = (found.retrace - found.trace)[SIZE // 2, SIZE // 2, 0]
    assert apart == pytest.approx(0.15 * RANGE, rel=0.02)


def ringing(periods: float, damping: float) -> tuple[Array, Array]:
    """True positions, as in ``motion``, of a resonator that follows a triangle once it repeats.

    It rings ``periods`` times in a line one way.
    """
    fine = 32
    count = 2 * SIZE * fine
    time = 2.0 * np.arange(4 * count) / count
    triangle = 0.5 * RANGE * signal.sawtooth(np.pi * time, 0.5)
    omega = 2.0 * np.pi * periods
    system = ([omega**2], [1.0, 2.0 * damping * omega, omega**2])
    moved = signal.lsim(system, triangle, time)[1][-count:]
    there, back = moved.reshape(2, SIZE, fine).mean(axis=2)
    y = 0.5 * RANGE * ((2.0 * np.arange(SIZE) + 1.0) / SIZE - 1.0)
    trace, retrace = (np.stack(np.meshgrid(x, y), axis=2) for x in (there, back[::-1]))
    return trace, retrace


@pytest.mark.evidence
@pytest.mark.parametrize("periods", [9.3, 25.4])
def test_a_ripple_is_followed(periods: float) -> None:
    """Ripples of a quarter and a tenth of a cell, in which no smooth motion settles."""
    sides = ringing(periods, 0.02)
    found = register(image_of(sides, 0.05, 1e-9, 6), PITCH)
    assert found.form.ripple is not None
    assert found.form.ripple.periods == pytest.approx(periods, rel=0.02)
    assert np.sqrt(np.mean(errors(positions_of(found), sides) ** 2)) < 0.1


@pytest.mark.parametrize(
    ("share", "rings"), [(1.0, True), (0.6, True), (0.4, False), (1.6, False), (0.8j, False)]
)
@pytest.mark.parametrize("overscan", [0.0, 0.08])
def test_a_ripple_is_that_of_a_mode(share: complex, overscan: float, *, rings: bool) -> None:
    """Its amplitude and phase are those behind a triangle, as a simulated mode shows them."""
    ripple = Ripple(9.3, 0.02)
    form = MotionForm(8, 64, 2, 2, overscan, ripple)
    coefficients = np.zeros((form.count, 2))
    for direction, sign in enumerate((1.0, -1.0)):
        splines = form.smooth_part(direction)
        coefficients[splines, 0] = np.linspace(-4.0, 4.0, form.splines)
        line = np.ptp(spline_basis(middles(64), 2) @ coefficients[splines, 0])
        amplitude = sign * share * line * ripple.behind_a_triangle(overscan)
        first = splines.stop
        coefficients[first : first + 2, 0] = amplitude.real, -amplitude.imag
    assert form.rings_as_a_mode(coefficients) is rings
    assert not evolve(form, ripple=None).rings_as_a_mode(coefficients)


def test_a_mode_behind_a_triangle_rings_as_simulated() -> None:
    """The formula is of first order in the damping, and leaves out the mean over a pixel."""
    ripple = Ripple(9.3, 0.02)
    trace = ringing(ripple.periods, ripple.damping)[0][0, :, 0]
    place = (2.0 * np.arange(SIZE) + 1.0) / SIZE - 1.0
    amplitude = RANGE * ripple.behind_a_triangle(0.0)
    rings = ripple.columns(0.5 * (1.0 + place))[:, :2] @ (amplitude.real, -amplitude.imag)
    left = trace - rings
    left -= np.polynomial.Polynomial.fit(place, left, 1)(place)
    assert np.abs(left).max() < 0.1 * np.abs(rings).max()


@pytest.mark.evidence
def test_a_tilted_sample_moves_nothing() -> None:
    """The tilt times the place is no parabola of the pixel where the scanner is not linear."""
    sides = motion(0.1, 0.05, 1.0)
    for side in sides:
        side[..., 0] += 0.02 * RANGE * (2.0 * side[..., 0] / RANGE) ** 3
    flat = image_of(sides, 0.08, 1e-9, 1)
    assert flat.retrace is not None
    trace, retrace = (
        heights + 0.02 * (side[..., 0] - 0.5 * side[..., 1])
        for heights, side in zip((flat.trace, flat.retrace), sides, strict=True)
    )
    tilted = positions_of(register(ScanImage(trace, retrace, RANGE, RANGE, 1.0), PITCH))
    assert np.sqrt(np.mean(errors(tilted, sides) ** 2)) < 0.05


@pytest.mark.evidence
def test_a_missing_post_and_dust_move_nothing() -> None:
    sides = motion(0.1, 0.05, 1.0)
    clean = image_of(sides, 0.08, 1e-9, 1)
    assert clean.retrace is not None
    trace, retrace = clean.trace.copy(), np.array(clean.retrace)
    for heights in (trace, retrace):
        heights[40:60, 40:60] = heights[40:60, 36:37]
        heights[80:86, 90:97] += 300e-9
    spoilt = ScanImage(trace, retrace, RANGE, RANGE, 1.0)
    missed = errors(positions_of(register(spoilt, PITCH)), sides)
    assert np.sqrt(np.mean(missed**2)) < 0.15


@pytest.mark.evidence
def test_the_first_line_does_not_count() -> None:
    """It begins at rest and moves otherwise: here it shows another place altogether."""
    sides = motion(0.1, 0.0, 1.0)
    clean = image_of(sides, 0.08, 1e-9, 1)
    shifted = clean.trace.copy()
    shifted[0] = np.roll(shifted[3], SIZE // 4) + 1e-7
    image = ScanImage(shifted, clean.retrace, RANGE, RANGE, 1.0)
    one, other = (register(each, PITCH) for each in (clean, image))
    before, after = (one.form.image(0, each.coefficients) for each in (one, other))
    assert np.abs(after - before - (after - before).mean(axis=(0, 1))).max() * PITCH < 0.2 * PIXEL


@pytest.mark.evidence
@pytest.mark.parametrize(("angle", "fewest", "most"), [(0.0, 5, 8), (0.15, 1, 3)])
def test_lines_before_the_first_edges_are_left_out(angle: float, fewest: int, most: int) -> None:
    """The rows of posts begin in the seventh line, unless they are turned against the lines."""
    sides = motion(0.1, 0.0, 1.0)
    for side in sides:
        side[..., 1] += 0.3 * PITCH
    image = image_of(sides, angle, 1e-9, 4)
    found = positions_of(register(image, PITCH))
    assert fewest <= found.known.start <= most
    assert found.known.stop == SIZE
    assert np.all(np.isinf(found.uncertainty[: found.known.start]))
    assert np.all(np.isfinite(found.uncertainty[found.known]))
    down = positions_of(register(evolve(image, upward=False), PITCH), upward=False)
    assert down.known.start == 0
    assert SIZE - 3 <= down.known.stop < SIZE


@pytest.mark.evidence
def test_trace_and_retrace_that_do_not_meet_are_refused() -> None:
    """They are a cell apart at one turn, and meet at the other."""
    trace, retrace = motion(0.0, 0.0, 1.0)
    retrace[..., 0] += PITCH * (trace[..., 0] / RANGE + 0.5)
    with pytest.raises(InputError, match="which cell of the trace"):
        register(image_of((trace, retrace), 0.05, 1e-9, 7), PITCH)


def test_lines_and_noise_are_refused() -> None:
    x = np.tile(np.arange(SIZE) * PIXEL, (SIZE, 1))
    lines = 1e-7 * np.sin(2.0 * np.pi * x / PITCH)
    noise = np.random.default_rng(5).normal(0.0, 1e-9, (SIZE, SIZE))
    for heights in (lines, noise, np.zeros_like(lines)):
        with pytest.raises(InputError, match=r"lattice|recognised"):
            register(ScanImage(heights, heights, RANGE, RANGE, 1.0), PITCH)


@pytest.mark.evidence
def test_the_model_follows_the_loop() -> None:
    sides = motion(0.2, 0.0, 0.9)
    image = image_of(sides, 0.05, 1e-9, 2)
    model = model_of([image], [positions_of(register(image, PITCH))], (1e6, 1e6), lambda _: None)
    axis = model.axis("x")
    most = 0.5 * RANGE * 1e6 * (1.0 - 1.0 / SIZE)
    way = most * np.linspace(-1.0, 1.0, 2 * SIZE + 1)
    operator = axis.hysteresis.operator()
    state = operator.at_rest()
    for _ in range(2):
        state, there = operator.apply(state, way)
        state, back = operator.apply(state, way[::-1])
    reach = np.ptp(there) * axis.vibration.static_gain
    assert reach == pytest.approx(0.9 * 2.0 * most * 1e-6, rel=0.01)
    assert (back[SIZE] - there[SIZE]) / np.ptp(there) == pytest.approx(0.1, rel=0.05)


def test_a_grid_shows_what_lies_there() -> None:
    side, _ = motion(0.2, 0.1, 1.0)
    heights = side[..., 0] + 2.0 * side[..., 1]  # linear in the positions, so exact between them
    area = common_rectangle([side])
    seen = regridded(heights, side, area)
    x = np.linspace(area.left, area.right, SIZE)
    y = np.linspace(area.bottom, area.top, SIZE)
    assert np.abs(seen - x - 2.0 * y[:, np.newaxis]).max() < 1e-3 * PIXEL * 4.0
