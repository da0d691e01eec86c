"""Drivers of real scanners: what a lab needs to write one of its own."""

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import ramp_to_rest
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.base import Driver, Reading, ScannerSettings

__all__ = [
    "Driver",
    "InputError",
    "Reading",
    "ScanError",
    "ScannerSettings",
    "Trace",
    "ramp_to_rest",
]
