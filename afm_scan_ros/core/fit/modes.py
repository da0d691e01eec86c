"""The mode that a fit lacks: the resonance that would lower its objective most.

A mode of pole p is tried with a weight κ of zero, about which the fit is linear. Were all other
parameters θ fitted anew with it, the objective would fall by

    ½ gᵀ κ,    κ = S⁻¹ g,    S = H_κκ - H_κθ H_θθ⁻¹ H_θκ,    g = b_κ - H_κθ H_θθ⁻¹ b_θ,

with the normal equations' H and b. So neither plays nor lags hide a resonance by an imitation of
it. This is Rao's score test. Source: C. R. Rao, Math. Proc. Camb. Phil. Soc. 44 (1948) 50.
"""

from collections.abc import Iterable, Iterator, Sequence
from copy import copy

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.parameters import Mode


@frozen
class FoundMode:
    """A mode, by how much (nat) it lowers the objective, and the static gain over that before."""

    mode: Mode
    chance: float
    gain: float


EQUAL, HALF_OR_TWICE, NEAR = (1.0,), (0.5, 1.0, 2.0), (0.7, 0.85, 1.0, 1.2, 1.4)
"""Dampings over that of the best mode so far: of the first climb, of the second, and at the end."""
Place = tuple[float, float]
"""Angular frequency (rad/s) and damping."""
Spectrum = tuple[NDArray[np.floating], NDArray[np.floating]]
"""Angular frequencies (rad/s) and power over that of noise, both (n,)."""


def first_mode(fit: AxisFit) -> FoundMode | None:
    """Return the mode that explains most of what a straight line leaves, None where it is little.

    Then the residuals are about a resonance rather than of the loops of the hysteresis. The static
    gain is free beside it, for a straight line through such a motion has another.
    """
    free = np.zeros(fit.layout.size, bool)
    for name in ("lags", "creep"):
        free[fit.layout.parts[name]] = True
    return _best(fit, free, fit.layout.settings.dominant_share * fit.misfit(fit.theta))


def further_mode(fit: AxisFit) -> FoundMode | None:
    """Return the mode that explains most beside all that is fitted, None where it is little.

    It is to be of possible weight, and to explain a share of what is left about its frequency, of
    so many lines that chance does not: a resonance of any frequency explains a single one.
    """
    settings = fit.layout.settings
    found = _best(fit, np.ones(fit.layout.size, bool), settings.mode_chance)
    if found is None or np.hypot(*found.mode[2:]) > settings.heaviest_mode:
        return None
    misfit, lines, _ = _left_about(_spectra(fit), found.mode[0], settings.mode_band)
    share = min(found.chance / misfit, 1.0 - settings.tone_chance)
    seen = -lines * np.log1p(-share) > settings.mode_chance
    return found if seen and share > settings.mode_share else None


def _best(fit: AxisFit, free: NDArray[np.bool_], enough: float) -> FoundMode | None:
    """Try peaks of what is left, and climb from the best one to the summit.

    What is explained best by the greatest damping is a bend of the response, and no mode.
    """
    settings = fit.layout.settings
    width = 2.0 * settings.tried_damping
    peaks = [(omega, settings.tried_damping) for omega in _peaks(fit, width, enough)]
    found = max(_tried(fit, peaks, free), key=_chance, default=None)
    if found is None or found.chance < settings.near_chance * enough:
        return None
    for dampings in (EQUAL, HALF_OR_TWICE):
        found = _climbed(fit, found, free, dampings)
    if found.mode[1] >= settings.greatest_damping or found.chance < enough:
        return None
    return max(found, *_tried(fit, _about(found, 0.5, NEAR), free), key=_chance)


def _climbed(
    fit: AxisFit, found: FoundMode, free: NDArray[np.bool_], dampings: Sequence[float]
) -> FoundMode:
    """Go from a mode to the best one near it, of ``dampings`` over its own, and on from there."""
    for _ in range(fit.layout.settings.most_trials):
        before = found
        found = max(found, *_tried(fit, _about(found, 2.0, dampings), free), key=_chance)
        if found is before or found.mode[1] >= fit.layout.settings.greatest_damping:
            break
    return found


def _about(found: FoundMode, width: float, dampings: Sequence[float]) -> list[Place]:
    """Places about a mode: within a ``width`` in half bandwidths, of ``dampings`` over its own."""
    omega, damping, *_ = found.mode
    near = omega * np.exp(width * damping * np.linspace(-1.0, 1.0, 5))
    return [(float(at), damping * share) for at in near for share in dampings]


