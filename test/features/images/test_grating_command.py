"""``afm-scan grating`` on real images of Nanosurf AG (NSFopen, MIT), and on what is no grating."""

import itertools
import json
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.cli.main import cli, main
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.files.formats import read_image
from afm_scan_ros.features.images.grating.features import levelled
from afm_scan_ros.features.images.grating_command import correction_of_another
from afm_scan_ros.model import load_model
from helpers.given_commands import refuse_unknown

PACKAGE = find_spec("NSFopen")
FOLDER = Path(PACKAGE.origin or "").parent / "example/Plane_Removal" if PACKAGE else Path()
NEEDED = pytest.mark.skipif(PACKAGE is None, reason="NSFopen, which holds the images, is missing")
PARTS = 5
"""Parts of an image in each direction, in which trace and retrace are compared."""


def apart(path: Path) -> float:
    """Rms shift of retrace from trace along the lines, in pixels, by the best correlation."""
    image = read_image(path)
    assert image.retrace is not None
    trace, retrace = levelled(image.trace), levelled(np.asarray(image.retrace))
    reach = 9
    edges = np.linspace(reach + 1, image.pixels - reach - 1, PARTS + 1).astype(int)
    rows = np.linspace(0, image.lines, PARTS + 1).astype(int)
    found = [
        shift(trace[a:b], retrace[a:b], left, right, reach)
        for a, b in itertools.pairwise(rows)
        for left, right in itertools.pairwise(edges)
    ]
    return float(np.sqrt(np.mean(np.square(found))))


def shift(one: Array, other: Array, left: int, right: int, reach: int) -> float:
    """Shift of the best correlation, between the pixels."""
    steps = np.arange(-reach, reach + 1)
    here = one[:, left:right].ravel()
    likeness = np.array(
        [np.corrcoef(here, other[:, left + d : right + d].ravel())[0, 1] for d in steps]
    )
    k = int(np.clip(likeness.argmax(), 1, len(steps) - 2))
    before, at, after = likeness[k - 1 : k + 2]
    return float(steps[k] + 0.5 * (before - after) / (before - 2.0 * at + after))


def test_the_command_that_corrects_another_image_can_be_given() -> None:
    given = {"--volts-per-um": None, "--accuracy": "2", "--line-time": "1.5s"}
    command = correction_of_another([Path("a b.nid")], 1e-5, Path("out/model.yaml"), given)
    assert command.line == (
        "afm-scan grating 'a b.nid' --pitch 10um --accuracy 2 --line-time 1.5s"
        " --out out/model_2.yaml --images out/model_images"
    )
    refuse_unknown(command.line)


@pytest.mark.evidence
@NEEDED
def test_a_real_image_is_corrected_and_its_model_corrects_another(tmp_path: Path) -> None:
    """Both images are of one scanner at one rate; the second one taught nothing."""
    taught, other = FOLDER / "circles.nid", FOLDER / "squares_holes.nid"
    arguments = ["grating", str(taught), "--pitch", "10um", "--out", str(tmp_path / "model.yaml")]
    arguments += ["--correct", str(other), "--images", str(tmp_path / "images")]
    result = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert apart(taught) > 4.5
    assert apart(tmp_path / "images/circles.corrected.gwy") <= 0.5
    assert apart(other) > 4.5
    assert apart(tmp_path / "images/squares_holes.corrected.gwy") <= 0.7
    model = load_model(tmp_path / "model.yaml")
    assert model.effects["x"].hysteresis.status.value == "identified"
    assert model.effects["y"].hysteresis.status.value == "unknown"
    rows = json.loads((tmp_path / "images/grating.json").read_text("utf-8"))["rows"]
    figures = {(row["axis"], row["figure"]): row for row in rows}
    assert all(row["lower"] <= row["value"] <= row["upper"] for row in rows)
    assert figures["x", "scale"]["value"] == pytest.approx(0.986, abs=0.003)
    assert figures["x", "loop width"]["lower"] > 0.0
    assert figures["x", "uncertainty of the pitch"]["value"] < 0.3
    assert "Record one downwards" in result.output
    assert "Record the same image at 2.5 Hz" in result.output
    pictures = {path.name for path in (tmp_path / "images").glob("*.png")}
    assert pictures == {"grating.png", "circles.corrected.png", "squares_holes.corrected.png"}


def test_images_of_one_name_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    pytest.importorskip("gwyfile")
    words = ["grating", "one/a.npz", "--pitch", "1um", "--out", str(tmp_path / "m.yaml")]
    words += ["--correct", "other/a.npz", "--images", str(tmp_path / "images")]
    with pytest.raises(InputError, match=r"^other/a.npz: another image has this name"):
        CliRunner().invoke(cli, words, catch_exceptions=False)


def test_a_message_on_an_option_ends_in_a_full_stop(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["afm-scan", "grating", "a.npz", "--pitch", "10"])
    with pytest.raises(SystemExit, match="2"):
        main()
    said = capsys.readouterr().err
    assert re.search(
        r"'10' is not a number with a unit: .*[^.]\. See 'afm-scan grating --help'", said
    )
    monkeypatch.setattr(sys, "argv", ["afm-scan", "grating", "--pitch", "1um"])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert "Missing argument 'IMAGE...'. See" in capsys.readouterr().err


