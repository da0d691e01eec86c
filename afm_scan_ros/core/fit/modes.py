"""The mode that a fit lacks: the resonance that would lower its objective most.

What each would explain is told by Rao's score test (``score_test.py``), so neither plays nor lags
hide a resonance by an imitation of it.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from attrs import evolve
from numpy.typing import NDArray
from scipy.signal import welch

from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.parameters import layout_of
from afm_scan_ros.core.fit.score_test import FoundMode, Place, ScoreTest
from afm_scan_ros.core.fit.settings import FitSettings

EQUAL, HALF_OR_TWICE, NEAR = (1.0,), (0.5, 1.0, 2.0), (0.7, 0.85, 1.0, 1.2, 1.4)
"""Dampings over that of the best mode so far: of the first climb, of the second, and at the end."""
Spectrum = tuple[NDArray[np.floating], NDArray[np.floating], float]
"""Angular frequencies (rad/s) and power (nat), both (n,), and the power of the sensor's noise."""


def add_first_mode(fit: AxisFit) -> FoundMode | None:
    """Add the mode of the largest residuals, where they are about it rather than of the loops."""
    found = first_mode(fit)
    if found is not None:
        add(fit, found)
    return found


def add_mode(fit: AxisFit) -> bool:
    """Add the mode that explains most, where there is one and room for it.

    Once there is a mode, none is sought where hardly more than noise is left.
    """
    enough = fit.layout.modes > 0 and fit.sufficient
    if enough or fit.layout.modes == fit.layout.settings.most_modes:
        return False
    found = further_modes(fit)
    for each in found:
        add(fit, each)
    return len(found) > 0


def add(fit: AxisFit, found: FoundMode) -> None:
    """Add a mode; the first one places the lags."""
    if fit.layout.modes == 0:
        longest = max(len(one.drive) * one.period for one in fit.records)
        shortest = fit.shortest
        settings, omega = fit.layout.settings, found.mode[0]
        laid = layout_of(fit.layout.operator, longest, shortest, settings, omega)
        now = fit.layout
        fit.lay_out(evolve(now, lags=laid.lags, time_constants=laid.time_constants))
    fit.add(found.mode)


def first_mode(fit: AxisFit) -> FoundMode | None:
    """Return the mode that explains most of what a straight line leaves, None where it is little.

    Where it explains a good part of what is left of a record, that is about a resonance rather than
    of the loops of the hysteresis, if it does so too where these are fitted beside it. The static
    gain is free beside it, for a straight line through such a motion has another.
    """
    free = np.zeros(fit.layout.size, bool)
    for name in ("lags", "creep"):
        free[fit.layout.parts[name]] = True
    lefts = zip(fit.records, fit.residuals(), strict=True)
    most = max(0.5 * float(left @ left) / fit.variance(record) for record, left in lefts)
    settings = fit.layout.settings
    enough = settings.dominant_share * most
    every = _summits(fit, free, enough, settings.tried_modes, broad=True)
    some = (one for one in every if _excited(one, fit))
    return next((one for one in some if _beside_loops(one, fit, free) > enough), None)


def _beside_loops(found: FoundMode, fit: AxisFit, free: NDArray[np.bool_]) -> float:
    """What a mode explains (nat) where the operator is free too: slow loops look like a mode."""
    wider = free.copy()
    for name in fit.layout.operator.parts:
        wider[fit.layout.parts[name]] = True
    return max((one.chance for one in ScoreTest(fit, wider).of([found.mode[:2]])), default=0.0)


def further_modes(fit: AxisFit, most: int = 1) -> list[FoundMode]:
    """Return the modes that explain most beside all that is fitted, from the best peaks on.

    Each is to be of possible weight, and to explain a share of what is left about its frequency, of
    so many lines that chance does not: a resonance of any frequency explains a single one.
    Parameters at their lowest values stay there.
    """
    settings, spectra = fit.layout.settings, _spectra(fit)
    free = fit.theta > fit.layout.lowest()
    every = _summits(fit, free, settings.mode_chance, most)
    some = [one for one in every if _seen(one, spectra, settings) and _excited(one, fit)]
    return [one for one in some if _stands_out(one, fit)]


def _stands_out(found: FoundMode, fit: AxisFit) -> bool:
    """Whether a mode within the bandwidth of another is more than an error of that one's peak."""
    peaks = [
        float(np.hypot(real, imag)) / damping
        for omega, damping, real, imag in fit.layout.of_modes(fit.theta)
        if abs(found.mode[0] / omega - 1.0) < 2.0 * damping
    ]
    own = float(np.hypot(*found.mode[2:])) / found.mode[1]
    return own > fit.layout.settings.least_peak * max(peaks, default=0.0)


