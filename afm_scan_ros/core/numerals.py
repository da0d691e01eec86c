"""Numbers for sentences: rounded to significant digits, without powers of ten."""

import math


def significant(value: float, digits: int = 3) -> str:
    """Return a number to so many digits at least: ``8,314``, ``13.9``, ``0.0041``."""
    if value == 0.0:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:,.{places}f}"
