"""``afm-scan grating``: the model of a scanner without a sensor, from images of a grating."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import click
from attrs import evolve

from afm_scan_ros.cli.options import (
    FIGURES,
    FILE,
    FOLDER,
    NEW_FILE,
    positive,
    refuse_existing,
    warn,
)
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import BaseEffects
from afm_scan_ros.features.images.files.channels import image_channels, words_of
from afm_scan_ros.features.images.files.formats import WRITTEN, read_image, write_image
from afm_scan_ros.features.images.identify import ACCURACY, correct_image, identify_from_images
from afm_scan_ros.features.images.report import (
    correction_picture,
    grating_report,
    grating_table,
    left_out,
    not_separated,
)
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.report.page import CommandLine
from afm_scan_ros.report.paper import paper_figure, save
from afm_scan_ros.report.sentences import intervals_text, status_text
from afm_scan_ros.report.terminal import say

PER_MICROMETRE = 1e6
SUFFIX = ".gwy"


@click.command()
@click.argument("images", nargs=-1, required=True, type=FILE, metavar="IMAGE...")
@click.option(
    "--pitch",
    type=positive("m"),
    required=True,
    help="Pitch of the grating, as 10um. Of a chessboard, that along a row.",
)
@click.option("--out", type=NEW_FILE, required=True, help="Model file to write.")
@click.option(
    "--correct",
    type=FILE,
    multiple=True,
    metavar="IMAGE",
    help="Another image of this scanner, to be corrected by the model. May be repeated.",
)
@click.option(
    "--images",
    "folder",
    type=FOLDER,
    help="Folder for the corrected images (.gwy and .png), the table as JSON and its picture.",
)
@click.option(
    "--volts-per-um",
    "scale",
    type=click.FloatRange(0.0, min_open=True),
    help="Drive over commanded position, V/µm. Without it, 1 V stands for 1 µm commanded.",
)
@click.option(
    "--accuracy",
    type=click.FloatRange(0.0, min_open=True),
    default=float(f"{100.0 * ACCURACY:g}"),
    show_default=True,
    help="Accuracy of the pitch that an image must reach, % rms.",
)
@click.option(
    "--line-time",
    type=positive("s"),
    help="Time of trace and retrace together, for files that do not state it.",
)
@click.option("--report", type=NEW_FILE, help="Write a report as one HTML file.")
@FIGURES
def grating(  # noqa: PLR0913, PLR0917 - click hands over one parameter an option
    images: tuple[Path, ...],
    pitch: float,
    out: Path,
    correct: tuple[Path, ...],
    folder: Path | None,
    scale: float | None,
    accuracy: float,
    line_time: float | None,
    report: Path | None,
    figures: str | None,
) -> None:
    """Identify a scanner without a displacement sensor from images of a grating of known pitch.

    Each IMAGE holds trace and retrace of a scan that nothing corrected. The model of x has gain
    and hysteresis. From images of several line rates it has creep, and a resonance or a lag, too.
    The model of y is a gain. The corrected images show the heights where the scanner was.
    """
    if correct and folder is None:
        raise click.UsageError("--correct needs a folder for the corrected images: give --images")
    if figures is not None and report is None:
        raise click.UsageError("--figures are written beside a report: give --report")
    refuse_existing(out, other="file")
    if folder is not None:
        refuse_existing(folder)
        targets = _targets(folder, (*images, *correct))

    given, others = ([_timed(path, line_time) for path in paths] for paths in (images, correct))
    volts_per_metre = PER_MICROMETRE * (scale or 1.0)
    with working("grating", at_once=False) as progress:
        found = identify_from_images(given, pitch, volts_per_metre, progress, 0.01 * accuracy)
    found.model.save(out)
    table = grating_table(found)
    table.show()
    known = list(_known(found.model.effects["x"], "µm commanded" if scale is None else "V"))
    known += left_out(found)
    advice = [*not_separated(found), *(f"Not used: {each}." for each in found.refused)]
    for sentence in (*known, *advice):
        say(sentence)
    coupled = ", with half the angle in each axis" if found.model.scanner.axis("x").added else ""
    held = f"x with what is identified above, and y as a gain{coupled}"
    say(f"{out} holds the model: {held}.")
    if report is not None:
        options = {
            "--volts-per-um": scale and f"{scale:g}",
            "--accuracy": f"{accuracy:g}",
            "--line-time": line_time and f"{line_time:g}s",
        }
        again = correction_of_another(images, pitch, out, options)
        with working("writing the report", at_once=False):
            grating_report(found, table, known, [*advice, again]).write(report, figures)
    if folder is not None:
        table.save(folder)
        with working("writing the images", at_once=False):
            for image, better in zip(found.images, found.corrected, strict=True):
                _write_corrected(targets[given.index(image)], image, better)
            for target, image in zip(targets[len(given) :], others, strict=True):
                _write_corrected(target, image, correct_image(found.model, image, volts_per_metre))
        say(f"{folder} holds the corrected images, their pictures and the table.")


def correction_of_another(
    images: Sequence[Path], pitch: float, out: Path, options: Mapping[str, str | float | None]
) -> CommandLine:
    """Return the same command, for another image and with other results."""
    given = [word for name, value in options.items() if value for word in (name, value)]
    model, folder = (out.with_name(f"{out.stem}_{name}") for name in (f"2{out.suffix}", "images"))
    written = ["--out", model, "--images", folder]
    return CommandLine(
        "Correct another image of this scanner. Add its file as --correct.",
        ["grating", *images, "--pitch", f"{PER_MICROMETRE * pitch:g}um", *given, *written],
    )


def _known(effects: BaseEffects, drive: str) -> Iterator[str]:
    """Say what is known of each effect, over a drive in a unit."""
    for name, status in effects.each():
        known = filter(None, (status_text(status, drive), intervals_text(status)))
        yield f"x: {name} is {': '.join(known)}."


def _timed(path: Path, line_time: float | None) -> ScanImage:
    """Read an image, and warn of what it assumes; ``line_time`` (s) is for a file without one."""
    found = read_image(path)
    warn(found.assumptions)
    if line_time is None:
        return found
    if found.line_time is not None:
        raise InputError(f"{path} states {found.line_time:.4g} s for a line: leave --line-time out")
    return evolve(found, line_time=line_time)


def _targets(folder: Path, images: Sequence[Path]) -> list[Path]:
    """Return the file of each corrected image.

    Raises InputError where two images have the same name, or where no such file can be written.
    """
    targets = [folder / f"{path.stem}.corrected{SUFFIX}" for path in images]
    for number, target in enumerate(targets):
        WRITTEN[SUFFIX].load(target, "write")
        if target in targets[:number]:
            raise InputError(f"{images[number]}: another image has this name too: rename one")
    return targets


def _write_corrected(target: Path, image: ScanImage, corrected: ScanImage | None) -> None:
    """Write a corrected image, if there is one, and a picture of it beside the recorded one."""
    name = Path(image.name).name
    if corrected is None:
        say(f"{name} is not corrected: the scanner turned back within a line.")
        return
    write_image(target, image_channels(corrected), words_of(corrected))
    save(paper_figure(correction_picture(image, corrected)), target.with_suffix(".png"))
