"""The catalogue of sentences: what a verdict, a finding or the status of an effect says in words.

``templates/sentences.yaml`` has each by its code, as a template of Jinja. It is text: pages escape
it. A value that a sentence names and that is not given is an error.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from math import isnan
from pathlib import Path

import yaml
from attrs import frozen
from jinja2 import Environment, StrictUndefined, Template

from afm_scan_ros.core.model import BaseEffects, EffectStatus, ParameterInterval, Range
from afm_scan_ros.report.quantity import nanometres, percent, probability, significant

WORDS = Environment(undefined=StrictUndefined)  # noqa: S701 - text, no markup
WORDS.filters |= {
    "f": format,
    "nm": nanometres,
    "percent": percent,
    "probability": probability,
    "significant": significant,
}
WORDS.tests["known"] = lambda value: not isnan(value)


@frozen
class Catalogue:
    """The sentences of a file, by their codes."""

    file: Path

    def __call__(self, code: str, **values: object) -> str:
        """Return the sentence of a code, as ``verdict.ambiguous``, filled with values."""
        return _template(self.file, code).render(values)


@cache
def _template(file: Path, code: str) -> Template:
    section, _, name = code.partition(".")
    return WORDS.from_string(_texts(file)[section][name])


@cache
def _texts(file: Path) -> dict[str, dict[str, str]]:
    texts: dict[str, dict[str, str]] = yaml.safe_load(file.read_text("utf-8"))
    return texts


sentence = Catalogue(Path(__file__).parent / "templates" / "sentences.yaml")
"""Those of the kernel; a feature has its own."""


def unknown_effects(effects: Mapping[str, BaseEffects]) -> Iterator[str]:
    """Yield a sentence for each effect that is unknown, by axis, with what would identify it."""
    for axis, base in effects.items():
        for name, status in base.unknown():
            record = sentence(f"record.{status.identifiable_from}")
            yield sentence("fit.unknown", axis=axis, name=name, record=record)


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
