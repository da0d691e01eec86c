"""What the records tell of each effect: whether they do, and the intervals of its parameters.

The posterior of a linear combination r of θ has the variance r (H + Λ)⁻¹ rᵀ. An effect is
identified where its measure has, at the greatest scales, less than a share ``told`` of the standard
deviation expected beforehand. That measure is the opening of the loop over the whole range, the
mean lag where no mode is seen, and the sum of the gains of creep, of which a decade is expected.
Creep is identified too where its interval excludes none.
"""

import numpy as np
from attrs import evolve, frozen
from scipy.ndimage import uniform_filter1d

from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.model_of_fit import variants
from afm_scan_ros.core.fit.parameters import SEARCHED
from afm_scan_ros.core.fit.signals import Signals
from afm_scan_ros.core.fit.uncertainty import covariance, information, of_records
from afm_scan_ros.core.model import (
    CONFIDENT,
    BaseEffects,
    EffectStatus,
    ParameterInterval,
    Range,
    Status,
    closed,
)
from afm_scan_ros.core.spread import Variant
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Knowledge:
    """What is known of θ: covariances of the posterior, and both at the greatest scales.

    All are of shape (size, size); ``posterior`` is at the scales of the greatest evidence,
    ``wider`` at ``wider_scales`` times these. ``every`` are the normal equations' H of each record.
    """

    fit: AxisFit
    every: list[Array]
    posterior: Array
    wider: Array
    widest: Array
    beforehand: Array

    @classmethod
    def of(cls, fit: AxisFit) -> "Knowledge":
        """Invert the precisions of a fit's parameters."""
        greatest = {name: getattr(fit.layout.settings, name) for name in SEARCHED}
        factor = fit.layout.settings.wider_scales
        wider = {name: min(factor * own, greatest[name]) for name, own in fit.scales.items()}
        every = of_records(fit)
        told = information(fit, every)
        own, more, most = (
            fit.layout.prior(scales, fit.theta)[0] for scales in (fit.scales, wider, greatest)
        )
        nothing = np.zeros_like(told)
        each = (told, own), (told, more), (told, most), (nothing, most)
        return cls(fit, every, *(covariance(fit.layout, *one) for one in each))

    def tells(self, row: Array, expected: float | None = None) -> bool:
        """Whether the records narrow a combination of θ, (size,), to a share of what is expected.

        What is ``expected`` is a standard deviation, the prior's where none is given.
        """
        after, before = (float(row @ each @ row) for each in (self.widest, self.beforehand))
        before = before if expected is None else expected**2
        return after < self.fit.layout.settings.told**2 * before

    def interval(
        self, name: str, unit: str, value: float, row: Array, least: float = -np.inf
    ) -> ParameterInterval:
        """95 % interval of a combination of θ, (size,), that is ``least`` at least."""
        half = CONFIDENT * float(np.sqrt(row @ self.posterior @ row))
        return closed(name, (max(value - half, least), value + half), unit)

    def variants(self) -> tuple[Variant, tuple[Variant, ...]]:
        """Return the fit's own effects, and those in each direction of what is not known.

        Where the records do not tell how loops open, of the whole range or as small as those of the
        smallest scans, nor do they tell the scales of the hysteresis' prior.
        """
        smallest = 0.5 ** (self.fit.layout.settings.spread_sizes - 1)
        told = all(self.tells(_opening(self.fit, share)[1]) for share in (1.0, smallest))
        return variants(self.fit, self.wider if told else self.widest, self.every)

    def effects(self) -> BaseEffects:
        """How each effect is known, over which drive, frequencies and hold times."""
        return BaseEffects(_creep(self), _hysteresis(self), _vibration(self))


def _range(fit: AxisFit) -> Range:
    return fit.layout.operator.lower, fit.layout.operator.upper


def _row(fit: AxisFit, part: str, values: Array | float) -> Array:
    row = np.zeros(fit.layout.size)
    row[fit.layout.parts[part]] = values
    return row


def unknown(kind: str) -> EffectStatus:
    """Status of an unknown effect, with the kind of record that would identify it."""
    return EffectStatus(Status.UNKNOWN, identifiable_from=kind)


def _creep(known: Knowledge) -> EffectStatus:
    fit = known.fit
    row, settings = _row(fit, "creep", 1.0), fit.layout.settings
    interval = known.interval("gain", "1", float(row @ fit.theta), row, 0.0)
    told = known.tells(row, settings.creep * settings.creep_per_decade)
    if not told and interval.lower == 0.0:
        return unknown("creep")
    longest = max(len(one.drive) * one.period for one in fit.records)
    return EffectStatus(
        drive=_range(fit),
        hold_times=(float(fit.layout.time_constants[0]), longest),
        intervals=(interval,),
    )


def _hysteresis(known: Knowledge) -> EffectStatus:
    fit = known.fit
    opening, row = _opening(fit)
    if not known.tells(row):
        return unknown("hysteresis")
    return EffectStatus(
        drive=_range(fit),
        frequencies=(0.0, max(swings(one.drive) / one.period for one in fit.records)),
        intervals=(known.interval("opening", "V", opening, row),),
    )


