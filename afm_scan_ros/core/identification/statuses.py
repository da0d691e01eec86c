"""What was fitted to which record → how each effect is known, and where that holds."""

import numpy as np

from afm_scan_ros.core.effect_status import EffectStatus, Range, Status, closed
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.identification.creep.fit import CreepFit
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit
from afm_scan_ros.core.types import Array

UNITS = {"gain": "1", "time_constant": "s"}
"""Of the parameters of creep, by how their names begin."""


def drive_range(drive: Array) -> Range:
    """Least and greatest drive, V, of a record (n,)."""
    return float(drive.min()), float(drive.max())


def unknown(identifiable_from: str) -> EffectStatus:
    """Status of an unknown effect, with the kind of record that would identify it."""
    return EffectStatus(Status.UNKNOWN, identifiable_from=identifiable_from)


def creep_status(fit: CreepFit, record: AxisRecord) -> EffectStatus:
    """Status of a creep fitted to a record of steps."""
    longest = len(record.drive) * record.sample_period
    return EffectStatus(
        drive=drive_range(record.drive),
        hold_times=(record.sample_period, longest),
        intervals=tuple(
            closed(name, interval, UNITS[name.rsplit("_", 1)[0]])
            for name, interval in fit.intervals.items()
        ),
    )


def vibration_status(
    fit: RationalFit, record: AxisRecord, gauge: float | None = 1.0
) -> EffectStatus:
    """Status of a vibration fitted to a frequency response, its gain over a ``gauge``.

    The gain is that at rest, which creep and larger loops raise: a fast record alone gives none,
    and there is no gauge.
    """
    gain = tuple(end / gauge for end in fit.gain_interval) if gauge else (-np.inf, np.inf)
    return EffectStatus(
        drive=drive_range(record.drive),
        frequencies=fit.band,
        intervals=(
            closed("resonance", fit.resonance_interval, "Hz"),
            closed("damping", fit.damping_interval, "1"),
            closed("gain", (gain[0], gain[1]), "1"),
        ),
    )


def hysteresis_status(record: AxisRecord) -> EffectStatus:
    """Status of a hysteresis fitted to a record, which holds up to its fastest turns."""
    return EffectStatus(
        drive=drive_range(record.drive),
        frequencies=(0.0, turning_rate(record.drive) / record.sample_period),
    )


def turning_rate(drive: Array) -> float:
    """Swings a sample of a drive (n,), there and back, counted over the whole of it."""
    moves = np.diff(drive)
    ways = np.sign(moves[moves != 0.0])
    return float(np.count_nonzero(np.diff(ways)) / 2.0 / max(len(drive) - 1, 1))
