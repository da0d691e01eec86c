"""Node: a scanner moved by any driver, drive voltage in, displacement out."""

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.drivers import DriverChoice, load_settings, settings_file
from afm_scan_ros.files.records import naming
from afm_scan_ros.nodes.block_consumer import AUTOSTART, min_subscriptions
from afm_scan_ros.nodes.parameters import NodeParameter
from afm_scan_ros.nodes.scanner_node import TIMEOUTS, ScannerNode


class ScannerDriver(ScannerNode):
    """The scanner of a driver and its settings file."""

    NAME = "scanner_driver"

    PARAMETERS = (
        NodeParameter("driver", "", "module:Class, or a short name as simulated"),
        NodeParameter("settings_file", "", "Settings of the scanner and of its driver, in YAML"),
        AUTOSTART,
        *TIMEOUTS,
        min_subscriptions(1),
        min_subscriptions(0, of="true_"),
    )

    def choice(self) -> DriverChoice:
        """Return the driver that the parameters name; raises InputError where one is missing."""
        if not (driver := self.settings["driver"]):
            raise InputError("parameter driver: give it, as -p driver:=mylab:Stage")
        with naming("parameter settings_file"):
            file = settings_file(driver, self.settings["settings_file"])
            return load_settings(driver, file)
