"""``afm-scan survey``: bags of two instruments in, one row each and what changed out."""

import json
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from attrs import evolve
from click.testing import CliRunner, Result
from pyarrow import parquet

from afm_scan_ros import diagnosis as api_diagnosis
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.diagnosis import diagnosis as core_diagnosis
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.features.survey import survey_command as command
from afm_scan_ros.features.survey.assignment import Assignment, survey_bag
from afm_scan_ros.features.survey.survey_command import survey
from afm_scan_ros.features.survey.workers import WorkerOptions
from afm_scan_ros.files import share_directory
from helpers.in_process import ALL, scan

pytestmark = pytest.mark.evidence

MODEL = share_directory() / "config/model.yaml"
SPEC = ScanSpec(lines=3, samples_per_line=1000, preparation_cycles=5)
START, DAY = 1_760_000_000 * 10**9, 86_400 * 10**9
NIGHTS, CHANGED = 6, 3
"""Bags of each instrument, and the first with another gain of the second."""


def record(folder: Path, night: int, gain: float = 1.0) -> Path:
    made = scan(SPEC, ALL, seed=sum(map(ord, folder.parent.name)) + night)
    info = info_of_scan(SPEC, f"{folder.parent.name} {night}", START + night * DAY)
    with ScanWriter(folder, info) as bag:
        bag.add("drive_voltage", made.drive)
        bag.add("achieved_displacement", evolve(made.measured, x=gain * made.measured.x))
    return folder


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags")
    for night in range(NIGHTS):
        record(folder / f"left/night_{night}", night)
        record(folder / f"right/night_{night}", night, 1.0005 if night >= CHANGED else 1.0)
    return folder


