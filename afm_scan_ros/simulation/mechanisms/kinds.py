"""Every mechanism that a plant file can name."""

from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.delayed_converter import DelayedConverter
from afm_scan_ros.simulation.mechanisms.tilted_sensor import TiltedSensor
from afm_scan_ros.simulation.mechanisms.warming_frame import WarmingFrame

KINDS: dict[str, type[Mechanism]] = {
    kind.KIND: kind for kind in (DelayedConverter, TiltedSensor, WarmingFrame)
}
