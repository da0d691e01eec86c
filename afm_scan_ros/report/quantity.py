"""A number with its uncertainty and unit, as people write it."""

import math

PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}
SCALED = ("s", "m", "Hz", "V", "m/s")
"""Units that take a prefix; a share or an inverse length takes a power of ten, if it must."""
PLAIN = (1e-4, 1e4)
"""From where to where a number is written without either."""
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


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
    said, lowest, highest = (
        _number(each / 10.0**power, half).split(" ")[0] for each in (value, low, high)
    )
    return _scaled(f"{said} ({lowest} to {highest})", power, unit)


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
