"""``afm-scan identify``: a model of the scanner from its calibration bags."""

import json
from pathlib import Path

import click

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.order_option import OrderCommand, order_option
from afm_scan_ros.cli.working import working
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.alternating import Sizes
from afm_scan_ros.core.identification.drives.experiments import SWEEPS
from afm_scan_ros.core.identification.hysteresis.everett_fit import LEVELS
from afm_scan_ros.core.identification.identify import Identification
from afm_scan_ros.core.identification.identify import identify as identify_scanner
from afm_scan_ros.core.identification.records.recording import CalibrationRecord, Misfit, kind_of
from afm_scan_ros.core.identification.vibration.rational_form import Order
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.model_file import save_model
from afm_scan_ros.report.fit_page import fit_page
from afm_scan_ros.report.fit_summary import fit_summary

BAG = click.Path(exists=True, path_type=Path)
HEADING = "A scanner's model, written by 'afm-scan identify' from its calibration records."


@click.command(cls=OrderCommand)
@click.option("--creep", type=BAG, required=True, help="Bag of the creep record.")
@click.option("--frequency", type=BAG, required=True, help="Bag of multisines or of a sweep.")
@click.option("--hysteresis", type=BAG, required=True, help="Bag of the hysteresis record.")
@click.option(
    "--validation", type=BAG, help="Bag of the validation record, for the model discrepancy."
)
@order_option
@click.option(
    "--levels",
    type=click.IntRange(min=3),
    default=LEVELS,
    show_default=True,
    help="Levels of the Everett surfaces along either side.",
)
@click.option("--delay", is_flag=True, help="Take the record's delay for the vibration's own.")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    default="model.yaml",
    show_default=True,
    help="Model file to write; its arrays, MODEL.fit.json and MODEL.fit.html go beside it. Records"
    " of one axis give its report alone.",
)
def identify(
    order: Order | None, levels: int, out: Path, *, delay: bool, **bags: Path | None
) -> None:
    """Turn the bags of 'afm-scan calibrate' into a model, and report how well it fits."""
    _refuse_written(out)
    with working("identifying the scanner", at_once=False) as told:
        records = {kind: read_record(bag, kind) for kind, bag in bags.items() if bag is not None}
        found = identify_scanner(**records, sizes=Sizes(levels, order, delay), progress=told)
        told("writing the fit report")
        out.parent.mkdir(parents=True, exist_ok=True)
        summary = json.dumps(fit_summary(found), indent=2, allow_nan=False)
        out.with_suffix(".fit.json").write_text(summary + "\n", "utf-8")
        out.with_suffix(".fit.html").write_text(fit_page(found), "utf-8")
    _show(found)
    if len(found.axes) == len(AXES):
        save_model(out, found.model, HEADING)
        click.echo(f"wrote {out}, {out.with_suffix('.npz').name} and the fit report beside it")
    else:
        one = ", ".join(found.axes)
        click.echo(f"wrote the fit report of {one} alone; a model file needs records of both axes")


def _refuse_written(out: Path) -> None:
    """Raise InputError where one of the files to write is there already."""
    for suffix in (out.suffix, ".npz", ".fit.json", ".fit.html"):
        if (written := out.with_suffix(suffix)).exists():
            raise InputError(f"{written} exists already: give another file or remove it")


def read_record(path: Path, kind: str) -> CalibrationRecord:
    """Read a calibration record of a kind from its bag; a sine sweep is a frequency record too.

    Raises InputError where it is another kind, was not recorded to its end, or was sampled at
    another instant than just before the converter's update, which the models assume.
    """
    bag = read_scan(path)
    alike = (kind, *SWEEPS) if kind == "frequency" else (kind,)
    held = (AXES, *((axis,) for axis in AXES))
    axes = {kind_of(name, of): of for name in alike for of in held}
    if bag.info.pattern not in axes:
        raise InputError(f"{path}: holds a '{bag.info.pattern}' record; give one of kind '{kind}'")
    if bag.info.sampling_instant != "before_update" or bag.info.trigger_offset != 0.0:
        raise InputError(
            f"{path}: sampled {bag.info.sampling_instant} with a trigger offset of"
            f" {bag.info.trigger_offset:g} s; sample just before the converter's update"
        )
    drive, displacement = bag.whole("drive_voltage"), bag.whole("achieved_displacement")
    missing = bag.info.total_samples - min(drive.x.size, displacement.x.size)
    if missing:
        mend = "; ".join((*bag.warnings, "record it again"))
        raise InputError(f"{path}: the last {missing} samples are missing; {mend}")
    for warning in bag.warnings:
        click.echo(f"warning: {warning}", err=True)
    return CalibrationRecord(f"{kind} in {path}", drive, displacement, axes[bag.info.pattern])


def _show(found: Identification) -> None:
    for axis, identified in found.axes.items():
        report = identified.report
        creep, fit = report.creep, report.vibration
        click.echo(f"{axis}: creep, {creep.order} elements: {_text(creep.held_out, 1e9, 'nm')}")
        click.echo(
            f"   vibration, {fit.order}: {fit.resonance:.2f} Hz, damping {fit.damping:.5f},"
            f" misses the response by {fit.misfit:.2%} rms"
        )
        click.echo(f"   hysteresis, fresh loops, exact inverse: {_text(report.exact, 1e3, 'mV')}")
        click.echo(f"   hysteresis, fresh loops, direct inverse: {_text(report.direct, 1e3, 'mV')}")
        for warning in report.warnings:
            click.echo(f"   warning: {warning}", err=True)


def _text(misfit: Misfit, scale: float, unit: str) -> str:
    return f"sigma {scale * misfit.sigma:.1f} {unit}, max {scale * misfit.maximum:.1f} {unit}"
