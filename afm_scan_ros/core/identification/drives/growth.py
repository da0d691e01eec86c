"""How far a drive may grow, from what the scanner did at smaller amplitudes.

A short drive of the record's kind begins at a small share of the planned amplitude. It is doubled
while the displacement and the excitation of the resonance, extrapolated, stay within their limits.
Then the record itself is driven.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from operator import itemgetter

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import gt
from scipy import fft

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.drives.excitation import Plan, scaled
from afm_scan_ros.core.identification.drives.proposal import (
    MARGIN,
    Coverage,
    ProposedRecord,
    response_peak,
)
from afm_scan_ros.core.types import AXES, Array, Trace

FIRST = 1.0 / 16.0
"""Share of the planned amplitude that a drive begins with."""
FACTOR = 2.0
"""Times the last amplitude that is extrapolated to, at most."""
FOLLOWS = 0.25
"""Growth of the displacement over that of the drive, below which the sensor does not see it."""


@frozen
class MotionLimits:
    """Largest ``travel``, displacement from peak to peak, and ``excitation`` of the resonance, m.

    The excitation is the peak of the fast displacement beyond its steady amplitude. A record that
    has ``nearly`` the travel, as a share of it, is as large as the limit lets it be: what is
    extrapolated from trials stays below.
    """

    travel: float = field(validator=gt(0.0))
    excitation: float = field(validator=gt(0.0))
    nearly: float = 0.8

    @property
    def bounds(self) -> Sequence[tuple[str, float]]:
        """Each quantity of a response that is limited, and its limit, m."""
        return ("travel", self.travel), ("excitation", self.excitation)

    @classmethod
    def of_range(
        cls, scan_range: float, travel: float | None = None, excitation: float | None = None
    ) -> "MotionLimits":
        """Return the limits for scans over a range (m), where they are not given.

        A drive may travel as far as proposed ones do. At the resonance the force of inertia for an
        amplitude is the spring's for a steady displacement as large: scans need half the range.
        """
        return cls(travel or MARGIN * scan_range, excitation or 0.5 * scan_range)


@frozen
class MeasuredResponse:
    """What an axis did: its ``travel`` from peak to peak (m), and its slow ``gain`` (m/V).

    ``peak`` (m) is that of the fast displacement, ``steady`` (m) what the fast drive gives by the
    slow gain. ``follows`` is the correlation of the slow displacement with the slow drive,
    1 where that is small.
    """

    travel: float
    gain: float
    peak: float
    steady: float
    follows: float = 1.0

    @property
    def excitation(self) -> float:
        """Peak of the fast displacement beyond its steady amplitude, m."""
        return max(0.0, self.peak - self.steady)


@frozen
class Reached:
    """A limit that ends the growth: an axis's quantity, its value (m) expected at a share."""

    axis: str
    quantity: str
    expected: float
    limit: float
    share: float


@frozen
class GrowthStep:
    """What to drive: a ``share`` of the planned amplitude, as the ``whole`` record or its trial."""

    share: float
    whole: bool = False
    reached: Reached | None = None


@frozen
class Watched:
    """A step that was driven, and the response of each axis."""

    step: GrowthStep
    responses: Mapping[str, MeasuredResponse]


Drive = Callable[[Plan, GrowthStep], tuple[Trace, Trace]]
"""Drives a plan, and returns drive (V) and measured displacement (m)."""


def grow(
    record: ProposedRecord, drive: Drive, limits: MotionLimits, have: Coverage
) -> Iterator[Watched]:
    """Drive the trial of a record by growing shares, and then the record; yield each step.

    ``have`` is what is known already. Without a resonance each step's own record shows it. A record
    that lasts longer than its trial creeps further: the trial's travel leaves room for that. Raises
    ScanError where a displacement does not grow with the drive or follow it, and where no axis has
    the gain of what is known already.
    """
    if record.seconds > record.trial.duration:
        limits = evolve(limits, travel=limits.travel / have.creep)
    done: list[Watched] = []
    while not (done and done[-1].step.whole):
        step = next_step(done, limits)
        if len(done) > 1:
            _refuse_another(done[-1], have.gain)
        plan = scaled(record.plan if step.whole else record.trial, step.share)
        given, moved = drive(plan, step)
        pairs = {axis: (given.axis(axis), moved.axis(axis)) for axis in AXES}
        seen = {
            axis: response(*both, given.sample_period, have.resonance)
            for axis, both in pairs.items()
        }
        done.append(Watched(step, seen))
        yield done[-1]
    _refuse_exchanged(done[-1])


def beyond(watched: Watched, limits: MotionLimits) -> Iterator[Reached]:
    """Yield each limit that a step exceeded, with what was reached in place of what is expected."""
    for (axis, seen), (quantity, limit) in product(watched.responses.items(), limits.bounds):
        if (value := getattr(seen, quantity)) > limit:
            yield Reached(axis, quantity, value, limit, watched.step.share)


def _refuse_exchanged(watched: Watched) -> None:
    for axis, seen in watched.responses.items():
        if abs(seen.follows) < FOLLOWS:
            raise ScanError(
                f"axis {axis} moved {1e6 * seen.travel:.3g} µm, but not with its own drive"
                f" (correlation {seen.follows:.2g}): see that drives and sensors of x and y are not"
                " exchanged"
            )


