"""``afm-scan identify`` refuses bags that are not the records that it needs."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from click.testing import CliRunner

import afm_scan_ros as afm
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli.identify import identify
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.identify import Identification
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from helpers.fit_cases import OPERATORS, levels, record

INFO = ScanInfo("one", 0, "creep", 1e-3, 100)
RAMP = np.linspace(0.0, 1.0, 100)


def write(folder: Path, info: ScanInfo, samples: int = 100) -> Path:
    ramp = RAMP[:samples]
    with ScanWriter(folder, info) as bag:
        bag.add("drive_voltage", Trace(0, 1e-3, ramp, ramp))
        bag.add("achieved_displacement", Trace(0, 1e-3, 5e-6 * ramp, 5e-6 * ramp))
    return folder


def test_record_is_read_back(tmp_path: Path) -> None:
    record = afm.read_record(write(tmp_path / "bag", INFO))
    np.testing.assert_array_equal(record.drive, np.column_stack((RAMP, RAMP)))
    assert record.sample_period == INFO.sample_period


def test_a_record_of_any_kind_may_be_held_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An option names a record, whatever its bag says that it was made for."""
    seen: list[tuple[str | None, str]] = []

    def note(records: list[afm.Record], *_: object, **__: object) -> None:
        seen.extend((each.kind, Path(each.name).name) for each in records)
        raise InputError("seen")

    monkeypatch.setattr("afm_scan_ros.identification.identify", note)
    bags = [write(tmp_path / name, INFO) for name in ("fitted", "held_out")]
    words = ["--frequency", str(bags[0]), "--validation", str(bags[1])]
    with pytest.raises(InputError, match="seen"):
        identify.main([*words, "--out", str(tmp_path / "model.yaml")], standalone_mode=False)
    assert seen == [("frequency", "fitted"), ("validation", "held_out")]


def test_a_sample_just_after_the_update_is_one_just_before(tmp_path: Path) -> None:
    before = afm.read_record(write(tmp_path / "before", INFO))
    info = evolve(INFO, sampling_instant="after_update")
    after = afm.read_record(write(tmp_path / "after", info))
    np.testing.assert_array_equal(after.drive, before.drive)
    np.testing.assert_array_equal(after.displacement, before.displacement)


def test_a_sample_at_a_distance_from_the_update_is_refused(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", evolve(INFO, trigger_offset=2e-4))
    with pytest.raises(InputError, match="s from the converter's update"):
        afm.read_record(bag)


@pytest.mark.parametrize("of_fit", [0.5, 1.0])
def test_what_the_fit_left_is_said_where_the_model_leaves_otherwise(
    of_fit: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = afm.identify([record(OPERATORS["plays"], levels(1, 6, 300))])
    axis = found.fit.axes["x"]
    by_fit = evolve(axis.records[0].misfit, sigma=of_fit * axis.records[0].misfit.sigma)
    changed = evolve(axis, records=(evolve(axis.records[0], by_fit=by_fit),))
    given = afm.Model(found.scanner, "", Identification({"x": changed}))
    monkeypatch.setattr("afm_scan_ros.identification.identify", lambda *_, **__: given)
    words = [str(write(tmp_path / "bag", INFO)), "--out", str(tmp_path / "model.yaml")]
    said = CliRunner().invoke(identify, words, catch_exceptions=False).output
    assert "levels, left by the model: sigma" in said
    assert ("levels, left by the fit: sigma" in said) == (of_fit < 0.9)


@pytest.mark.parametrize("name", ["model.yaml", "model.npz", "model.fit.json", "model.fit.html"])
def test_no_file_is_overwritten(tmp_path: Path, name: str) -> None:
    bag = write(tmp_path / "bag", INFO)
    (tmp_path / name).write_text("precious", "utf-8")
    kinds = ("--creep", "--frequency", "--hysteresis")
    words = [word for kind in kinds for word in (kind, str(bag))]
    with pytest.raises(InputError, match=f"{name} exists already: give another file or remove it"):
        CliRunner().invoke(
            identify, [*words, "--out", str(tmp_path / "model.yaml")], catch_exceptions=False
        )
    assert (tmp_path / name).read_text("utf-8") == "precious"
