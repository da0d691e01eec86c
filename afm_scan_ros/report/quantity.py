"""A number with its uncertainty and unit, as people write it."""

import math

PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}
SCALED = ("s", "m", "Hz", "V", "m/s")
"""Units that take a prefix; a share or an inverse length takes none."""


def quantity(value: float, halfwidth: float, unit: str) -> str:
    """Return value ± half its interval, two digits of the latter, as ``57.1 ± 1.6 µs``.

    Where the interval is not finite, or far smaller than the value, it is left out.
    """
    power = _power(value) if unit in SCALED else 0
    scaled, half = value / 10.0**power, halfwidth / 10.0**power
    name = "" if unit == "1" else f" {PREFIXES[power]}{unit}"
    if not math.isfinite(half) or half < 1e-6 * abs(scaled) or half == 0.0:
        return f"{scaled:.4g}{name}"
    places = max(0, 1 - math.floor(math.log10(half)))
    return f"{scaled:.{places}f} ± {half:.{places}f}{name}"


def _power(value: float) -> int:
    if value == 0.0:
        return 0
    thousands = 3 * math.floor(math.log10(abs(value)) / 3.0)
    return min(max(thousands, min(PREFIXES)), max(PREFIXES))
