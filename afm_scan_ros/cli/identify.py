"""``afm-scan identify``: a model of the scanner from its records."""

import json
from pathlib import Path

import click
from attrs import evolve

from afm_scan_ros import identification as api
from afm_scan_ros.cli import options
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.coupled_scanner import CoupledScanner
from afm_scan_ros.core.effects.registry import FEEDBACK_EFFECTS
from afm_scan_ros.core.identification.identify import FittedAxis, Identification
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.paths import write_text
from afm_scan_ros.report.fit_page import finding_text, fit_report, fit_summary
from afm_scan_ros.report.sentences import (
    intervals_text,
    status_text,
    unknown_effects,
)
from afm_scan_ros.report.terminal import say

HEADING = "A scanner's model, written by 'afm-scan identify' from its calibration records."


@click.command()
@click.argument("records", type=options.RECORD, nargs=-1, metavar="[RECORD]...")
@click.option("--creep", type=options.RECORD, help="Record of steps that are held.")
@click.option("--frequency", type=options.RECORD, help="Record of multisines or of a sweep.")
@click.option("--hysteresis", type=options.RECORD, help="Record of reversal curves or of loops.")
@click.option(
    "--validation",
    type=options.RECORD,
    help="Record held out of the fit, which gives the model discrepancy.",
)
@options.record_options
@click.option(
    "--effect",
    "effects",
    type=click.Choice([effect.name for effect in FEEDBACK_EFFECTS]),
    multiple=True,
    help="Effect in the feedback of coupled axes; may be given several times.",
)
@click.option(
    "--states",
    type=click.IntRange(min=2),
    help="States of the vibration of coupled axes. By default held-out records choose them.",
)
@click.option(
    "--linear",
    is_flag=True,
    help="The scanner has no hysteresis: fit its vibration and creep alone.",
)
@click.option(
    "--out",
    type=options.NEW_FILE,
    default="model.yaml",
    show_default=True,
    help="Model file to write. Its arrays, MODEL.fit.json and MODEL.fit.html are written beside it."
    " Records of one axis give a model of that axis.",
)
@options.FIGURES
def identify(
    records: tuple[Path, ...],
    effects: tuple[str, ...],
    states: int | None,
    out: Path,
    tables: options.TableOptions,
    *,
    linear: bool,
    figures: str | None,
    **bags: Path | None,
) -> None:
    """Identify a model from RECORDs of any kinds, and report how well it fits.

    All are fitted at once. An option only names a record; --validation keeps one out of the fit.
    """
    written = (out.suffix, ".npz", ".fit.json", ".fit.html")
    options.refuse_existing(*map(out.with_suffix, written), other="file")
    given = [tables.read(path) for path in records]
    given += [evolve(tables.read(bag), kind=kind) for kind, bag in bags.items() if bag]
    if not given:
        raise click.UsageError("give at least one RECORD, as a bag of 'afm-scan calibrate'")
    with working("identifying", at_once=False) as progress:
        model = api.identify(given, progress, effects=effects, states=states, linear=linear)
        model.save(out, HEADING)
        if not model.is_coupled:
            progress("writing the report")
            _report(model.fit, out, figures)
    if model.is_coupled:
        _show_coupled(model.coupled)
        say(f"Wrote {out} and {out.with_suffix('.npz').name} beside it.")
        return
    for axis, fitted in model.fit.axes.items():
        _show_axis(axis, fitted)
    of = "" if len(model.axes) == len(AXES) else f" of {model.axes[0]} alone"
    say(f"Wrote {out}{of}, {out.with_suffix('.npz').name} and the fit report beside it.")


def _report(found: Identification, out: Path, figures: str | None) -> None:
    """Write the fit report beside the model file."""
    summary = json.dumps(fit_summary(found), indent=2, allow_nan=False)
    write_text(out.with_suffix(".fit.json"), summary + "\n")
    fit_report(found, out).write(out.with_suffix(".fit.html"), figures)


def _show_coupled(found: CoupledScanner) -> None:
    """Show the errors of a model of coupled axes on held-out records."""
    say(f"{', '.join(found.axes)}: coupled vibration, {found.linear.order} states")
    for error in found.errors:
        say(
            f"   driven by {error.drive_rms:.3g} V rms, held-out record:"
            f" {1e9 * error.error_rms:.1f} nm rms, {error.relative:.2%} of the displacement's"
        )


def _show_axis(axis: str, found: FittedAxis) -> None:
    for effect, status in found.model.effects.each():
        known = filter(None, (status_text(status), intervals_text(status)))
        say(f"{axis}: {effect}: {'; '.join(known)}")
    say(
        f"   hysteresis by {found.operator}; a scan is predicted to {100.0 * found.deviation:.2g}%"
        " of its range (standard deviation)"
    )
    for record in found.records:
        say(f"   {record.name}, left by the model: {_text(record.misfit, 1e9, 'nm')}")
        if record.fitted_otherwise:
            say(f"   {record.name}, left by the fit: {_text(record.by_fit, 1e9, 'nm')}")
    for one in found.validations:
        say(f"   {one.record}, held out: {_text(one.misfit, 1e9, 'nm')}")
    say(f"   direct inverse of the hysteresis: {_text(found.direct, 1e3, 'mV')}")
    warnings = map(finding_text, found.warnings)
    for sentence in (*unknown_effects({axis: found.model.effects}), *warnings):
        say(f"   warning: {sentence}", err=True)


def _text(misfit: Misfit, scale: float, unit: str) -> str:
    return f"sigma {scale * misfit.sigma:.3g} {unit}, max {scale * misfit.maximum:.3g} {unit}"
