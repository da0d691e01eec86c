"""Drives the scanner of the option --scanner through plans, and records each in a bag."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from attrs import evolve, frozen

from afm_scan_ros.cli.exchange import exchange_of, record_by_files
from afm_scan_ros.cli.options import refuse_existing
from afm_scan_ros.cli.processes import NodeCommand, pace, run_nodes, set_aside
from afm_scan_ros.cli.progress import watching
from afm_scan_ros.cli.scanner import (
    PLANT,
    SIM,
    ScannerChoice,
    amplifier_of,
    choose,
    pace_of,
)
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.drives.excitation import Plan, excitation_block
from afm_scan_ros.core.identification.drives.waveforms import Waveform
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.drive_files import save_drive


@frozen
class DrivenScanner:
    """A scanner as the commands' options name it; ``plant``, ``seed``, ``age`` are of the ``sim``.

    ``time_scale`` is 1 for real time; None is the scanner's own. ``age`` (s) is the time since it
    was switched on.
    """

    scanner: str = SIM
    plant: Path = PLANT
    seed: int = 1
    time_scale: float | None = None
    age: float = 0.0

    @property
    def limits(self) -> DriveLimits | None:
        """Limits of its amplifier; None for an external one, which does not state them."""
        amplifier = amplifier_of(self.scanner, self.plant)
        return None if amplifier is None else amplifier.limits

    def record(self, plan: Plan[Waveform], bag: Path, title: str) -> None:
        """Drive the scanner through a plan, and record it in a bag.

        Raises InputError before it begins, ScanError where the record stays incomplete.
        """
        if exchange := exchange_of(self.scanner):
            record_by_files(exchange, plan, bag)
            return
        chosen = choose(self.scanner, self.plant)
        if chosen.limits is not None:
            drive = excitation_block(plan, 0, plan.total_samples)
            chosen.limits.refuse_beyond(drive, dict.fromkeys(AXES, 0.0))
        with TemporaryDirectory() as folder, watching(f"{title}, to {bag}") as idle:
            commands = self._commands(chosen, save_drive(Path(folder), plan), bag)
            run_nodes(commands, idle, [chosen.node])

    def _commands(self, chosen: ScannerChoice, drive_file: Path, bag: Path) -> list[NodeCommand]:
        time_scale = pace_of(self.scanner) if self.time_scale is None else self.time_scale
        paced = pace(time_scale)
        simulated = {"seed": self.seed, "age_s": self.age}
        own: Mapping[str, object] = simulated if self.scanner == SIM else {}
        drive = {
            "drive_file": str(drive_file),
            "required_nodes": [chosen.node, "scan_recorder"],
            "time_scale": time_scale,
            **chosen.source,
        }
        return [
            NodeCommand("scan_recorder", {"bag": str(bag), "topics": chosen.topics, **paced}),
            *(evolve(c, parameters={**c.parameters, **own, **paced}) for c in chosen.commands),
            NodeCommand("excitation_generator", {**drive, **paced}),
        ]


def run_calibration(scanner: DrivenScanner, out: Path, plans: Iterable[Plan[Waveform]]) -> None:
    """Record each plan, as ``creep``, in a bag of its name in ``out``.

    Raises InputError before the first begins, ScanError where one stays incomplete; all bags are
    then set aside.
    """
    bags = {out / plan.name: plan for plan in plans}
    refuse_existing(*bags)
    out.mkdir(parents=True, exist_ok=True)
    try:
        for number, (bag, plan) in enumerate(bags.items(), 1):
            scanner.record(plan, bag, f"{plan.name} record, {number} of {len(bags)}")
    except (InputError, ScanError) as error:
        raise type(error)(f"{error}{set_aside(bags)}") from error
    except KeyboardInterrupt:
        set_aside(bags)
        raise