def _excited(found: FoundMode, fit: AxisFit) -> bool:
    """Whether some of what a mode explains is about its own frequency, above noise.

    A mode far above all that the drives excite only delays the slower response. The spectra are
    means over segments of each record, since a sweep passes the mode in one of them.
    """
    settings, left = fit.layout.settings, 0.0
    ends = found.mode[0] * np.array([1.0 - settings.mode_band, 1.0 + settings.mode_band])
    for record, residual in zip(fit.records, fit.residuals(), strict=True):
        segment = -(-len(residual) // settings.residual_segments)
        at, density = welch(residual, 1.0 / record.length, nperseg=segment)
        first, last = np.searchsorted(2.0 * np.pi * at, ends)
        band = density[max(first - 1, 0) : last + 1] * 0.5 / record.length
        above = float(np.sum(band - record.noise**2 / record.block)) / fit.variance(record)
        left += max(above, 0.0) * settings.residual_segments
    return left > settings.excited_share * found.chance


def _seen(found: FoundMode, spectra: Sequence[Spectrum], settings: FitSettings) -> bool:
    if np.hypot(*found.mode[2:]) > settings.heaviest_mode:
        return False
    misfit, lines, *_ = _left_about(spectra, found.mode[0], settings.mode_band)
    share = min(found.chance / misfit, 1.0 - settings.tone_chance)
    certain = -lines * np.log1p(-share) > settings.mode_chance
    return bool(certain and share > settings.mode_share)


def _summits(
    fit: AxisFit, free: NDArray[np.bool_], enough: float, most: int, *, broad: bool = False
) -> Iterator[FoundMode]:
    """Try peaks of what is left, and climb from the best ones to their summits.

    What is explained best by the greatest damping is a bend of the response and no mode. A
    ``broad`` mode may have this damping while it is sought, if a lesser one is best in the end.
    """
    settings = fit.layout.settings
    width = 2.0 * settings.tried_damping
    peaks = [(omega, settings.tried_damping) for omega in _peaks(fit, width, enough)]
    if not peaks:
        return
    test, found = ScoreTest(fit, free), 0
    starts = sorted(test.of(peaks), key=_chance, reverse=True)
    for start in starts[: settings.tried_modes]:
        summit = start
        if found == most or summit.chance < settings.near_chance * enough:
            return
        for dampings in (EQUAL, HALF_OR_TWICE):
            summit = _climbed(test, summit, dampings)
        sought = summit.mode[1]
        summit = max(summit, *test.of(_about(summit, 0.5, NEAR)), key=_chance)
        damping = min(sought, summit.mode[1]) if broad else sought
        if summit.chance >= enough and damping < settings.greatest_damping:
            found += 1
            yield summit


def _climbed(test: ScoreTest, found: FoundMode, dampings: Sequence[float]) -> FoundMode:
    """Go from a mode to the best one near it, of ``dampings`` over its own, and on from there."""
    settings = test.fit.layout.settings
    for _ in range(settings.most_trials):
        before = found
        found = max(found, *test.of(_about(found, 2.0, dampings)), key=_chance)
        if found is before or found.mode[1] >= settings.greatest_damping:
            break
    return found


def _about(found: FoundMode, width: float, dampings: Sequence[float]) -> list[Place]:
    """Places about a mode: within a ``width`` in half bandwidths, of ``dampings`` over its own."""
    omega, damping, *_ = found.mode
    near = omega * np.exp(width * damping * np.linspace(-1.0, 1.0, 5))
    return [(float(at), damping * share) for at in near for share in dampings]


def _peaks(fit: AxisFit, width: float, enough: float) -> list[float]:
    """Angular frequencies (rad/s) about which more is left than beside them, the most first.

    Each is that of a band of a ``width``, in which the power of what is left exceeds that of the
    sensor's noise by a part of ``enough`` (nat) at least. The discrepancy η is not subtracted: a
    mode is to explain it, and it is not white.
    """
    settings, (lowest, highest) = fit.layout.settings, _band(fit)
    count = int(np.log(highest / lowest) / width) if highest > lowest else 0
    grid = np.geomspace(lowest, highest, 2 * count + 1)
    spectra = _spectra(fit)
    left = np.array([_left_about(spectra, omega, 0.5 * width) for omega in grid])
    misfit, _, bins, noise = np.pad(left, ((1, 1), (0, 0))).T
    density = misfit / np.maximum(bins, 1.0)
    peaks = np.flatnonzero((density[1:-1] >= density[:-2]) & (density[1:-1] >= density[2:]))
    excess = (misfit - noise)[1:-1]
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


def _spectra(fit: AxisFit) -> list[Spectrum]:
    """Spectra of what is left of each record, over what its variance v_k leaves in a bin."""
    found: list[Spectrum] = []
    for record, left in zip(fit.records, fit.residuals(), strict=True):
        at = 2.0 * np.pi * np.fft.rfftfreq(len(left), record.length)
        window = np.hanning(len(left))
        variance = fit.variance(record)
        power = np.abs(np.fft.rfft(window * left)) ** 2 / (float(window @ window) * variance)
        found.append((at, power, record.noise**2 / record.block / variance))
    return found


def _left_about(
    spectra: Iterable[Spectrum], omega: float, width: float
) -> tuple[float, float, float, float]:
    """What is left (nat) within a band about an angular frequency (rad/s), and of how many lines.

    The band is of a ``width`` to either side, over its frequency. A line counts by its share of the
    power, as the sharp ones of a periodic drive do not tell more than they are. Then follow the
    number of bins, and what noise leaves of them (nat).
    """
    misfit, lines, bins, noise = 0.0, 0.0, 0.0, 0.0
    for at, power, each in spectra:
        ends = omega * (1.0 - width), omega * (1.0 + width)
        part = power[slice(*np.searchsorted(at, ends))]
        misfit, bins, noise = misfit + float(part.sum()), bins + len(part), noise + each * len(part)
        lines += float(part.sum() ** 2 / (part**2).sum()) if part.any() else 0.0
    return misfit, lines, bins, noise
