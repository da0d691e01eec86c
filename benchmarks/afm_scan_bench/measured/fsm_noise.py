"""Which of the fine steering mirror's realisations are noisier than the others."""

import numpy as np

from afm_scan_bench.measured.mirror.recordings import (
    AMPLITUDES,
    REALISATIONS,
    period_noise,
    spectra,
)
from afm_scan_ros.core.identification.state_space.spectra import reliability
from afm_scan_ros.report.table import Row, Table

NOISIER = 10.0
"""Noise power over the median of its amplitude's from which a realisation is called noisier."""

COLUMNS = {
    "amplitude_mv": ("mV rms", "d"),
    "realisation": ("no.", "d"),
    "noise_nm": ("noise, nm", ".1f"),
    "noise_percent": ("%", ".2f"),
    "ratio": ("to median", ".1f"),
    "from_hz": ("from Hz", ".0f"),
    "to_hz": ("to Hz", ".0f"),
    "least_weight": ("weight", ".2f"),
    "verdict": ("", ""),
}
TITLE = (
    "Fine steering mirror (Floren et al., ISMA-USD 2024, pp. 2042-2052, CC BY 4.0)\n"
    "Rms noise of the mean of two periods, three outputs together; its power to the\n"
    "median of the amplitude's; the band of 90 % of it; the least weight of a line"
)


def measure() -> Table:
    """Noise of each realisation, from the difference between its periods."""
    rows = [row for amplitude in AMPLITUDES for row in _rows(amplitude)]
    return Table("fsm_noise", TITLE, COLUMNS, rows)


def _rows(amplitude: int) -> list[Row]:
    noises = [period_noise(amplitude, k) for k in REALISATIONS]
    median = float(np.median([noise.rms**2 for noise in noises]))
    weights = reliability(spectra(amplitude)).min(axis=0)
    return [
        {
            "amplitude_mv": amplitude,
            "realisation": k,
            "noise_nm": 1e9 * noise.rms,
            "noise_percent": 100.0 * noise.relative,
            "ratio": noise.rms**2 / median,
            "from_hz": noise.band[0],
            "to_hz": noise.band[1],
            "least_weight": float(weights[k]),
            "verdict": "noisier" if noise.rms**2 > NOISIER * median else "",
        }
        for k, noise in enumerate(noises)
    ]
