"""Effects beyond the paper's model, one a file. An effect is found by being listed here."""

from afm_scan_ros.core.effects import (
    backlash,
    cross_coupling,
    delay,
    drift,
    extra_resonance,
    hysteretic_stiffness,
    input_lag,
    parameter_shift,
    periodic_disturbance,
    rate_dependent_hysteresis,
    slew_limit,
    slow_creep,
    static_nonlinearity,
)
from afm_scan_ros.core.effects.entry import Entry
from afm_scan_ros.core.errors import InputError

CATALOGUE: tuple[Entry, ...] = (
    backlash.ENTRY,
    cross_coupling.ENTRY,
    delay.ENTRY,
    drift.ENTRY,
    extra_resonance.ENTRY,
    hysteretic_stiffness.ENTRY,
    input_lag.ENTRY,
    parameter_shift.ENTRY,
    periodic_disturbance.ENTRY,
    rate_dependent_hysteresis.ENTRY,
    slew_limit.ENTRY,
    slow_creep.ENTRY,
    static_nonlinearity.ENTRY,
)


def entry(name: str) -> Entry:
    """Return the entry of a name; raises InputError where there is none."""
    for found in CATALOGUE:
        if found.name == name:
            return found
    names = ", ".join(e.name for e in CATALOGUE)
    raise InputError(f"no effect is named {name!r}: choose among {names}")
