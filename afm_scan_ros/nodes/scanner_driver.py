"""Node: a scanner moved by any driver, drive voltage in, displacement out."""

from pathlib import Path

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.drivers.settings import DriverChoice, load_settings
from afm_scan_ros.nodes.block_consumer import min_subscriptions
from afm_scan_ros.nodes.parameters import NodeParameter
from afm_scan_ros.nodes.run import run_node
from afm_scan_ros.nodes.scanner_node import TIMEOUTS, ScannerNode


class ScannerDriver(ScannerNode):
    """The scanner of a driver and its settings file."""

    NAME = "scanner_driver"

    PARAMETERS = (
        NodeParameter("driver", "", "module:Class, or a short name as simulated"),
        NodeParameter("settings_file", "", "Settings of the scanner and of its driver, in YAML"),
        *TIMEOUTS,
        min_subscriptions(1),
        min_subscriptions(0, of="true_"),
    )

    def choice(self) -> DriverChoice:
        """Return the driver that the parameters name; raises InputError where one is missing."""
        for name, example in (("driver", "mylab:Stage"), ("settings_file", "stage.yaml")):
            if not self.settings[name]:
                raise InputError(f"parameter {name}: give it, as -p {name}:={example}")
        return load_settings(self.settings["driver"], Path(self.settings["settings_file"]))


def main() -> int:
    """Run the node."""
    return run_node(ScannerDriver)
