"""A sensor that shows nothing, or what no scanner does: said beside the figures made of it."""

from afm_scan_ros.core.scan_spec import LARGEST_RANGE


def sensor_doubt(axis: str, moved: float, lowest: float, highest: float) -> str:
    """Return a sentence where an axis that is moved stands still, or goes too far; else nothing.

    ``moved`` is the peak-to-peak of its drive or desired displacement; the achieved displacement
    goes from ``lowest`` to ``highest``, m.
    """
    if moved > 0.0 and lowest == highest:
        return f"{axis}: the achieved displacement is constant: see that the sensor is connected"
    if highest - lowest > LARGEST_RANGE:
        return (
            f"{axis}: the achieved displacement spans {highest - lowest:.3g} m, a scanner's"
            f" {LARGEST_RANGE:g} m at most: see to the sensor's scale"
        )
    return ""
