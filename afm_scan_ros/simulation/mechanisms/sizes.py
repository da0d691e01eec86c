"""The effects to test against: mechanisms at three sizes.

Small, medium and large move the scanner by some 40, 120 and 400 nm rms on a scan of 40 um that
shows them (docs/undeclared.md says by how much on which).
"""

from collections.abc import Callable

from attrs import frozen

from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.delayed_converter import DelayedConverter
from afm_scan_ros.simulation.mechanisms.tilted_sensor import TiltedSensor
from afm_scan_ros.simulation.mechanisms.warming_frame import WarmingFrame

SIZES = ("small", "medium", "large")


@frozen
class Effect:
    """One mechanism of growing ``size``, and the name of the effect that explains it.

    ``name`` is None where no declared effect does.
    """

    name: str | None
    mechanism: Callable[[str, float], Mechanism]
    sizes: tuple[float, float, float]


EFFECTS = {
    "cross_coupling_tilt": Effect(
        "cross_coupling",
        lambda axis, angle: TiltedSensor(axis=axis, angle=angle),
        (3e-3, 9e-3, 30e-3),
    ),
    "delay": Effect(
        "delay",
        lambda axis, delay: DelayedConverter(axis=axis, delay=delay),
        (17e-6, 50e-6, 170e-6),
    ),
    "drift": Effect(
        "drift",
        lambda axis, kelvin: WarmingFrame(
            axis=axis,
            room_step=kelvin,
            room_ramp=0.02 * kelvin,
            frame_tau=8.0,
            stage_tau=300.0,
            expansion=1.2e-6,
        ),
        (1.0, 3.0, 10.0),
    ),
}
"""By the names of the files in config/plants."""


def sized(effect: str, size: str, axis: str) -> tuple[Mechanism, ...]:
    """Mechanisms of one of the ``EFFECTS`` at one of the ``SIZES``, on axis "x" or "y"."""
    found = EFFECTS[effect]
    return (found.mechanism(axis, found.sizes[SIZES.index(size)]),)