@pytest.fixture(scope="module")
def surveyed(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """The survey's folder, from processes of its own, and what the command said."""
    out = tmp_path_factory.mktemp("survey")
    return out, invoke(recorded, out, "--jobs", "1")


class Counter:
    """Diagnoses in this process, and counts; is interrupted after so many."""

    def __init__(self, most: int = 1000) -> None:
        self.done: list[str] = []
        self.most = most

    def run(
        self, work: Callable[[Assignment], Any], tasks: Sequence[Assignment]
    ) -> Iterator[tuple[Assignment, Any]]:
        for task in tasks:
            if len(self.done) == self.most:
                raise KeyboardInterrupt
            self.done.append(task.bag)
            yield task, work(task)


@pytest.fixture
def counter(monkeypatch: pytest.MonkeyPatch) -> Counter:
    made = Counter()
    monkeypatch.setattr(WorkerOptions, "run", made.run)
    return made


def invoke(bags: Path, out: Path, *options: str, model: str = str(MODEL)) -> Result:
    words = [str(bags), "--model", model, "--out", str(out), *options]
    return CliRunner().invoke(survey, words)


def rows(out: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = parquet.read_table(out / "survey.parquet").to_pylist()
    return found


def test_a_survey_describes_no_residual_and_starts_no_threads(
    recorded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No row holds the description, which takes longer than most diagnoses."""

    def refused(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(api_diagnosis, "report_residual", refused)
    monkeypatch.setattr(core_diagnosis, "in_parallel", refused)
    bag = str(recorded / "left/night_0")
    found = survey_bag(Assignment(bag, "left", "", str(MODEL), ""))
    assert (found.verdict, found.error) == ("model_sufficient", "")


@pytest.mark.evidence
def test_the_instrument_that_changed_is_named_and_no_other(surveyed: tuple[Path, Result]) -> None:
    out, result = surveyed
    assert isinstance(result.exception, ScanError)
    assert str(result.exception).startswith("instruments that changed: 1;")
    (alert,) = (line for line in result.stdout.splitlines() if line.startswith("alert: "))
    start, factor, *_ = re.split(r"factor of (\S+)", alert)
    assert start == "alert: right: gain of x changed by a "
    assert float(factor) == pytest.approx(1.0005, abs=1e-5)
    assert "between 2025-10-11 08:53 and 2025-10-12 08:53" in alert
    page = (out / "survey.html").read_text("utf-8")
    assert alert.removeprefix("alert: ") in page
    assert page.count("<option>") == 2


def test_there_is_a_row_for_each_bag(surveyed: tuple[Path, Result]) -> None:
    out, _ = surveyed
    found = rows(out)
    assert len(found) == len({row["bag"] for row in found}) == 2 * NIGHTS
    assert {row["verdict"] for row in found} == {"model_sufficient"}
    assert {row["error"] for row in found} == {None}
    for row in found:
        assert row["gain_x_low"] < row["gain_x"] < row["gain_x_high"]
        assert 0.0 < row["residual_x_m"] < row["detection_limit_x_m"]
    changed = [row["gain_x"] for row in found if row["instrument"] == "right"]
    assert changed[-1] / changed[0] == pytest.approx(1.0005, abs=1e-5)
    assert [row["recorded"].day for row in found[:3]] == [9, 10, 11]


def test_what_was_surveyed_is_not_diagnosed_again(
    surveyed: tuple[Path, Result], recorded: Path, tmp_path: Path, counter: Counter
) -> None:
    out = shutil.copytree(surveyed[0], tmp_path / "out")
    before = rows(out)
    result = invoke(recorded, out)
    assert isinstance(result.exception, ScanError)
    assert counter.done == []
    assert rows(out) == before
    model = tmp_path / "model.yaml"
    model.write_text(MODEL.read_text("utf-8") + "\n# another\n", "utf-8")
    shutil.copy(MODEL.with_suffix(".npz"), tmp_path)
    invoke(recorded / "left/night_0", out, model=str(model))
    assert [Path(bag).name for bag in counter.done] == ["night_0"]
    assert len(rows(out)) == 2 * NIGHTS


def test_the_report_of_a_recording_is_written_where_it_is_asked_for(
    recorded: Path, tmp_path: Path, counter: Counter
) -> None:
    bag = recorded / "left/night_0"
    invoke(bag, tmp_path)
    assert not (tmp_path / "reports").exists()
    for _ in range(2):  # what has its report is not diagnosed again
        invoke(bag, tmp_path, "--reports")
    (report,) = tmp_path.glob("reports/*/report.html")
    assert len(counter.done) == 2
    page = (tmp_path / "survey.html").read_text("utf-8")
    assert f'"{report.relative_to(tmp_path).as_posix()}"' in page


def test_a_survey_that_was_ended_goes_on_where_it_was(
    recorded: Path, tmp_path: Path, counter: Counter
) -> None:
    counter.most = 2
    assert invoke(recorded / "left", tmp_path / "out").exit_code != 0
    assert not (tmp_path / "out/survey.parquet").exists()
    counter.most = 1000
    assert invoke(recorded / "left", tmp_path / "out").exit_code == 0
    assert len(counter.done) == len(set(counter.done)) == len(rows(tmp_path / "out")) == NIGHTS


def test_one_bad_bag_is_one_row_with_its_error(
    recorded: Path, tmp_path: Path, counter: Counter
) -> None:
    bags = tmp_path / "bags"
    shutil.copytree(recorded / "left/night_0", bags / "left/night_0")
    shutil.copytree(recorded / "left/night_0", bags / "left/night_1")
    (file,) = (bags / "left/night_1").glob("*.mcap")
    file.write_bytes(b"no bag at all")
    result = invoke(bags, tmp_path / "out")
    assert isinstance(result.exception, ScanError)
    assert "could not be diagnosed: 1 of 2" in str(result.exception)
    good, bad = sorted(rows(tmp_path / "out"), key=lambda row: row["bag"])
    assert (good["error"], good["verdict"]) == (None, "model_sufficient")
    assert "is not an MCAP file" in bad["error"]
    assert bad["verdict"] is None
    invoke(bags, tmp_path / "out")
    assert len(counter.done) == 2
    shutil.rmtree(bags / "left/night_1")
    assert invoke(bags, tmp_path / "out").exit_code == 0
    assert len(rows(tmp_path / "out")) == 1


def test_each_instrument_has_its_model(recorded: Path, tmp_path: Path, counter: Counter) -> None:
    del counter
    shutil.copy(MODEL, tmp_path / "left.yaml")
    shutil.copy(MODEL.with_suffix(".npz"), tmp_path)
    nights = [str(recorded / f"{name}/night_0") for name in ("left", "right")]
    words = [*nights, "--model", str(tmp_path / "{instrument}.yaml"), "--out", str(tmp_path / "o")]
    assert isinstance(CliRunner().invoke(survey, words).exception, ScanError)
    left, right = rows(tmp_path / "o")
    assert left["error"] is None
    assert str(tmp_path / "right.yaml") in right["error"]


@pytest.mark.evidence
def test_a_watch_surveys_what_is_complete_and_alerts_once(
    recorded: Path, tmp_path: Path, counter: Counter, monkeypatch: pytest.MonkeyPatch
) -> None:
    bags, looks = tmp_path / "bags", []

    def sleep(seconds: float) -> None:
        """A night passes at each second look; the metadata of the last come at the end."""
        looks.append(seconds)
        night = len(looks) // 2
        if len(looks) % 2 == 0 and night <= NIGHTS:
            shutil.copytree(recorded / f"right/night_{night - 1}", bags / f"right/night_{night}")

    bags.mkdir()
    (bags / "right/night_0").mkdir(parents=True)
    for file in (recorded / "left/night_0").glob("*.mcap"):
        shutil.copy(file, bags / "right/night_0")
    monkeypatch.setattr(command.time, "sleep", sleep)
    until = ("--watch", "--every", "2min", "--until", str(NIGHTS))
    result = invoke(bags, tmp_path / "out", *until)
    assert isinstance(result.exception, ScanError)
    assert set(looks) == {120.0}
    alerts = [line for line in result.stdout.splitlines() if line.startswith("alert: ")]
    assert len(alerts) == 1
    assert len(rows(tmp_path / "out")) == len(counter.done) == NIGHTS
    assert not any("night_0" in bag for bag in counter.done)


def test_a_watch_of_nothing_ends_with_an_interrupt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(_: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command.time, "sleep", interrupt)
    (tmp_path / "bags").mkdir()
    result = invoke(tmp_path / "bags", tmp_path / "out", "--watch")
    assert (result.exit_code, result.stdout) == (0, "")


def test_what_cannot_work_is_refused_before_any_work(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*words: str, model: str = str(MODEL), bags: Path = recorded) -> str:
        result = invoke(bags, tmp_path / "out", *words, model=model)
        assert isinstance(result.exception, InputError | SystemExit)
        return str(result.exception) + result.output

    (tmp_path / "empty").mkdir()
    assert "holds no bag" in refused(bags=tmp_path / "empty")
    assert "none.yaml" in refused(model=str(tmp_path / "none.yaml"))
    assert "has 0 groups" in refused("--instrument", "afm")
    assert "give a regular expression" in refused("--instrument", "(afm")
    monkeypatch.setattr("afm_scan_ros.features.survey.folder.find_spec", lambda _: None)
    assert "afm_scan_ros[survey]" in refused()
    assert not (tmp_path / "out").exists()


def test_a_kept_file_that_is_damaged_is_named(
    surveyed: tuple[Path, Result], recorded: Path, tmp_path: Path
) -> None:
    out = shutil.copytree(surveyed[0], tmp_path / "out")
    file = next((out / "recordings").iterdir())
    file.write_text("{", "utf-8")
    assert str(file) in str(invoke(recorded, out).exception)
    file.write_text(json.dumps({"bag": "a"}), "utf-8")
    assert str(file) in str(invoke(recorded, out).exception)


def test_a_bag_without_a_time_is_in_no_trend(tmp_path: Path, counter: Counter) -> None:
    del counter
    made = scan(SPEC, ALL)
    with ScanWriter(tmp_path / "bags/a/one", info_of_scan(SPEC, "one", 0)) as bag:
        bag.add("drive_voltage", made.drive)
        bag.add("achieved_displacement", made.measured)
    result = invoke(tmp_path / "bags", tmp_path / "out")
    assert result.exit_code == 0
    assert "states no time, so no trend has it" in result.stdout
    assert rows(tmp_path / "out")[0]["recorded"] is None


def test_what_failed_for_another_reason_is_tried_again(
    recorded: Path, tmp_path: Path, counter: Counter, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = recorded / "left/night_0"
    with monkeypatch.context() as patched:
        lost = ScanError("the process was ended")
        patched.setattr(WorkerOptions, "run", lambda _, __, tasks: ((t, lost) for t in tasks))
        assert isinstance(invoke(bag, tmp_path / "out").exception, ScanError)
    assert rows(tmp_path / "out")[0]["error"] == "the process was ended"
    assert invoke(bag, tmp_path / "out").exit_code == 0
    assert counter.done == [str(bag)]
