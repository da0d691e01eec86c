"""Arrays for ten_lines.py, simulated: ``python examples/simulated_arrays.py arrays.npz``.

A scanner is driven through four short records and then, once it has begun to drift, through a
scan. Of each the axis x is kept: its drive (V) and its measured displacement (m).
"""

import sys

import numpy as np

import afm_scan_ros as afm
from afm_scan_ros.core.identification.drives import excitation
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.scanner import Piezoscanner

config = share_directory() / "config"
plans = {
    "creep": excitation.creep_plan(holds=(300.0, 120.0)),
    "frequency": excitation.frequency_plan(),
    "hysteresis": excitation.hysteresis_plan(),
    "validation": excitation.validation_plan(),
}
drives = {n: excitation.excitation_block(p, 0, p.total_samples) for n, p in plans.items()}
spec = afm.ScanSpec(range_x=20e-6, lines=3, samples_per_line=2000)
scanned = afm.load_model().invert(afm.trajectory(spec), spec.sample_period)
drives["scan"] = Trace(0, spec.sample_period, scanned[:, 0], scanned[:, 1])
arrays = {}
for name, drive in drives.items():
    file = config / ("plants/drift_large.yaml" if name == "scan" else "plant.yaml")
    scanner = Piezoscanner(load_plant(file), drive.sample_period, seed=1)
    arrays[f"{name}_period"], arrays[f"{name}_drive"] = np.array(drive.sample_period), drive.x
    arrays[f"{name}_displacement"] = scanner.advance(drive)[0].x
np.savez(sys.argv[1], **arrays)
