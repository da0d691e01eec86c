"""The mode that a fit lacks: a resonance in its residuals where a smooth response leaves one.

About each frequency the spectrum E of the residuals is fitted twice by the spectrum F of what
drives V: by a smooth response, and by one with a mode of pole p,

    E(ω) = (b_0 + jω b_1 + κ_r H_r(ω) + κ_i H_i(ω)) F(ω),    H_r + j H_i = (1 - z) / (exp(jωT) - z),

with z = exp(pT). What both leave over a narrow band does not depend on how large the residuals are
elsewhere, where the hysteresis may not have been fitted yet.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.optimize import minimize

from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.parameters import Mode
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.fit.signals import averaged
from afm_scan_ros.core.types import Array


@frozen
class FoundMode:
    """A mode, what it explains, and the static gain with it over that before.

    ``chance`` (nat) is its gain in likelihood, ``share`` that of the residuals about it which it
    explains beside a smooth response, ``misfit`` (nat) how much those residuals are of all.
    """

    mode: Mode
    chance: float
    share: float
    misfit: float
    gain: float


Weight: TypeAlias = Callable[[FoundMode], float]
"""What a search maximises."""


def clear(found: FoundMode) -> float:
    """Weigh a mode by how clearly it is seen: it explains much, and most of what there is."""
    return found.chance * found.share


def large(found: FoundMode) -> float:
    """Weigh a mode by how much of all residuals it explains."""
    return found.misfit * found.share


class _Spectrum(NamedTuple):
    """Spectra of a record over the angular frequency (rad/s), all (n,).

    ``period`` (s) is its sample period, ``variance`` (m²) that of a line which the fit expects.
    """

    omega: NDArray[np.float64]
    driven: NDArray[np.complex128]
    left: NDArray[np.complex128]
    period: float
    variance: float


def best_mode(fit: AxisFit, weight: Weight) -> FoundMode | None:
    """Return the mode of the greatest weight in the residuals, None where they show none.

    The search goes over all frequencies that the records resolve, in steps of a half-power
    bandwidth, and on from each peak. What is slower than the lags of the modes is creep.
    """
    settings, spectra = fit.layout.settings, list(_spectra(fit))
    lowest = min(settings.tone_cycles * one.omega[1] for one in spectra)
    if fit.layout.modes:
        first = min(omega for omega, *_ in fit.layout.of_modes(fit.theta))
        lowest = max(lowest, first / settings.slowest_lag)
    highest = max(one.omega[-1] for one in spectra)
    pitch = 2.0 * settings.damping
    grid = np.exp(np.arange(np.log(lowest), np.log(highest), pitch))
    found = [_about(spectra, omega, settings.damping, settings) for omega in grid]
    near = max(int(settings.mode_band / pitch), 1)
    peaks = (
        one
        for k, one in enumerate(found)
        if one is not None and one is _first(found[max(k - near, 0) : k + near + 1], weight)
    )
    refined = (_refined(spectra, one, settings, weight) for one in peaks)
    return _first([one for one in refined if _is_mode(one, settings)], weight)


def _first(found: Iterable[FoundMode | None], weight: Weight) -> FoundMode | None:
    return max((one for one in found if one is not None), key=weight, default=None)


def _is_mode(found: FoundMode, settings: FitSettings) -> bool:
    """Whether a mode is as sharp as those of stages, of possible weight, and seen beyond chance.

    What it explains is to count among its neighbours as well as in the whole fit.
    """
    _, damping, real, imag = found.mode
    possible = damping < settings.greatest_damping and np.hypot(real, imag) < settings.heaviest_mode
    seen = min(found.chance, 0.5 * found.misfit * found.share) > settings.mode_chance
    return bool(possible and seen)


def _spectra(fit: AxisFit) -> Iterator[_Spectrum]:
    """Spectra of what drives V and of the residuals, over frequencies that blocks resolve."""
    simulations = fit.simulated(fit.theta)
    pairs = zip(simulations, fit.residuals(simulations), strict=True)
    for record, (simulation, left) in zip(fit.records, pairs, strict=True):
        driven = fit.gain * averaged(simulation.effective, record.block)[record.used]
        window, omega = np.hanning(len(left)), np.fft.rfftfreq(len(left), record.length)
        count = int(0.8 * len(omega))
        variance = fit.variance(record) * float(window @ window)
        driving, residual = (np.fft.rfft(window * (one - one.mean())) for one in (driven, left))
        at = 2.0 * np.pi * omega[:count].astype(np.float64)
        yield _Spectrum(at, driving[:count], residual[:count], record.period, variance)


def _about(
    spectra: Sequence[_Spectrum], omega: float, damping: float, settings: FitSettings
) -> FoundMode | None:
    """Fit a mode within a band about it, None where no record has lines enough there.

    Each record counts as many lines as hold most of its power there, as sharp lines of a periodic
    drive tell no more than they are.
    """
    if not 0.0 < damping < 1.0:
        return None
    bands = [one for each in spectra if (one := _band(each, omega, damping, settings)) is not None]
    if not bands:
        return None
    matrix, right = (
        np.sum([getattr(one, name) for one in bands], axis=0) for name in ("matrix", "right")
    )
    matrix += np.finfo(float).eps * np.trace(matrix) * np.eye(4)
    weights = np.linalg.solve(matrix, right)
    smooth = np.append(np.linalg.solve(matrix[:2, :2], right[:2]), [0.0, 0.0])
    least = np.finfo(float).eps
    before, after = (
        np.array([max(one.left_by(each), least * one.lines) for one in bands])
        for each in (smooth, weights)
    )
    lines, misfits = np.array([(one.lines, one.misfit) for one in bands]).T
    share = 1.0 - float(misfits @ (after / lines)) / float(misfits @ (before / lines))
    chance = float(lines @ np.log(before / after))
    shift, _, real, imag = weights
    gain = float(1.0 + shift + real)
    mode = omega, damping, float(real) / gain, float(imag) / gain
    return FoundMode(mode, chance, share, float(misfits.sum()), gain)


class _Band(NamedTuple):
    """Normal equations of a record about a frequency, over the mean power of its ``lines`` there.

    ``misfit`` (nat) is how much its residuals there are of all.
    """

    matrix: NDArray[np.float64]
    right: NDArray[np.float64]
    lines: float
    misfit: float

    def left_by(self, weights: Array) -> float:
        """Power that weights (4,) leave, in lines."""
        return float(self.lines - 2.0 * weights @ self.right + weights @ self.matrix @ weights)


def _band(one: _Spectrum, omega: float, damping: float, settings: FitSettings) -> _Band | None:
    """Weigh a smooth response and a mode within a band; None where a record has too few lines."""
    edges = omega * (1.0 + settings.mode_band * np.array([-1.0, 1.0]))
    band = slice(*np.searchsorted(one.omega, edges))
    left, driven, at = one.left[band], one.driven[band], one.omega[band]
    power = np.abs(left) ** 2
    if len(at) < 4 or at[-1] < omega or not power.any() or not driven.any():  # noqa: PLR2004 - as many weights
        return None
    pole = omega * (-damping + 1j * np.sqrt(1.0 - damping**2))
    z, turned = np.exp(pole * one.period), np.exp(1j * at * one.period)
    rising, falling = (1.0 - z) / (turned - z), (1.0 - z.conj()) / (turned - z.conj())
    shapes = (np.ones(len(at)), 1j * at / omega, rising + falling, 1j * (rising - falling))
    columns = np.array([1.0, 1.0, 0.5, 0.5])[:, np.newaxis] * np.array(shapes) * driven
    lines, total = power.sum() ** 2 / (power**2).sum(), power.sum()
    matrix, right = (columns.conj() @ columns.T).real, (columns.conj() @ left).real
    return _Band(lines / total * matrix, lines / total * right, lines, total / one.variance)


def _refined(
    spectra: Sequence[_Spectrum], found: FoundMode, settings: FitSettings, weight: Weight
) -> FoundMode:
    """Search about a mode for the frequency and the damping that explain most."""
    omega, damping, *_ = found.mode
    tried = [found]

    def lost(move: Array) -> float:
        sharper = damping * float(np.exp(-move[1]))
        one = _about(spectra, omega * (1.0 + damping * float(move[0])), sharper, settings)
        tried.extend([] if one is None else [one])
        return np.inf if one is None else -weight(one)

    corners = np.array([[0.0, 0.0], [0.5, 0.0], [0.0, np.log(2.0)]])
    options = {"maxfev": settings.mode_trials, "initial_simplex": corners}
    minimize(lost, corners[0], method="Nelder-Mead", options=options)
    return max(tried, key=weight)
