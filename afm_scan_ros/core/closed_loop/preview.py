"""How far ahead a model's inverses are to look: as far as their response reaches."""

from afm_scan_ros.core.effects.vibration import LARGEST_TAIL
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scanner import chain_of

LEAST = 0.03
"""Seconds that the inverses of a closed loop look ahead at least."""


def preview_of(model: ScannerModel, sample_period: float, least: float = LEAST) -> float:
    """Seconds that the inverses of all axes must look ahead, at least ``least``.

    A mode that rings long asks for much. Raises InputError where a response does not die out, or
    for an added effect that cannot be.
    """
    settings = InverseSettings()
    chains = (chain_of(model.axis(name)) for name in model.axes)
    inverses = (chain.vibration(sample_period, settings).inverse for chain in chains)
    samples = max(inverse.kernel.preview_needed(LARGEST_TAIL) for inverse in inverses)
    return max(least, samples * sample_period)
