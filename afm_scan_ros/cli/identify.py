"""``afm-scan identify``: a model of the scanner from its calibration bags."""

import json
from pathlib import Path

import click

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.order_option import OrderCommand, order_option
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import SWEEPS
from afm_scan_ros.core.identification.hysteresis.everett_fit import LEVELS
from afm_scan_ros.core.identification.identify import Identification
from afm_scan_ros.core.identification.identify import identify as identify_scanner
from afm_scan_ros.core.identification.records.recording import Misfit, Recording, kind_of
from afm_scan_ros.core.identification.turns import Sizes
from afm_scan_ros.core.identification.vibration.rational_form import Order
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.model_file import save_model
from afm_scan_ros.report.fit_page import fit_page
from afm_scan_ros.report.fit_summary import fit_summary
from afm_scan_ros.report.identification_text import finding_text

BAG = click.Path(exists=True, path_type=Path)
HEADING = "A scanner's model, written by 'afm-scan identify' from its calibration records."


@click.command(cls=OrderCommand)
@click.option("--creep", type=BAG, required=True, help="Bag of the creep record.")
@click.option("--frequency", type=BAG, required=True, help="Bag of multisines or of a sweep.")
@click.option("--hysteresis", type=BAG, required=True, help="Bag of the hysteresis record.")
@click.option(
    "--validation",
    type=BAG,
    help="Bag of the validation record, which gives the model discrepancy.",
)
@order_option
@click.option(
    "--levels",
    type=click.IntRange(min=3),
    default=LEVELS,
    show_default=True,
    help="Levels of the Everett surfaces along each side.",
)
@click.option("--delay", is_flag=True, help="Include the record's delay in the vibration model.")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    default="model.yaml",
    show_default=True,
    help="Model file to write. Its arrays, MODEL.fit.json and MODEL.fit.html are written beside it."
    " Records of one axis give its report alone.",
)
def identify(
    order: Order | None, levels: int, out: Path, *, delay: bool, **bags: Path | None
) -> None:
    """Identify a model from the bags of 'afm-scan calibrate', and report how well it fits."""
    records = {kind: read_record(bag, kind) for kind, bag in bags.items() if bag is not None}
    found = identify_scanner(**records, sizes=Sizes(levels, order, delay))
    out.parent.mkdir(parents=True, exist_ok=True)
    summary = json.dumps(fit_summary(found), indent=2, allow_nan=False)
    out.with_suffix(".fit.json").write_text(summary + "\n", "utf-8")
    out.with_suffix(".fit.html").write_text(fit_page(found), "utf-8")
    _show(found)
    if len(found.axes) == len(AXES):
        save_model(out, found.model, HEADING)
        click.echo(f"Wrote {out}, {out.with_suffix('.npz').name} and the fit report beside it.")
    else:
        one = ", ".join(found.axes)
        click.echo(f"Wrote the fit report of {one} alone. A model file needs records of both axes.")


def read_record(path: Path, kind: str) -> Recording:
    """Read a calibration record of a kind from its bag; a sine sweep is a frequency record too.

    Raises InputError where it is another kind or was not recorded to its end. The models assume
    samples just before the converter's update, so other sampling instants are refused too.
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
        fix = "; ".join((*bag.warnings, "record it again"))
        raise InputError(f"{path}: the last {missing} samples are missing; {fix}")
    for warning in bag.warnings:
        click.echo(f"warning: {warning}", err=True)
    return Recording(f"{kind} in {path}", drive, displacement, axes[bag.info.pattern])


def _show(found: Identification) -> None:
    for axis, identified in found.axes.items():
        report = identified.report
        creep, fit = report.creep, report.vibration
        click.echo(f"{axis}: creep, {creep.order} elements: {_text(creep.held_out, 1e9, 'nm')}")
        click.echo(
            f"   vibration, {fit.order}: {fit.resonance:.2f} Hz, damping {fit.damping:.5f},"
            f" model minus response {fit.misfit:.2%} rms"
        )
        click.echo(
            f"   hysteresis, held-out loops, exact inverse: {_text(report.exact, 1e3, 'mV')}"
        )
        click.echo(
            f"   hysteresis, held-out loops, direct inverse: {_text(report.direct, 1e3, 'mV')}"
        )
        for warning in report.warnings:
            click.echo(f"   warning: {finding_text(warning)}", err=True)


def _text(misfit: Misfit, scale: float, unit: str) -> str:
    return f"sigma {scale * misfit.sigma:.1f} {unit}, max {scale * misfit.maximum:.1f} {unit}"
