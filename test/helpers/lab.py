"""A lab's own program: it outputs each drive that comes into a folder, and leaves the record."""

import sys
import time
from pathlib import Path

import numpy as np

from afm_scan_ros.core.types import Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.scanner import Piezoscanner

METRES_PER_VOLT = 2.0**-17
"""Of the sensor: a power of two, so that volts become metres exactly."""


def move(path: Path) -> None:
    """Drive the simulated scanner, and write its readings (V); each record has its own noise."""
    times, x, y = np.loadtxt(path, delimiter=",", skiprows=1).T
    period = times[1] - times[0]
    plant = load_plant(share_directory() / "config/plant.yaml")
    seed = 1 + len([*path.parent.glob("*.measured.csv")])
    measured, _ = Piezoscanner(plant, period, seed).advance(Trace(0, period, x.copy(), y.copy()))
    rows = np.column_stack([times, measured.x / METRES_PER_VOLT, measured.y / METRES_PER_VOLT])
    partial = path.with_suffix(".writing")
    heading = "time_s,sensor_x_v,sensor_y_v"
    np.savetxt(partial, rows, fmt="%.17g", delimiter=",", header=heading, comments="")
    partial.rename(path.with_suffix(".measured.csv"))


def main(folder: Path) -> None:
    """Watch a folder until killed."""
    while True:
        for path in folder.glob("*.csv"):
            if not (
                path.name.endswith(".measured.csv") or path.with_suffix(".measured.csv").exists()
            ):
                move(path)
        time.sleep(0.1)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
