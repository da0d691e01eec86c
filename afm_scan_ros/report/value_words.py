"""A parameter's value as its row has it, with what its interval leaves open."""

from afm_scan_ros.core.diagnosis.result import Value
from afm_scan_ros.report.quantity import quantity, within

EDGE = "the edge of what the catalogue allows"


def value_words(of: Value) -> str:
    """Return value and interval, as ``57.1 ± 1.6 µs``.

    Where the catalogue's range cuts the interval, its ends are given as the JSON has them.
    """
    unit = of.parameter.unit
    if of.cut:
        said = within(of.value, *of.interval, unit)
    else:
        said = quantity(of.value, of.halfwidth, unit)
    if of.at_edge:
        return f"{said}, at {EDGE}: left open"
    return f"{said}, up to {EDGE}" if of.cut else said
