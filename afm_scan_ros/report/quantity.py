"""Numbers as text: rounded, with uncertainty and unit, and the parameters of an effect."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from attrs import frozen

if TYPE_CHECKING:  # result imports every effect, which takes seconds
    from afm_scan_ros.core.diagnosis.result import Value


def significant(value: float, digits: int = 3) -> str:
    """Return a number to so many digits at least: ``8,314``, ``13.9``, ``0.0041``."""
    if value == 0.0:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:,.{places}f}"


PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}
SCALED = ("s", "m", "Hz", "V", "m/s")
"""Units that take a prefix; a share or an inverse length takes a power of ten, if it must."""
PLAIN = (1e-4, 1e4)
"""From where to where a number is written without either."""
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def nanometres(value: float) -> str:
    """Three digits at least of a length in m, in nm."""
    nano = 1e9 * value
    digits = 2 if abs(nano) < 10.0 else 1 if abs(nano) < 100.0 else 0  # noqa: PLR2004 - digits
    return f"{nano:,.{digits}f}"


def percent(share: float) -> str:
    """Return a share of the range in percent."""
    return f"{100.0 * share:.3f}"


SMALLEST = 1e-3
"""Smallest probability that is written."""


def probability(value: float) -> str:
    """Write a probability with three decimals; a dash where there is none."""
    if math.isnan(value):
        return "-"
    return "< 0.001" if value < SMALLEST else f"{value:.3f}"


def quantity(value: float, halfwidth: float, unit: str) -> str:
    """Return value ± half its interval, two digits of the latter, as ``57.1 ± 1.6 µs``.

    Where the interval is not finite, or far smaller than the value, it is left out.
    """
    known = math.isfinite(halfwidth) and halfwidth >= 1e-6 * abs(value) and halfwidth > 0.0
    power = _power(max(abs(value), halfwidth) if known else abs(value), unit)
    return _scaled(
        _number(value / 10.0**power, halfwidth / 10.0**power if known else None), power, unit
    )


def within(value: float, low: float, high: float, unit: str) -> str:
    """Return a value with the ends of its interval, as ``0.900 (0.700 to 1.000) s``."""
    power = _power(max(abs(low), abs(high)), unit)
    half = (high - low) / 2.0 / 10.0**power
    text, lowest, highest = (
        _number(each / 10.0**power, half).split(" ")[0] for each in (value, low, high)
    )
    return _scaled(f"{text} ({lowest} to {highest})", power, unit)


def _scaled(number: str, power: int, unit: str) -> str:
    """Number with its prefix or power of ten and its unit."""
    if unit in SCALED:
        return f"{number} {PREFIXES[power]}{unit}"
    if power:
        number = f"({number})" if " " in number else number
        number = f"{number}·10{str(power).translate(RAISED)}"
    return number if unit == "1" else f"{number} {_raised(unit)}"


def _number(value: float, half: float | None) -> str:
    if half is None:
        return f"{value:.4g}"
    places = 1 - math.floor(math.log10(half))
    shown = max(0, places)
    return f"{round(value, places):.{shown}f} ± {round(half, places):.{shown}f}"


def _power(size: float, unit: str) -> int:
    """Power of ten, in thousands, by which a number of this size is divided."""
    if size == 0.0 or (unit not in SCALED and PLAIN[0] <= size < PLAIN[1]):
        return 0
    thousands = 3 * math.floor(math.log10(size) / 3.0)
    return min(max(thousands, min(PREFIXES)), max(PREFIXES)) if unit in SCALED else thousands


def _raised(unit: str) -> str:
    """Unit with its exponents raised, as ``1/m²``: a digit behind a letter is one."""
    last = unit[-1]
    return unit[:-1] + last.translate(RAISED) if len(unit) > 1 and last.isdigit() else unit


EDGE = "the edge of the catalogue's range"


def value_text(of: "Value") -> str:
    """Return value and interval, as ``57.1 ± 1.6 µs``.

    Where the catalogue's range cuts the interval, its ends are given as the JSON has them.
    """
    unit = of.parameter.unit
    if of.cut:
        text = within(of.value, *of.interval, unit)
    else:
        text = quantity(of.value, of.halfwidth, unit)
    if of.at_edge:
        return f"{text}, at {EDGE}: not determined"
    return f"{text}, up to {EDGE}" if of.cut else text


SIGNIFICANT = 5.99 / 1.96**2
"""χ² of cosine and sine together by which 95 % exceed zero, in units of their 95 % intervals."""


@frozen
class Harmonic:
    """Number, and the cosine and sine of one harmonic."""

    number: int
    cosine: "Value"
    sine: "Value"

    @property
    def significant(self) -> bool:
        """Whether it differs from zero at the 95 % level."""
        pairs = ((v.value, v.halfwidth) for v in (self.cosine, self.sine))
        return sum((value / half) ** 2 if half else math.inf for value, half in pairs) > SIGNIFICANT

    @property
    def most(self) -> float:
        """Amplitude that the intervals allow."""
        return math.hypot(*(abs(v.value) + v.halfwidth for v in (self.cosine, self.sine)))

    def rows(self) -> Iterator[tuple[str, str]]:
        """Yield amplitude and phase, to first order in their intervals."""
        (c, dc), (s, ds) = ((v.value, v.halfwidth) for v in (self.cosine, self.sine))
        size = math.hypot(c, s)
        along, across = math.hypot(c * dc, s * ds) / size, math.hypot(s * dc, c * ds) / size**2
        which = f" {self.number}" if self.number > 1 else ""
        yield f"amplitude{which}", quantity(size, along, self.cosine.parameter.unit)
        phase = math.degrees(math.atan2(s, c))
        yield f"phase{which}", quantity(phase, math.degrees(across), "°")


def harmonic_rows(values: "Sequence[Value]") -> Iterator[tuple[str, str]]:
    """Yield a disturbance's frequency and harmonics, those that are not significant in one row."""
    named = {v.parameter.name: v for v in values}
    frequency = named.pop("frequency")
    yield "frequency", value_text(frequency)
    pairs = zip(*[iter(named.values())] * 2, strict=True)
    harmonics = [Harmonic(number, *pair) for number, pair in enumerate(pairs, 1)]
    for each in harmonics:
        if each.significant:
            yield from each.rows()
    others = [each for each in harmonics if not each.significant]
    if others:
        unit = others[0].cosine.parameter.unit
        most = quantity(float(f"{max(each.most for each in others):.1e}"), math.inf, unit)
        numbers = ", ".join(str(each.number) for each in others)
        yield f"harmonics {numbers}", f"not significant, {most} at most"
