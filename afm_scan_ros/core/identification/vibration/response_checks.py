"""What a frequency record does not determine about a resonance."""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.identification.findings import (
    AmplitudeDependentResponse,
    CoarseLines,
    DistortedSweep,
    Finding,
    LowCoherence,
    NarrowBand,
)
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse

DISTORTION = 0.005
"""Third harmonic over fundamental from which on a sweep shows that its gain is another."""
RAYLEIGH = 4.0 / (15.0 * np.pi)
"""That ratio for each unit that the gain rises above the one at rest (Lord Rayleigh, 1887)."""
NONLINEARITY = 0.01
COHERENCE = 0.95
ABOVE = 1.2
"""The band should reach this many times the resonance."""


def response_findings(
    used: FrequencyResponse, resonance: float, damping: float
) -> tuple[Finding, ...]:
    """Check the lines used, and the resonance (Hz) and damping ratio fitted to them."""
    found = _nonlinear(used), _distorted(used), _incoherent(used), _narrow(used, resonance)
    coarse = _coarse(used, resonance, damping)
    return tuple(finding for findings in (*found, coarse) for finding in findings)


def _nonlinear(used: FrequencyResponse) -> Iterator[Finding]:
    if used.nonlinearity_share > NONLINEARITY:
        yield AmplitudeDependentResponse(used.nonlinearity_share, used.noise_share)


def _distorted(used: FrequencyResponse) -> Iterator[Finding]:
    if used.distortion > DISTORTION:
        yield DistortedSweep(used.distortion, used.distortion / RAYLEIGH)


def _incoherent(used: FrequencyResponse) -> Iterator[Finding]:
    """Find the frequency from which at least half the lines up to the band's end are low."""
    low = used.coherence < COHERENCE
    share = np.cumsum(low[::-1])[::-1] / np.arange(len(low), 0, -1)
    first = np.flatnonzero(low & (share >= 0.5))  # noqa: PLR2004 - half
    if first.size:
        yield LowCoherence(float(used.frequency[first[0]]), COHERENCE)


def _narrow(used: FrequencyResponse, resonance: float) -> Iterator[Finding]:
    low, high = float(used.frequency[0]), float(used.frequency[-1])
    if not ABOVE * low <= resonance <= high / ABOVE:
        yield NarrowBand((low, high), resonance, (resonance / 2.0, ABOVE * resonance))


def _coarse(used: FrequencyResponse, resonance: float, damping: float) -> Iterator[Finding]:
    width = 2.0 * damping * resonance
    above = int(np.clip(np.searchsorted(used.frequency, resonance), 1, len(used.omega) - 1))
    spacing = float(used.frequency[above] - used.frequency[above - 1])
    if spacing > width / 2.0:
        yield CoarseLines(spacing, width)
