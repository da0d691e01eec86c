"""The driver of the simulated scanner."""

import time
from pathlib import Path

import numpy as np
from attrs import evolve

from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import Driver, Reading, ScannerSettings
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.scanner import Piezoscanner


class SimulatedScanner(Driver):
    """The scanner of a plant file, by default config/plant.yaml.

    The tighter limits of plant and settings hold. The sensor reads metres, so that its scale is 1.
    ``age`` (s) is the time since the scanner was switched on, when the scan begins.
    ``output_log`` names a file to be written: a line for each block, with the moment (s, the
    system's monotonic clock) from which the outputs (V) stand; empty for none.
    """

    KNOWS_TRUE = True

    def __init__(
        self,
        settings: ScannerSettings,
        plant_file: str = "",
        seed: int = 1,
        age: float = 0.0,
        output_log: str = "",
    ) -> None:
        plant = load_plant(Path(plant_file or share_directory() / "config/plant.yaml"))
        self._plant = evolve(plant, amplifier=plant.amplifier.within(settings.amplifier))
        self._seed, self._age = seed, age
        self._log = Path(output_log).open("w", encoding="utf-8") if output_log else None  # noqa: SIM115
        self._scanner: Piezoscanner

    def start(self, sample_period: float) -> None:
        """Build the scanner; compile its code now, not while a scan waits for it."""
        first = Trace(0, sample_period, np.zeros(2), np.zeros(2))
        Piezoscanner(self._plant, sample_period, self._seed).advance(first)
        self._scanner = Piezoscanner(self._plant, sample_period, self._seed, self._age)

    def advance(self, drive: Trace) -> Reading:
        """Simulate a block; raises ScanError beyond a limit of amplifier or sensor."""
        reading = Reading(*self._scanner.advance(drive))
        self._write(drive)
        return reading

    def ramp_down(self) -> float:
        """Ramp down, in the time that this takes a real amplifier.

        Nobody reads the displacement meanwhile, so that only the outputs are simulated.
        """
        ramp = self._scanner.ramp_down()
        duration = ramp.x.size * ramp.sample_period
        time.sleep(duration)
        self._write(ramp)
        return duration

    def _write(self, drive: Trace) -> None:
        if self._log is not None:
            end = drive.first_sample + drive.x.size
            self._log.write(f"{time.monotonic()} {end} {drive.x[-1]} {drive.y[-1]}\n")
            self._log.flush()
