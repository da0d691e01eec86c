"""Node: the simulated piezoscanner, drive voltage in, displacement out, measured and true."""

import sys
from pathlib import Path

from afm_scan_ros.core.limits import AmplifierSpec
from afm_scan_ros.drivers import AxisSettings, DriverChoice, ScannerSettings
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.records import naming
from afm_scan_ros.nodes.block_consumer import AUTOSTART, min_subscriptions
from afm_scan_ros.nodes.parameters import DRIVE_LIMITS, NodeParameter, drive_limits
from afm_scan_ros.nodes.scanner_node import TIMEOUTS, ScannerNode

DRIVER = "simulated"
METRES = AxisSettings(1.0, 0.0, -sys.float_info.max, sys.float_info.max)
"""The simulated sensor reads metres, and checks its own range."""


class PiezoscannerSim(ScannerNode):
    """The scanner of a plant file, in simulation."""

    NAME = "piezoscanner_sim"

    PARAMETERS = (
        NodeParameter(
            "plant_file", str(share_directory() / "config/plant.yaml"), "Simulated scanner"
        ),
        NodeParameter("seed", 1, "Seed of the sensor's noise", low=0),
        NodeParameter(
            "age_s", 0.0, "Time since the scanner was switched on, at the scan's start", low=0.0
        ),
        AUTOSTART,
        *TIMEOUTS,
        NodeParameter("output_log", "", "File for the outputs and their moments; empty for none"),
        *DRIVE_LIMITS,
        min_subscriptions(1),
        min_subscriptions(1, of="true_"),
    )

    def choice(self) -> DriverChoice:
        """Return the simulated scanner; its sensor cannot be lost. Refuses a wrong plant file."""
        with naming("parameter plant_file"):
            load_plant(Path(self.settings["plant_file"]))
        limits = drive_limits(self.settings)
        settings = ScannerSettings(
            AmplifierSpec(limits.voltage, limits.slew, limits.slew),
            METRES,
            METRES,
            latency_samples=0,
            response_time=1.0,
            drive_resolution=2.0 * limits.voltage,
            sampling_instant="before_update",
        )
        own = {name: self.settings[name] for name in ("plant_file", "seed", "output_log")}
        return DriverChoice(DRIVER, settings, own | {"age": self.settings["age_s"]}, self.NAME)
