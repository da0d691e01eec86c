"""The known error of a model, rms by frequency band.

A residual below it shows no missing effect.
"""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import floats

VIBRATING = 0.66
"""Share of the first resonance's frequency from which on modes that a model lacks may dominate."""
NARROWEST = 0.7
"""Share of the Nyquist frequency up to which the last band begins."""
SLOW = 0.0, 0.0022, 0.0066, 0.022, 0.066, 0.22
EDGES = (*SLOW, VIBRATING, 0.93, 1.32, 1.87, 2.64, 3.74, 5.3, 7.5, 22.0)
"""Over the first resonance; a record's bands lie between those below its Nyquist frequency.

Finer where scanners resonate: a mode that a model lacks is to spoil the band that it lies in, not
those around it.
"""


@frozen
class ModelDiscrepancy:
    """Rms in m of measured minus predicted displacement in each band, on held-out data.

    ``bands`` are the n + 1 edges of n bands, Hz. ``rms`` (n,) is free of the sensor's ``noise``
    (n,). ``displacement`` (n,) is what the record itself holds in each band: ``rms`` over it is
    the relative error, by which other drives may be judged. ``record`` describes the drive.
    Of motion that was ``fitted`` they are the error of similar motion, and no more.
    Raises InputError where they do not pair or are no rms.
    """

    record: str
    bands: tuple[float, ...] = field(converter=floats)
    rms: tuple[float, ...] = field(converter=floats)
    noise: tuple[float, ...] = field(converter=floats)
    displacement: tuple[float, ...] = field(converter=floats)
    fitted: bool = False

    def __attrs_post_init__(self) -> None:
        figures = np.array([len(f) for f in (self.rms, self.noise, self.displacement)])
        if len(self.bands) < 2 or np.any(figures != len(self.bands) - 1):  # noqa: PLR2004 - edges
            raise InputError(
                f"model_discrepancy has {len(self.bands)} edges of bands: give two or more, and"
                " one rms, noise_rms and displacement_rms fewer"
            )
        if self.bands[0] < 0.0 or np.any(np.diff(self.bands) <= 0.0):
            raise InputError(f"model_discrepancy: bands must ascend from 0 or more: {self.bands}")
        numbers = np.array([*self.bands, *self.rms, *self.noise, *self.displacement])
        if not np.all(np.isfinite(numbers) & (numbers >= 0.0)):
            raise InputError("model_discrepancy holds what is no rms: give finite numbers from 0")


def band_edges(sample_period: float, resonance: float) -> tuple[float, ...]:
    """Edges in Hz of the bands of a signal sampled so often, a factor of 1.4 to 3 apart.

    ``resonance`` (Hz) is the first of the model. The last edge is the Nyquist frequency; the others
    have three digits.
    """
    nyquist, edges = 0.5 / sample_period, (edge_at(edge, resonance) for edge in EDGES)
    return (*(edge for edge in edges if edge < NARROWEST * nyquist), nyquist)


def edge_at(share: float, resonance: float) -> float:
    """Edge (Hz) at a share of a resonance (Hz), to three digits."""
    return float(f"{share * resonance:.3g}")
