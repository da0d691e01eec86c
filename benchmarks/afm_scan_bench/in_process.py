"""Calibration within one process: the simulated scanner driven without nodes."""

from attrs import evolve

from afm_scan_ros.core.identification.drives.excitation import PLANS, Plan, excitation_block
from afm_scan_ros.core.identification.records.recording import checked
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Trace
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec


def calibrate_in_process(plant: PlantSpec, seed: int) -> dict[str, Record]:
    """Drive a scanner fresh from rest through each plan; the records by the plans' names."""
    plans = {name: plan() for name, plan in PLANS.items()}
    return {name: evolve(record(plan, plant, seed), kind=name) for name, plan in plans.items()}


def record(plan: Plan, plant: PlantSpec, seed: int) -> Record:
    """Drive a scanner fresh from rest through one plan.

    Raises InputError where that is no calibration record, as an axis at rest is none.
    """
    drive, measured = drive_through(plan, plant, seed)
    return checked(Record.of_traces(plan.name, drive, measured, start="depolarised"))


def drive_through(plan: Plan, plant: PlantSpec, seed: int) -> tuple[Trace, Trace]:
    """Drive (V) and measured displacement (m) of a scanner fresh from rest."""
    scanner = Piezoscanner(plant, plan.sample_period, seed)
    drive = excitation_block(plan, 0, plan.total_samples)
    measured, _ = scanner.advance(drive)
    return drive, measured
