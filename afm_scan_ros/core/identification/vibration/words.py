"""What a frequency record cannot tell about a resonance, in words."""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse

NONLINEARITY = 0.01
COHERENCE = 0.95
ABOVE = 1.2
"""The band should reach this many times the resonance."""


def vibration_warnings(
    used: FrequencyResponse, resonance: float, damping: float
) -> tuple[str, ...]:
    """Sentences about the lines used and the resonance (Hz) and damping ratio fitted to them."""
    found = _nonlinear(used), _incoherent(used), _narrow(used, resonance)
    coarse = _coarse(used, resonance, damping)
    return tuple(sentence for warnings in (*found, coarse) for sentence in warnings)


def _nonlinear(used: FrequencyResponse) -> Iterator[str]:
    if used.nonlinearity_share > NONLINEARITY:
        yield (
            f"hysteresis in the small-signal record: waves differ by {used.nonlinearity_share:.1%}"
            f" of the response beyond the noise's {used.noise_share:.1%}, so the small-signal gain"
            " depends on the amplitude; drive with less of it"
        )


def _incoherent(used: FrequencyResponse) -> Iterator[str]:
    """Name the frequency from which at least half the lines up to the band's end are low."""
    low = used.coherence < COHERENCE
    share = np.cumsum(low[::-1])[::-1] / np.arange(len(low), 0, -1)
    first = np.flatnonzero(low & (share >= 0.5))  # noqa: PLR2004 - half
    if first.size:
        yield (
            f"coherence is too low from {used.frequency[first[0]]:.0f} Hz (below {COHERENCE});"
            " drive harder there or record more periods"
        )


def _narrow(used: FrequencyResponse, resonance: float) -> Iterator[str]:
    low, high = used.frequency[0], used.frequency[-1]
    if not ABOVE * low <= resonance <= high / ABOVE:
        yield (
            f"the band is too narrow: {low:.0f} to {high:.0f} Hz for a resonance at"
            f" {resonance:.0f} Hz; drive from below {resonance / 2.0:.0f} Hz to above"
            f" {ABOVE * resonance:.0f} Hz"
        )


def _coarse(used: FrequencyResponse, resonance: float, damping: float) -> Iterator[str]:
    width = 2.0 * damping * resonance
    above = int(np.clip(np.searchsorted(used.frequency, resonance), 1, len(used.omega) - 1))
    spacing = used.frequency[above] - used.frequency[above - 1]
    if spacing > width / 2.0:
        yield (
            f"the lines are too coarse: every {spacing:.1f} Hz across a resonance {width:.1f} Hz"
            f" wide; drive at most every {width / 2.0:.1f} Hz, with periods of"
            f" {2.0 / width:.2g} s or more"
        )
