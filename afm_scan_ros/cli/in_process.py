"""Calibration within one process: the simulated scanner driven without nodes."""

from afm_scan_ros.core.identification.excitation import PLANS, Plan, excitation_block
from afm_scan_ros.core.identification.recording import Recording
from afm_scan_ros.simulation.scanner import Piezoscanner
from afm_scan_ros.simulation.spec import PlantSpec


def calibrate_in_process(plant: PlantSpec, seed: int) -> dict[str, Recording]:
    """Drive a scanner fresh from rest through each plan; the records by the plans' names."""
    return {name: record(plan(), plant, seed) for name, plan in PLANS.items()}


def record(plan: Plan, plant: PlantSpec, seed: int) -> Recording:
    """Drive a scanner fresh from rest through one plan."""
    scanner = Piezoscanner(plant, plan.sample_period, seed)
    drive = excitation_block(plan, 0, plan.total_samples)
    measured, _ = scanner.advance(drive)
    return Recording(plan.name, drive, measured)