def _peaks(fit: AxisFit, width: float, enough: float) -> list[float]:
    """Angular frequencies (rad/s) about which more is left than beside them, the most first.

    Each is that of a band of a ``width``, in which the power of what is left exceeds that of noise
    by a part of ``enough`` (nat) at least.
    """
    settings, (lowest, highest) = fit.layout.settings, _band(fit)
    count = int(np.log(highest / lowest) / width) if highest > lowest else 0
    grid = np.geomspace(lowest, highest, 2 * count + 1)
    spectra = _spectra(fit)
    left = np.array([_left_about(spectra, omega, 0.5 * width) for omega in grid])
    misfit, _, bins = np.pad(left, ((1, 1), (0, 0))).T
    density = misfit / np.maximum(bins, 1.0)
    peaks = np.flatnonzero((density[1:-1] >= density[:-2]) & (density[1:-1] >= density[2:]))
    excess = (misfit - bins)[1:-1]
    some = [k for k in peaks if excess[k] > settings.near_chance * enough]
    return [float(grid[k]) for k in sorted(some, key=lambda k: -excess[k])[: settings.most_peaks]]


def _chance(found: FoundMode) -> float:
    return found.chance


def _band(fit: AxisFit) -> tuple[float, float]:
    """Lowest and highest angular frequency (rad/s) of a mode: what is slower than lags is creep."""
    settings = fit.layout.settings
    lengths = [one.length * len(one.mean) for one in fit.records]
    lowest = 2.0 * np.pi * settings.tone_cycles / max(lengths)
    if fit.layout.modes:
        first = min(omega for omega, *_ in fit.layout.of_modes(fit.theta))
        lowest = max(lowest, first / settings.slowest_lag)
    return lowest, 0.8 * np.pi / min(one.length for one in fit.records)


def _tried(fit: AxisFit, places: Sequence[Place], free: NDArray[np.bool_]) -> Iterator[FoundMode]:
    """Yield what each mode explains, the ``free`` parameters (size,) of the fit being fitted.

    So many are tried at a time as memory holds derivatives of.
    """
    blocks, settings = max(one.blocks for one in fit.records), fit.layout.settings
    at_once = max(settings.mode_values // blocks, 1)
    for first in range(0, len(places), at_once):
        yield from _tried_at_once(fit, places[first : first + at_once], free)


def _tried_at_once(
    fit: AxisFit, places: Sequence[Place], free: NDArray[np.bool_]
) -> Iterator[FoundMode]:
    wider, layout, last = copy(fit), fit.layout, fit.layout.parts["modes"].stop
    for omega, damping in places:
        wider.add((omega, damping, 0.0, 0.0))
    matrix, right = wider.normal(with_operator=bool(free[0]))
    precision, mean = wider.layout.prior(fit.scales, wider.theta)
    right -= precision @ (wider.theta - mean)
    if not free[0]:
        precision = wider.layout.of_any_gain(precision)
    whole = wider.layout.conditioned(matrix + precision)
    behind = np.arange(last, layout.size) + 4 * len(places)
    kept = np.concatenate([np.arange(last), behind])[free]
    factor = cho_factor(whole[np.ix_(kept, kept)])
    alone, static = cho_solve(factor, right[kept]), layout.static[free]
    for k, (omega, damping) in enumerate(places):
        weights = last + 4 * k + np.array([2, 3])
        shared = whole[np.ix_(kept, weights)]
        along = cho_solve(factor, shared)
        pull = right[weights] - shared.T @ alone
        pair = np.linalg.solve(whole[np.ix_(weights, weights)] - shared.T @ along, pull)
        gain = 1.0 if free[0] else float(1.0 + pair[0] + static @ (alone - along @ pair))
        mode = omega, damping, float(pair[0]) / gain, float(pair[1]) / gain
        yield FoundMode(mode, 0.5 * float(pull @ pair), gain)


def _spectra(fit: AxisFit) -> list[Spectrum]:
    """Spectra of what is left of each record, over what noise leaves in a bin."""
    found: list[Spectrum] = []
    for record, left in zip(fit.records, fit.residuals(fit.simulated(fit.theta)), strict=True):
        at = 2.0 * np.pi * np.fft.rfftfreq(len(left), record.length)
        window = np.hanning(len(left))
        noise = float(window @ window) * fit.variance(record)
        found.append((at, np.abs(np.fft.rfft(window * left)) ** 2 / noise))
    return found


def _left_about(
    spectra: Iterable[Spectrum], omega: float, width: float
) -> tuple[float, float, float]:
    """What is left (nat) within a band about an angular frequency (rad/s), and of how many lines.

    The band is of a ``width`` to either side, over its frequency. A line counts by its share of the
    power, as the sharp ones of a periodic drive do not tell more than they are. The last is the
    number of bins, which is what noise leaves.
    """
    misfit, lines, bins = 0.0, 0.0, 0.0
    for at, power in spectra:
        ends = omega * (1.0 - width), omega * (1.0 + width)
        part = power[slice(*np.searchsorted(at, ends))]
        misfit, bins = misfit + float(part.sum()), bins + len(part)
        lines += float(part.sum() ** 2 / (part**2).sum()) if part.any() else 0.0
    return misfit, lines, bins
