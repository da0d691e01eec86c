"""Node: the simulated piezoscanner, drive voltage in, displacement out, measured and true."""

from afm_scan_ros.drivers import DriverChoice
from afm_scan_ros.nodes.block_consumer import AUTOSTART, min_subscriptions
from afm_scan_ros.nodes.parameters import SIMULATION, simulated_scanner
from afm_scan_ros.nodes.scanner_node import TIMEOUTS, ScannerNode


class PiezoscannerSim(ScannerNode):
    """The scanner of a plant file, in simulation."""

    NAME = "piezoscanner_sim"
    PARAMETERS = (
        *SIMULATION,
        AUTOSTART,
        *TIMEOUTS,
        min_subscriptions(1),
        min_subscriptions(1, of="true_"),
    )

    def choice(self) -> DriverChoice:
        """Return the simulated scanner; refuses a wrong plant file."""
        return simulated_scanner(self.settings, self.NAME)
