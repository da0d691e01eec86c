"""``afm-scan plan``: the records that would identify a scanner, or that are still lacking."""

from collections.abc import Sequence
from pathlib import Path

import click
from attrs import frozen

from afm_scan_ros.bag.record import read_record
from afm_scan_ros.cli.options import FOLDER, grouped, positive, quantity
from afm_scan_ros.core.effects.scale import half_range_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives import proposal
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.drive_files import make_folder, write_drives
from afm_scan_ros.files.paths import write_text
from afm_scan_ros.report.plan_text import export_note, plan_table
from afm_scan_ros.report.terminal import say


def export(folder: Path, plans: Sequence[Plan], axes: Sequence[str]) -> None:
    """Write drives and a note on their use; report which are done.

    Raises InputError, before anything is written, where the folder cannot take them.
    """
    make_folder(folder, [plan.name for plan in plans])
    for path in write_drives(folder, plans, axes):
        say(f"wrote {path}", err=True)
    rates = [(plan.name, 1.0 / plan.sample_period) for plan in plans]
    write_text(folder / "README.md", export_note(rates, axes))


def covered(record: Path) -> proposal.Coverage:
    """Return what a record shows, all its axes together."""
    found = read_record(record)
    pairs = zip(found.drive.T, found.displacement.T, strict=True)
    return proposal.of_axes(
        [proposal.coverage(drive, moved, found.sample_period) for drive, moved in pairs]
    )


@frozen
class PlanOptions:
    """What a plan is made for, as given; ``scan_range`` in m, ``hold`` in s, ``rate`` in Hz."""

    scan_range: float | None
    limit: float | None
    lowest: float | None
    rate: float | None
    hold: float | None
    have: tuple[Path, ...]

    @property
    def covered(self) -> proposal.Coverage:
        """What the records at hand show."""
        return proposal.combined(covered(path) for path in self.have)

    def range_for(self, model: ScannerModel | None = None) -> float:
        """Return the largest scan (m), by default that of a model; raises UsageError without."""
        if self.scan_range is not None:
            return self.scan_range
        if model is None:
            raise click.UsageError("give the largest scan with --range")
        return min(2.0 * half_range_of(model.axis(name)) for name in model.axes) / proposal.MARGIN

    def converter_for(
        self, model: ScannerModel | None = None, limits: DriveLimits | None = None
    ) -> proposal.ConverterLimits:
        """Return the converter, by default with the range of a model, or else a scanner's limits.

        Raises UsageError where nothing states a limit or the rate, InputError beyond the limits.
        """
        if self.rate is None:
            raise click.UsageError("give the samples a second of the converter with --rate")
        lower, upper = self._voltages(model, limits)
        if limits is not None and max(-lower, upper) > limits.voltage:
            raise InputError(
                f"a drive of {lower:g} to {upper:g} V is beyond the scanner's limit of"
                f" {limits.voltage:g} V: give --limit and --lowest within it"
            )
        return proposal.ConverterLimits(lower, upper, self.rate)

    def _voltages(
        self, model: ScannerModel | None, limits: DriveLimits | None
    ) -> tuple[float, float]:
        lowest, limit = self.lowest, self.limit
        if limit is None and model is not None:
            ranges = [model.axis(name).hysteresis.forward.drive_range for name in model.axes]
            limit = min(upper for _, upper in ranges)
            lowest = max(lower for lower, _ in ranges) if lowest is None else lowest
        elif limit is None and limits is not None:
            limit = limits.voltage
        if limit is None:
            raise click.UsageError("give the highest drive voltage with --limit")
        return (-limit if lowest is None else lowest), limit


plan_options = grouped(
    "wanted",
    PlanOptions,
    click.option(
        "--range",
        "scan_range",
        type=positive("m"),
        help="Largest scan. It limits the drives once a record shows the gain.",
    ),
    click.option("--limit", type=positive("V"), help="Highest drive voltage."),
    click.option("--lowest", type=quantity("V"), help="Lowest drive voltage.  [default: -LIMIT]"),
    click.option("--rate", type=positive("Hz"), help="Samples a second of the converter."),
    click.option(
        "--hold",
        type=positive("s"),
        help="Add a creep record of such a hold, for time constants up to 0.57 times as long. By"
        " default creep is identified from the other records alone, up to some seconds.",
    ),
    click.option(
        "--have",
        type=click.Path(exists=True, path_type=Path),
        multiple=True,
        help="Record at hand; give one or more. What it shows is not proposed again.",
    ),
)


@click.command()
@plan_options
@click.option(
    "--axis", type=click.Choice(AXES), multiple=True, help="Only this axis.  [default: both]"
)
@click.option(
    "--export", "folder", type=FOLDER, help="Folder for the drives as CSV and npz, and plan.json."
)
def plan(wanted: PlanOptions, axis: tuple[str, ...], folder: Path | None) -> None:
    """Propose the shortest records that would identify a scanner within its converter's limits.

    Without a record of the frequency response, a survey is proposed first. Given with --have, it
    shows the resonance, from which the other records follow.
    """
    held = wanted.covered
    proposed = proposal.propose(wanted.converter_for(), wanted.hold, wanted.range_for(), held)
    if not proposed:
        say("These records suffice.")
        return
    plans = [record.plan for record in proposed]
    if folder is not None:
        make_folder(folder, [each.name for each in plans])
    table = plan_table(proposed)
    table.show()
    if held.resonance is None:
        say(
            "The resonance is unknown. Take the survey first, then run this command again with"
            " --have: it adds the records of moves between levels, to fit and to hold out."
        )
    if folder is not None:
        export(folder, plans, axis or AXES)
        table.save(folder)
