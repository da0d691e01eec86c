"""Describes residuals before and after the diagnosis: bands, correlations, dependences, lines."""

from collections.abc import Iterator
from operator import itemgetter

import numpy as np
from attrs import frozen
from numpy.polynomial.legendre import legfit, legval

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.description import (
    Coherence,
    Correlation,
    Dependence,
    Locked,
    ToAndFro,
    coherence,
    correlation,
    dependences,
    locked,
    to_and_fro,
)
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.records import AxisSignals, InitialState
from afm_scan_ros.core.effects.residual_features import prominent_lines
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, Array

SEED = 7
SLOW_LIMIT = 3
"""Degree of the polynomial that describes a residual's slow trend."""
NEIGHBOURS = 3
"""Spectral samples to either side that belong to a line; an intermittent line is broad."""


@frozen(eq=False)
class Description:
    """The residual of one axis in one record; lengths in m.

    ``bands`` (n,) is its rms in the bands of the detection limit. ``initial_state`` is the drive
    history before the record, ``drive_limits`` (V) the range in which the hysteresis was
    identified. ``correlations`` and ``coherences`` are with the signals they are named after.
    ``lines`` are frequency (Hz) and rms of spectral lines. Only scans have ``repeats`` and
    ``sides``.
    """

    record: str
    residual: Array
    moved: Array
    sample_period: float
    bands: Array
    initial_state: InitialState
    drive_limits: tuple[float, float]
    own: Correlation
    correlations: dict[str, Correlation]
    coherences: dict[str, Coherence]
    dependences: dict[str, Dependence]
    lines: tuple[tuple[float, float], ...]
    repeats: Locked | None
    sides: ToAndFro | None

    @property
    def rms(self) -> float:
        """Rms of the residual, m."""
        return float(np.sqrt(np.mean(self.residual**2)))


def describe(evidence: Evidence, chain: Chain, observed: Record) -> Description:
    """Describe the residual of a chain on the axis and record of ``evidence``."""
    playback, limit = evidence.playback, evidence.limit
    view, period = playback.view, playback.view.sample_period
    residual, moved = evidence.residual(chain), playback.displacement(chain)
    moving = {name: each for name, each in _signals(view, observed) if np.ptp(each) > 0.0}
    surface = chain.model.hysteresis.forward
    return Description(
        record=view.name,
        residual=residual,
        moved=moved,
        sample_period=period,
        bands=rms_by_band(residual, limit.edges, period),
        initial_state=playback.initial_state,
        drive_limits=surface.drive_range,
        own=correlation(residual, None, period, SEED),
        correlations={n: correlation(residual, s, period, SEED) for n, s in moving.items()},
        coherences={n: coherence(residual, s, period, limit.edges) for n, s in moving.items()},
        dependences=dependences(residual, moved, period),
        lines=_lines(residual, period),
        repeats=locked(residual, observed.scan) if observed.scan else None,
        sides=to_and_fro(residual, observed.scan) if observed.scan else None,
    )


def _signals(view: AxisSignals, observed: Record) -> Iterator[tuple[str, Array]]:
    """Yield the signals that may cause a residual: each drive, and the other axis' motion."""
    for axis in AXES:
        yield f"drive {axis}", observed.signals(axis)[0][: len(view.drive)]
    yield "displacement of the other axis", view.other


def _lines(residual: Array, sample_period: float) -> tuple[tuple[float, float], ...]:
    """Frequencies (Hz) of the spectral lines and their rms (m), the largest first.

    The rms is over the whole record; spectral samples between two lines belong to the nearer one.
    No window is applied, because it would weight intermittent lines by their position. The slow
    trend is removed instead, to prevent leakage.
    """
    count = len(residual)
    time = np.linspace(-1.0, 1.0, count)
    quick = residual - legval(time, legfit(time, residual, SLOW_LIMIT))
    squares = 2.0 * np.abs(np.fft.rfft(quick) / count) ** 2
    found = prominent_lines(residual, sample_period)
    if not found:
        return ()
    away = np.abs(
        np.subtract.outer(np.array(found) * count * sample_period, np.arange(len(squares)))
    )
    near, own = away.min(axis=0) < NEIGHBOURS + 0.5, away.argmin(axis=0)
    rms = np.sqrt([squares[near & (own == number)].sum() for number in range(len(found))])
    return tuple(sorted(zip(found, rms.tolist(), strict=True), key=itemgetter(1), reverse=True))


@frozen(eq=False)
class ResidualReport:
    """A diagnosis with its residuals described, one description a record on each axis.

    ``before`` is of the model, ``after`` of the extended one.
    """

    diagnosis: ScannerDiagnosis
    before: dict[str, tuple[Description, ...]]
    after: dict[str, tuple[Description, ...]]


def report_residual(diagnosis: ScannerDiagnosis) -> ResidualReport:
    """Describe the residuals of the diagnosed records before and after the diagnosis."""
    by_axis = diagnosis.by_axis
    before = {
        axis: _described(diagnosed, diagnosed.chain, diagnosis)
        for axis, diagnosed in by_axis.items()
    }
    after = {
        axis: before[axis]
        if diagnosed.final is diagnosed.chain
        else _described(diagnosed, diagnosed.final, diagnosis)
        for axis, diagnosed in by_axis.items()
    }
    return ResidualReport(diagnosis, before, after)


def most_excited_record(diagnosed: AxisDiagnosis) -> int:
    """Number of the record whose residual exceeds its detection limit most."""
    peaks = [float(ratio.max()) for ratio in diagnosed.ratio_before]
    return peaks.index(max(peaks))


def _described(
    diagnosed: AxisDiagnosis, chain: Chain, diagnosis: ScannerDiagnosis
) -> tuple[Description, ...]:
    records = zip(diagnosed.evidence, diagnosis.observations, strict=True)
    return tuple(describe(evidence, chain, observed) for evidence, observed in records)
