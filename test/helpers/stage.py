"""The settings of the simulated scanner as its package gives them, for a driver of the tests."""

from pathlib import Path

from attrs import evolve

from afm_scan_ros.drivers import ScannerSettings, load_settings, settings_file
from afm_scan_ros.files import yaml

SIMULATED = "simulated"


def stage(path: Path, **options: object) -> Path:
    """Write the settings, with these options of the driver; return their file."""
    content = yaml.load(settings_file(SIMULATED, ""))
    yaml.save(path, {**content, "options": options}, "The simulated scanner.")
    return path


def settings(**changed: object) -> ScannerSettings:
    """Return the settings with some of them changed; the sensor reads metres."""
    return evolve(load_settings(SIMULATED, settings_file(SIMULATED, "")).settings, **changed)
