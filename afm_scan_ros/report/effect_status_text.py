"""How each effect of a model is known, in sentences."""

from collections.abc import Iterator, Mapping

from afm_scan_ros.core.model import BaseEffects, EffectStatus, ParameterInterval, Range

RECORDS = {
    "creep": "steps that are held for minutes",
    "hysteresis": "triangles, loops or sines of several amplitudes",
    "frequency": "a multisine or a sweep up to beyond the first resonance",
}
"""What to record, by the kind of record."""


def unknown_effects(effects: Mapping[str, BaseEffects]) -> Iterator[str]:
    """Yield a sentence for each effect that is unknown, by axis, with what would identify it."""
    for axis, base in effects.items():
        for name, status in base.unknown():
            record = RECORDS[status.identifiable_from]
            yield f"{axis}: {name} is unknown. Record {record}."


def status_text(status: EffectStatus, drive: str = "V") -> str:
    """Return how an effect is known and over which ranges, without a full stop.

    ``drive`` is the unit of the drive's range.
    """
    parts = [
        _between(status.drive, drive),
        _between(status.frequencies, "Hz"),
        _between(status.hold_times, "s"),
    ]
    seen = "none seen" if any(one.holds_zero for one in status.intervals) else ""
    return ", ".join(filter(None, [status.status.value, seen, *parts]))


def intervals_text(status: EffectStatus) -> str:
    """Return the intervals of an effect's parameters, an open end as a question mark."""
    return "; ".join(map(_interval, status.intervals))


def _interval(one: ParameterInterval) -> str:
    if one.lower is None and one.upper is None:
        return f"{one.name} not determined"
    unit = "" if one.unit == "1" else f" {one.unit}"
    low, high = ("?" if end is None else f"{end:.4g}" for end in (one.lower, one.upper))
    return f"{one.name} {low} to {high}{unit}"


def _between(given: Range | None, unit: str) -> str:
    if given is None:
        return ""
    low, high = (f"{end:.4g}" for end in given)
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"
