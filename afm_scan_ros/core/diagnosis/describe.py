"""What a model leaves of a record, described before anybody explains it."""

from collections.abc import Iterator
from operator import itemgetter

import numpy as np
from attrs import frozen
from numpy.polynomial.legendre import legfit, legval

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.clues import prominent_lines
from afm_scan_ros.core.diagnosis.description.correlation import (
    Coherence,
    Correlation,
    autocorrelation,
    coherence,
    cross_correlation,
)
from afm_scan_ros.core.diagnosis.description.scan import (
    Dependence,
    Locked,
    ToAndFro,
    dependences,
    locked,
    to_and_fro,
)
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.records import AxisSignals, Observation
from afm_scan_ros.core.types import AXES, Array

SEED = 7
SLOW_LIMIT = 3
"""Degree of the polynomial that is a residual's slow course."""
NEIGHBOURS = 3
"""Spacings of the spectrum to either side that belong to a line: what comes and goes is broad."""


@frozen(eq=False)
class Description:
    """The residual of one axis in one record; lengths in m.

    ``bands`` (n,) is its rms between the floor's edges. ``initial_state`` is the initial memory in
    words.
    ``correlations`` and ``coherences`` are with the signals they are named after; ``lines`` are
    frequency (Hz) and rms over the record of what stands out. ``repeats`` and ``sides`` are of
    scans alone.
    """

    record: str
    residual: Array
    moved: Array
    sample_period: float
    bands: Array
    initial_state: str
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


def describe(evidence: Evidence, chain: Chain, observed: Observation) -> Description:
    """Describe what a chain leaves of a record, of which ``evidence`` is one axis."""
    playback, floor = evidence.playback, evidence.floor
    view, period = playback.view, playback.view.sample_period
    residual, moved = evidence.residual(chain), playback.displacement(chain)
    moving = {name: each for name, each in _signals(view, observed) if np.ptp(each) > 0.0}
    surface = chain.model.hysteresis.forward
    return Description(
        record=view.name,
        residual=residual,
        moved=moved,
        sample_period=period,
        bands=rms_by_band(residual, floor.edges, period),
        initial_state=playback.initial_state.words((surface.lower, surface.upper)),
        own=autocorrelation(residual, period, SEED),
        correlations={n: cross_correlation(residual, s, period, SEED) for n, s in moving.items()},
        coherences={n: coherence(residual, s, period, floor.edges) for n, s in moving.items()},
        dependences=dependences(residual, moved, period),
        lines=_lines(residual, period),
        repeats=locked(residual, observed.spec) if observed.spec else None,
        sides=to_and_fro(residual, observed.spec) if observed.spec else None,
    )


def _signals(view: AxisSignals, observed: Observation) -> Iterator[tuple[str, Array]]:
    """Yield what may have made a residual: each drive, and the other axis' displacement."""
    for axis in AXES:
        yield f"drive {axis}", observed.drive.axis(axis)[: len(view.drive)]
    yield "displacement of the other axis", view.other


def _lines(residual: Array, sample_period: float) -> tuple[tuple[float, float], ...]:
    """Frequencies (Hz) of the lines that stand out and their rms (m), the largest first.

    Their rms is over the whole record; what lies between two lines belongs to the nearer.
    No window weighs them: one would make a line that comes and goes larger than all of the residual
    wherever it happens to come. In its stead the slow course is taken off, lest its ends leak.
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