def _opening(fit: AxisFit, share: float = 1.0) -> tuple[float, Array]:
    """F (V) in the middle of a loop on its way down less that up, and its row.

    The loop is over a share of the range about its middle.
    """
    operator, count = fit.layout.operator, fit.layout.settings.direct_levels
    middle, half = 0.5 * (operator.lower + operator.upper), share * operator.half
    up = np.linspace(middle - half, middle + half, 2 * count + 1)
    drive = np.concatenate([up, up[-2::-1]])
    theta, (used, _) = (
        fit.layout.of_operator(fit.theta),
        operator.in_use(drive[0], np.zeros(operator.unknowns)),
    )
    output = operator.output(theta, drive, used)
    edges = np.arange(len(drive) + 1)
    rows = np.concatenate([*map(np.asarray, operator.pieces(theta, drive, edges, used))])
    row = np.zeros(fit.layout.size)
    row[: rows.shape[1]] = rows[3 * count] - rows[count]
    return float(output[3 * count] - output[count]), row


def _vibration(known: Knowledge) -> EffectStatus:
    fit = known.fit
    status = EffectStatus(drive=_range(fit), frequencies=(0.0, _highest(fit)))
    if modes := fit.layout.of_modes(fit.theta):
        peaks = [np.hypot(real, imag) / damping for _, damping, real, imag in modes]
        return evolve(status, intervals=_of_mode(known, int(np.argmax(peaks))))
    row = _row(fit, "lags", fit.layout.lags)
    lag, shortest = float(row @ fit.theta), fit.shortest
    if not known.tells(row) or lag < shortest:  # as samples are timed no better
        return unknown("frequency")
    return evolve(status, intervals=(known.interval("lag", "s", lag, row, 0.0),))


def _highest(fit: AxisFit) -> float:
    """Highest frequency (Hz) at which the motion of a record exceeds the sensor's noise."""
    found, lines = [0.0], fit.layout.settings.seen_lines
    for record, motion in zip(fit.records, fit.motions(), strict=True):
        above = uniform_filter1d(_power(motion), lines) > _noise_power(record, len(motion))
        found.append(float(np.flatnonzero(above).max(initial=0)) / (len(motion) * record.length))
    return max(found)


def _power(signal: Array) -> Array:
    """Power of a signal (m), (n,), in each bin under Hann's window."""
    return np.abs(np.fft.rfft(np.hanning(len(signal)) * (signal - signal.mean()))) ** 2


def _noise_power(record: Signals, count: int) -> float:
    """Mean of that power of the sensor's noise in so many blocks of a record."""
    return record.noise**2 / record.block * float(np.sum(np.hanning(count) ** 2))


def _of_mode(known: Knowledge, which: int) -> tuple[ParameterInterval, ...]:
    """Intervals of frequency and damping, of which θ holds the logarithms.

    Beside the posterior they hold an error of the model about the mode as large as it leaves there.
    """
    first = known.fit.layout.parts["modes"].start + 4 * which
    omega, damping, *_ = known.fit.layout.of_modes(known.fit.theta)[which]
    missed = _missed_about(known.fit, omega, damping) * np.array([damping**2, 1.0])
    halves = CONFIDENT * np.sqrt(np.diag(known.posterior)[first : first + 2] + missed)
    values, units = (omega / (2.0 * np.pi), damping), ("Hz", "1")
    ends = [(v * np.exp(-half), v * np.exp(half)) for v, half in zip(values, halves, strict=True)]
    names = "resonance", "damping"
    return tuple(map(closed, names, ends, units))


def _missed_about(fit: AxisFit, omega: float, damping: float) -> float:
    """Variance of the logarithm of a mode's damping by what the model leaves about the mode.

    It is the squared ratio of the residual, without noise, to the motion within the bandwidth,
    divided by the number of lines of the motion there. Errors of such a size at these lines, were
    they independent, move the damping by that ratio, and the frequency by the same share of the
    bandwidth.
    """
    told, ends = 0.0, omega * np.array([1.0 - damping, 1.0 + damping]) / (2.0 * np.pi)
    for record, left, moved in zip(fit.records, fit.residuals(), fit.motions(), strict=True):
        band = slice(*np.searchsorted(np.fft.rfftfreq(len(moved), record.length), ends))
        residual, motion = (_power(each)[band] for each in (left, moved))
        beyond = float(residual.sum()) - len(residual) * _noise_power(record, len(moved))
        if beyond > 0.0 and motion.any():
            told += float(motion.sum() ** 3 / (motion**2).sum()) / beyond
    return 1.0 / told if told > 0.0 else 0.0


def swings(drive: Array) -> float:
    """Swings of a drive (n,) a sample, there and back."""
    moves = np.diff(drive)
    ways = np.sign(moves[moves != 0.0])
    return float(np.count_nonzero(np.diff(ways)) / 2.0 / max(len(drive) - 1, 1))
