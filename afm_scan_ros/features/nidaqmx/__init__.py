"""Scanners on NI's converters."""

DRIVERS = {"nidaqmx": "afm_scan_ros.features.nidaqmx.driver:NiDaqmx"}
