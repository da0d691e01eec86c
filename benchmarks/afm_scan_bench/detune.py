"""Plants whose resonance or creep differs from the model's."""

from attrs import evolve

from afm_scan_ros.simulation.axis import RationalSpec, detuned_axis
from afm_scan_ros.simulation.scanner import PlantSpec


def detuned(spec: PlantSpec, frequency: float, damping: float) -> PlantSpec:
    """Plant whose first resonance has its frequency and damping ratio times these factors.

    Both axes are changed, see ``detuned_axis``. Raises InputError where one would be unstable.
    """
    x, y = (detuned_axis(axis, frequency, damping) for axis in (spec.x, spec.y))
    return evolve(spec, x=x, y=y)


def with_creep_rate(spec: PlantSpec, factor: float) -> PlantSpec:
    """Plant whose creep has its time constants divided by ``factor`` and the same gains."""
    x, y = (evolve(axis, creep=_hurried(axis.creep, factor)) for axis in (spec.x, spec.y))
    return evolve(spec, x=x, y=y)


def _hurried(creep: RationalSpec, factor: float) -> RationalSpec:
    """Gc(s / factor)."""
    numerator, denominator = (
        tuple(c * factor ** (i + 1 - len(side)) for i, c in enumerate(side))
        for side in (creep.numerator, creep.denominator)
    )
    return RationalSpec(numerator, denominator)