@NEEDED
@pytest.mark.parametrize("pitch", ["14.14um", "20um", "30um"])
def test_a_pitch_that_is_not_the_grating_s_own_is_refused(pitch: str, tmp_path: Path) -> None:
    arguments = ["grating", str(FOLDER / "circles.nid"), "--pitch", pitch]
    said = rf"circles.nid: the grating repeats every 10\.\d µm .* 50 by 50 µm.*{pitch[:-2]} µm"
    with pytest.raises(InputError, match=said):
        CliRunner().invoke(
            cli, [*arguments, "--out", str(tmp_path / "m.yaml")], catch_exceptions=False
        )
    assert not (tmp_path / "m.yaml").exists()


@pytest.mark.evidence
def test_a_failure_of_another_image_keeps_the_model(tmp_path: Path) -> None:
    """The image to correct is larger than the one that identified the model."""
    pytest.importorskip("gwyfile")
    x, y = np.meshgrid(*2 * [np.linspace(-18e-6, 18e-6, 96)])
    heights = 50e-9 * sum(
        np.cos(2e6 * np.pi * each / 6.0) ** 3 for each in (x + 0.1 * y, y - 0.1 * x)
    )
    for name, size in (("taught", 40e-6), ("larger", 80e-6)):
        sides = {"trace": heights, "retrace": heights, "range_x": size, "range_y": size}
        np.savez(tmp_path / f"{name}.npz", line_time=1.0, **sides)
    words = ["grating", str(tmp_path / "taught.npz"), "--pitch", "5.97um"]
    words += ["--out", str(tmp_path / "model.yaml"), "--images", str(tmp_path / "images")]
    words += ["--correct", str(tmp_path / "larger.npz")]
    result = CliRunner().invoke(cli, words)
    assert isinstance(result.exception, InputError)
    assert "larger.npz: its drive reaches" in str(result.exception)
    assert load_model(tmp_path / "model.yaml").effects["x"].hysteresis.status.value == "identified"
    assert (tmp_path / "images/taught.corrected.gwy").exists()
    assert re.search(r"identified, -[\d.]+ to [\d.]+ µm commanded, 1 Hz", result.output)


@NEEDED
def test_an_image_of_lines_is_refused(tmp_path: Path) -> None:
    arguments = ["grating", str(FOLDER / "grid.nid"), "--pitch", "300nm"]
    with pytest.raises(InputError, match=r"^\S*grid.nid: no lattice of two directions"):
        CliRunner().invoke(
            cli, [*arguments, "--out", str(tmp_path / "m.yaml")], catch_exceptions=False
        )
    assert not (tmp_path / "m.yaml").exists()


@pytest.mark.parametrize("option", [[], ["--correct"]])
def test_a_damaged_image_is_named_with_its_damage_and_nothing_is_written(
    tmp_path: Path, option: list[str]
) -> None:
    pytest.importorskip("gwyfile")
    for name, seed in (("whole", 1), ("cut", 2)):
        heights = 1e-9 * np.random.default_rng(seed).standard_normal((2, 16, 16))
        sides = {"trace": heights[0], "retrace": heights[1]}
        np.savez(tmp_path / f"{name}.npz", line_time=1.0, range_x=1e-5, range_y=1e-5, **sides)
    cut = tmp_path / "cut.npz"
    cut.write_bytes(cut.read_bytes()[:-100])
    words = ["grating", str(tmp_path / "whole.npz"), *option, str(cut), "--pitch", "1um"]
    words += ["--out", str(tmp_path / "out/m.yaml"), "--images", str(tmp_path / "out/images")]
    with pytest.raises(InputError, match=rf"^{cut}: .* damaged or cut short"):
        CliRunner().invoke(cli, words, catch_exceptions=False)
    assert not (tmp_path / "out").exists()


def test_a_trace_alone_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "trace.npz"
    np.savez(path, trace=np.zeros((16, 16)), range_x=1e-5, range_y=1e-5, line_time=1.0)
    with pytest.raises(InputError, match="retrace"):
        CliRunner().invoke(
            cli,
            ["grating", str(path), "--pitch", "1um", "--out", str(tmp_path / "m.yaml")],
            catch_exceptions=False,
        )


def test_a_time_beside_that_of_the_file_is_refused(tmp_path: Path) -> None:
    path, flat = tmp_path / "timed.npz", np.zeros((16, 16))
    np.savez(path, trace=flat, retrace=flat, range_x=1e-5, range_y=1e-5, line_time=4.0)
    arguments = ["grating", str(path), "--pitch", "1um", "--line-time", "10ms"]
    with pytest.raises(InputError, match=r"timed.npz states 4 s for a line: leave --line-time out"):
        CliRunner().invoke(
            cli, [*arguments, "--out", str(tmp_path / "m.yaml")], catch_exceptions=False
        )


def test_another_image_needs_a_folder(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    result = CliRunner().invoke(
        cli,
        ["grating", str(path), "--pitch", "1um", "--out", str(tmp_path / "m"), "--correct", "b"],
    )
    assert result.exit_code == 2
    assert "--images" in result.output
