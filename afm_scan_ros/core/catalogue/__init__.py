"""Effects beyond the paper's model, one a file. An effect is found by being listed here."""

from afm_scan_ros.core.catalogue import (
    cross_coupling,
    delay,
    drift,
    extra_resonance,
    input_lag,
    periodic_disturbance,
    slow_creep,
    static_nonlinearity,
)
from afm_scan_ros.core.catalogue.entry import Entry
from afm_scan_ros.core.errors import InputError

CATALOGUE: tuple[Entry, ...] = (
    cross_coupling.ENTRY,
    delay.ENTRY,
    drift.ENTRY,
    extra_resonance.ENTRY,
    input_lag.ENTRY,
    periodic_disturbance.ENTRY,
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