def _refuse_another(watched: Watched, known: float | None) -> None:
    """Refuse a scanner that is not that of the records at hand, by its gain (m/V).

    What is known is the gain of one axis, of which another may differ.
    """
    gains = {axis: seen.gain for axis, seen in watched.responses.items()}
    if known and not any(FACTOR**-2 < abs(one / known) < FACTOR**2 for one in gains.values()):
        moves = " and ".join(f"{axis} {1e6 * one:.3g}" for axis, one in gains.items())
        raise ScanError(
            f"the scanner moves {moves} µm/V, but the records or the model at hand"
            f" {1e6 * known:.3g}: give this scanner's"
        )


def next_step(done: Sequence[Watched], limits: MotionLimits) -> GrowthStep:
    """Return what to drive after these steps, all trials of one record.

    Raises ScanError where the displacement of an axis did not grow with the drive.
    """
    if not done:
        return GrowthStep(FIRST)
    for axis in AXES:
        _refuse_unmoved(axis, done)
    wanted = min(1.0, FACTOR * done[-1].step.share)
    exceeded = []
    for axis, (quantity, limit) in product(AXES, limits.bounds):
        trend = Trend.of(done, axis, quantity)
        if (expected := trend.at(wanted)) > limit:
            reached = Reached(axis, quantity, expected, limit, wanted)
            exceeded.append((trend.share_at(limit), reached))
    if not exceeded:
        return GrowthStep(wanted, whole=wanted == 1.0)
    share, reached = min(exceeded, key=itemgetter(0))
    return GrowthStep(share, whole=True, reached=reached)


def _refuse_unmoved(axis: str, done: Sequence[Watched]) -> None:
    first, last = (each.responses[axis].travel for each in (done[0], done[-1]))
    growth = done[-1].step.share / done[0].step.share
    if growth > 1.0 and last <= FOLLOWS * growth * first:
        raise ScanError(
            f"axis {axis}: the drive grew {growth:g} times, and the displacement from"
            f" {1e6 * first:.3g} to {1e6 * last:.3g} µm: connect drive and sensor of this axis, or"
            " plan for a larger range"
        )


@frozen
class Trend:
    """A quantity (m) against the share: ``gain``, its ratio at the last ``share``, and its rise.

    As in Rayleigh's law of hysteresis the ratio rises in proportion to the amplitude. Two steps
    show how fast; after one, it may rise from zero. No ratio is expected to fall.
    """

    share: float
    gain: float
    rise: float

    @classmethod
    def of(cls, done: Sequence[Watched], axis: str, quantity: str) -> "Trend":
        """Return the trend of an axis's quantity over the last two steps."""
        known = [(each.step.share, getattr(each.responses[axis], quantity)) for each in done[-2:]]
        gains = [(share, value / share) for share, value in known]
        before, before_gain = gains[0] if len(gains) > 1 else (0.0, 0.0)
        share, gain = gains[-1]
        return cls(share, gain, max(0.0, (gain - before_gain) / (share - before)))

    def at(self, share: float) -> float:
        """Return what is expected at a share (m)."""
        return share * (self.gain + self.rise * max(0.0, share - self.share))

    def share_at(self, limit: float) -> float:
        """Return the share at which a limit (m) is expected to be reached."""
        if limit < self.gain * self.share:
            return limit / self.gain
        base = self.gain - self.rise * self.share
        return 2.0 * limit / (base + math.sqrt(base**2 + 4.0 * self.rise * limit))


def response(
    drive: Array, displacement: Array, sample_period: float, resonance: float | None
) -> MeasuredResponse:
    """What one axis of a record did; drive (V) and displacement (m) both (n,), from rest to rest.

    Fast is what lies above half the ``resonance`` (Hz), by default that of the record. A record
    that is sampled too slowly shows no excitation.
    """
    if resonance is None:
        resonance = response_peak(drive, displacement, sample_period)
    slow_drive, fast_drive = _split(drive, sample_period, 0.5 * resonance)
    slow, fast = _split(displacement, sample_period, 0.5 * resonance)
    gain = float(slow_drive @ slow / (slow_drive @ slow_drive)) if np.any(slow_drive) else 0.0
    steady = abs(gain) * float(np.abs(fast_drive).max())
    driven, size = np.linalg.norm(slow_drive), np.linalg.norm(slow_drive) * np.linalg.norm(slow)
    slowly = driven > FOLLOWS * np.linalg.norm(fast_drive) and size > 0.0
    follows = float(slow_drive @ slow / size) if slowly else 1.0
    peak = float(np.abs(fast).max())
    return MeasuredResponse(float(np.ptp(displacement)), gain, peak, steady, follows)


def _split(values: Array, sample_period: float, frequency: float) -> tuple[Array, Array]:
    """Parts of a signal (n,) below and above a frequency (Hz), without its mean."""
    spectrum = fft.rfft(values - values.mean())
    spectrum[fft.rfftfreq(values.size, sample_period) >= frequency] = 0.0
    slow = fft.irfft(spectrum, values.size)
    return slow, values - values.mean() - slow
