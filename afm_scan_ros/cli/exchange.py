"""Records and scans by files, ``--scanner files:FILE``: another program moves the scanner."""

import time
from collections.abc import Iterable
from pathlib import Path

from attrs import evolve

from afm_scan_ros.bag.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.cli.import_csv import write_record
from afm_scan_ros.cli.working import working
from afm_scan_ros.core.compensation import Compensation, preview_of
from afm_scan_ros.core.identification.drives.excitation import Plan, excitation_block
from afm_scan_ros.core.identification.drives.waveforms import Waveform
from afm_scan_ros.core.learning.correction import Correction
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.base import load_settings
from afm_scan_ros.drivers.files import FileExchange
from afm_scan_ros.files.model_file import model_hash

FILES = "files"


def exchange_of(scanner: str) -> FileExchange | None:
    """Return the exchange of ``files:FILE``, None for another scanner."""
    kind, _, file = scanner.partition(":")
    return FileExchange(load_settings(FILES, Path(file))) if kind == FILES and file else None


def record_by_files(exchange: FileExchange, plan: Plan[Waveform], bag: Path) -> None:
    """Record one drive in a bag."""
    drive = excitation_block(plan, 0, plan.total_samples)
    info = ScanInfo(bag.name, time.time_ns(), plan.name, plan.sample_period, plan.total_samples)
    _record(exchange, bag, info, {"drive_voltage": drive})


def scan_by_files(
    exchange: FileExchange,
    spec: ScanSpec,
    model: ScannerModel,
    inverses: Iterable[str],
    bag: Path,
    correction: Correction,
) -> None:
    """Record one scan in a bag, with a change of its reference."""
    inverses = tuple(sorted(inverses))
    settings = InverseSettings(preview=preview_of(model, spec.sample_period))
    limits = exchange.settings.amplifier.limits
    compensation = Compensation(model, spec.sample_period, inverses, settings, limits)
    drive = compensation.whole(correction.reference())
    target = desired(spec, 0, total_samples(spec))
    info = evolve(
        info_of_scan(spec, bag.name, time.time_ns()),
        inverses=inverses,
        model_hash=model_hash(model),
    )
    _record(exchange, bag, info, {"desired_displacement": target, "drive_voltage": drive})


def _record(exchange: FileExchange, bag: Path, info: ScanInfo, given: dict[str, Trace]) -> None:
    with working(f"record {bag.name}") as report:
        moved = exchange.displacement(bag.name, given["drive_voltage"], report)
    settings = exchange.settings
    info = evolve(
        info,
        sampling_instant=settings.sampling_instant,
        trigger_offset=settings.trigger_offset,
    )
    write_record(bag, info, {**given, "achieved_displacement": moved})
