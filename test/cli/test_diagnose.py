"""``afm-scan diagnose``: bags and a model in; diagnosis, extended model and report out."""

import json
import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attrs import evolve, frozen
from click.testing import CliRunner, Result

from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli.calibrate import calibrate
from afm_scan_ros.cli.main import main
from afm_scan_ros.cli.recorded import diagnose
from afm_scan_ros.core.diagnosis import search
from afm_scan_ros.core.diagnosis.experiments import Proposal, SizedExperiment
from afm_scan_ros.core.diagnosis.settings import SEARCH
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files import share_directory, version
from afm_scan_ros.files.model_file import load_model, model_hash, save_model
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.report.diagnosis_text import proposal
from afm_scan_ros.report.sentences import sentence
from helpers.in_process import ALL, default_model, scan

CONFIG = share_directory() / "config"
MODEL = CONFIG / "model.yaml"
RECORDED = 1_720_000_000_000_000_000
SPEC = ScanSpec(lines=3, samples_per_line=2000, preparation_cycles=5)
KEYS = {
    "verdict",
    "noise_floor_m",
    "residual_rms_before_m",
    "residual_rms_after_m",
    "effects",
    "alternatives",
    "next_experiment",
    "proposed_experiment",
    "tracking_rms_before_m",
    "tracking_rms_after_m",
}
"""Of the file that other programs read."""


@frozen
class Run:
    out: Path
    result: Result

    @property
    def document(self) -> dict[str, Any]:
        content: dict[str, Any] = json.loads((self.out / "diagnosis.json").read_text("utf-8"))
        return content


def write(folder: Path, drive: Trace, moved: Trace, info: ScanInfo | None = None) -> Path:
    with ScanWriter(folder, info or info_of_scan(SPEC, "one", RECORDED)) as bag:
        bag.add("drive_voltage", drive)
        bag.add("achieved_displacement", moved)
    return folder


def run_on(plant: str, folder: Path) -> Run:
    made = scan(SPEC, ALL, plant=load_plant(CONFIG / f"plants/{plant}.yaml"))
    bag = write(folder / "bag", made.drive, made.measured)
    words = [str(bag), "--model", str(MODEL), "--out", str(folder / "out"), "--figures", "png"]
    return Run(folder / "out", CliRunner().invoke(diagnose, words))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A scan of a scanner that drifts."""
    return run_on("drift_large", tmp_path_factory.mktemp("drift"))


@pytest.fixture(scope="module")
def unexplained(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A scan of a scanner of which the gain in x depends on y, which no entry describes.

    Of the catalogue some are tried, for time: that none of all is taken for it, the bench counts.
    """
    few = tuple(c for c in search.CANDIDATES if c.effect.name in {"drift", "static_nonlinearity"})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "CANDIDATES", few)
        return run_on("bow_large", tmp_path_factory.mktemp("bow"))


def test_diagnosis_is_what_other_programs_read(run: Run) -> None:
    assert run.result.exit_code == 0, run.result.output
    document = run.document
    assert set(document) >= KEYS
    assert document["verdict"] == "effect_found"
    (effect,) = document["effects"]
    assert (effect["name"], effect["axis"]) == ("drift", "x")
    assert effect["kind_words"] == effect_type("drift").kind_label(effect["kind"])
    assert set(effect["parameters"]) - {"kind"} == {
        p.name for p in effect_type("drift").form(effect["kind"]).parameters
    }
    for name in set(effect["parameters"]) - {"kind"}:
        parameter = effect["parameters"][name]
        low, high = parameter["interval_95"]
        assert low <= parameter["value"] <= high
        assert parameter["unit"]
    assert document["residual_rms_after_m"]["x"] < 0.1 * document["residual_rms_before_m"]["x"]
    assert document["tracking_rms_after_m"] is None


def test_extended_model_holds_the_effect_and_is_loaded_as_it_is(run: Run) -> None:
    extended, base = load_model(run.out / "model.extended.yaml"), load_model(MODEL)
    assert [added.name for added in extended.x.added] == ["drift"]
    bare = evolve(extended, x=evolve(extended.x, added=()))
    assert model_hash(bare) == model_hash(base) != model_hash(extended)


def test_terminal_and_report_name_it(run: Run) -> None:
    page = (run.out / "report.html").read_text("utf-8")
    for words in ("drift", "settling", "effect found"):
        assert words in run.result.output
        assert words in page
    for axis in ("x", "y"):
        assert (run.out / f"report_residual_{axis}.png").stat().st_size > 0


def test_the_report_begins_with_the_answer(run: Run) -> None:
    page = (run.out / "report.html").read_text("utf-8")
    answer, rest = page.split("<h2>What to do next</h2>")
    answer = answer[answer.index('<section class="answer"') :]
    assert "<h2>" not in answer
    (effect,) = run.document["effects"]
    assert effect["name"] in answer
    assert f"{1e9 * run.document['residual_rms_before_m']['x']:.0f}" in answer.replace(",", "")
    assert "model.extended.yaml" in rest[: rest.index("<h2>")]


def test_what_is_tried_is_not_reported_as_found(run: Run) -> None:
    assert re.search(r"diagnosing: [xy]: trying \w+ \(", run.result.output)


def test_the_report_says_what_was_added_and_what_else_was_tried(run: Run) -> None:
    page = (run.out / "report.html").read_text("utf-8")
    assert "with rate" in page
    tried = run.document["alternatives"]
    kinds = [f"{a['name']}, {a['kind_words']}" for a in tried if a["kind_words"]]
    single = [a for a in tried if a["kind_words"]]
    assert all(a["kind_words"] == effect_type(a["name"]).kind_label(a["kind"]) for a in single)
    assert "<summary>Alternatives</summary>" in page
    assert kinds
    assert all(f">{kind}</td>" in page for kind in kinds)
    assert all(effect_type(a["name"]).form(a["kind"]) for a in single)
    of_x, of_y = page.split("<summary>The residual in y</summary>")
    assert "With the extended model: " in of_x
    assert "With the extended model: " not in of_y


def test_probabilities_are_those_of_the_json(run: Run) -> None:
    found = run.document["probabilities"]["y"]
    assert sum(found.values()) == pytest.approx(1.0)
    (named,) = run.document["effects"]
    assert named["probability"] >= SEARCH.certain
    assert all(0.0 <= a["probability"] <= 1.0 for a in run.document["alternatives"])
    for words in ((run.out / "report.html").read_text("utf-8"), run.result.output):
        assert "Probability in x: drift" in " ".join(words.split())


def test_a_residual_says_what_it_is_of(run: Run) -> None:
    """On stretches that no fit saw it is another than over the whole record."""
    assert "stretches that the values were not fitted to" in run.document["residual_rms_is_of"]
    page = (run.out / "report.html").read_text("utf-8")
    for words in (page, run.result.output):
        assert sentence("residual.of_all_records") in " ".join(words.split())
    assert "nm rms over the whole record" in page


def test_all_that_is_written_says_of_what_it_is(run: Run) -> None:
    """A report that names neither model nor record cannot be signed."""
    found, digest = run.document["provenance"], model_hash(load_model(MODEL))
    (record,) = found["records"]
    assert found["package"] == f"afm_scan_ros {version()}"
    assert (found["model"], found["model_hash"]) == (str(MODEL), digest)
    assert (record["scan_id"], record["recorded"]) == ("one", "2024-07-03T09:46:40Z")
    assert record["sample_rate_hz"] == SPEC.line_rate * SPEC.samples_per_line
    assert record["samples"] == record["samples_announced"]
    for name in ("report.html", "model.extended.yaml"):
        written = (run.out / name).read_text("utf-8")
        provenance = (digest, found["package"], found["written"], record["bag"], record["recorded"])
        for words in provenance:
            assert words in written


def test_a_diagnosis_is_never_written_over(run: Run) -> None:
    before = (run.out / "diagnosis.json").stat()
    words = ["nowhere", "--model", str(MODEL), "--out", str(run.out)]
    ended = CliRunner().invoke(diagnose, words)
    assert isinstance(ended.exception, InputError)
    assert str(ended.exception).endswith(
        "diagnosis.json exists already: give another folder or remove it"
    )
    assert (run.out / "diagnosis.json").stat().st_mtime_ns == before.st_mtime_ns


def test_residual_is_described_record_by_record(run: Run) -> None:
    (record,) = run.document["residual"]["x"]
    assert record["initial_hysteresis_state"] == "depolarised"
    assert record["rms_is_of"] == "the whole record"
    before, after = record["before"], record["after"]
    assert np.linalg.norm(before["band_rms_m"]) == pytest.approx(before["rms_m"], rel=1e-3)
    assert before["locked"]["to_time"] > 0.5
    assert after["rms_m"] < 0.1 * before["rms_m"]


@pytest.mark.evidence
def test_what_nothing_explains_is_described_and_no_name_given(unexplained: Run) -> None:
    document, message = unexplained.document, unexplained.result.output
    assert unexplained.result.exit_code == 0, message
    assert document["verdict"] == "unexplained"
    assert document["effects"] == []
    assert "afm-scan calibrate --experiment" in document["next_experiment"]
    own = SizedExperiment.of_library("amplitudes", default_model())
    assert document["proposed_experiment"] == {
        "name": own.name,
        "axis": "x",
        "amplitude_v": own.amplitude,
        "amplitude_m": None,
        "duration_s": own.duration,
        "expected_bits": None,
        "expected_probability": None,
    }
    page = (unexplained.out / "report.html").read_text("utf-8")
    for words in ("no effect in the catalogue explains", "Record the experiment amplitudes"):
        assert words in " ".join(message.split())
        assert words in page
    assert load_model(unexplained.out / "model.extended.yaml").x.added == ()


Refused = Callable[..., str]


@pytest.fixture
def refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Refused:
    """Run the command, which must end with status 2 and one line; return that line."""

    def run(bag: Path, model: Path = MODEL) -> str:
        words = ["afm-scan", "diagnose", bag, "--model", model, "--out", tmp_path / "out"]
        monkeypatch.setattr(sys, "argv", [*map(str, words)])
        with pytest.raises(SystemExit) as end:
            main()
        message = capsys.readouterr().err
        assert (end.value.code, message.count("\n")) == (2, 1), message
        return message

    return run


@pytest.fixture(scope="module")
def healthy() -> Scan:
    return scan(SPEC, ALL)


def times(trace: Trace, factor: float) -> Trace:
    return evolve(trace, x=factor * trace.x, y=factor * trace.y)


def test_displacement_in_micrometres_is_refused(
    refused: Refused, healthy: Scan, tmp_path: Path
) -> None:
    bag = write(tmp_path / "bag", healthy.drive, times(healthy.measured, 1e6))
    assert "moves 1e+06 times as far as the model says" in refused(bag)


def test_swapped_axes_are_refused(refused: Refused, healthy: Scan, tmp_path: Path) -> None:
    moved = evolve(healthy.measured, x=healthy.measured.y, y=healthy.measured.x)
    bag = write(tmp_path / "bag", healthy.drive, moved)
    assert "axis x" in refused(bag)


def test_drive_beyond_the_model_is_refused(refused: Refused, healthy: Scan, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", times(healthy.drive, 3.0), healthy.measured)
    message = refused(bag)
    assert str(bag) in message
    assert "the model was identified to -4 V" in message


def test_one_scan_given_twice_is_refused(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    healthy: Scan,
    tmp_path: Path,
) -> None:
    bags = [str(write(tmp_path / name, healthy.drive, healthy.measured)) for name in "ab"]
    words = ["afm-scan", "diagnose", *bags, "--model", str(MODEL), "--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as end:
        main()
    message = capsys.readouterr().err
    assert (end.value.code, message.count("\n")) == (2, 1), message
    assert all(bag in message for bag in bags)
    assert "the same scan" in message


def test_sampling_at_a_distance_from_the_update_is_refused(
    refused: Refused, healthy: Scan, tmp_path: Path
) -> None:
    info = evolve(info_of_scan(SPEC, "one", 0), trigger_offset=1e-5)
    bag = write(tmp_path / "bag", healthy.drive, healthy.measured, info)
    assert "sampled 1e-05 s from the converter's update" in refused(bag)


def test_bag_without_drive_is_refused(refused: Refused, healthy: Scan, tmp_path: Path) -> None:
    with ScanWriter(tmp_path / "bag", info_of_scan(SPEC, "one", 0)) as bag:
        bag.add("achieved_displacement", healthy.measured)
    assert "holds no drive_voltage" in refused(tmp_path / "bag")


def test_a_bag_cut_before_its_drive_is_called_cut(
    refused: Refused, healthy: Scan, tmp_path: Path
) -> None:
    bag = write(tmp_path / "bag", healthy.drive, healthy.measured)
    content = (bag / "bag_0.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(content[:20_000])
    message = refused(cut)
    assert f"{cut} was cut short" in message
    assert "ros2 bag reindex" in message


def test_a_proposal_is_a_command_as_it_is_typed() -> None:
    for name in EXPERIMENTS:
        own = SizedExperiment.of_library(name, default_model())
        message = proposal(Proposal("x", own))
        assert "--plant" in message
        ways = []
        for each in re.findall("'(afm-scan calibrate [^']+)'", message):
            _, subcommand, *words = shlex.split(each)
            given = calibrate.make_context(subcommand, words).params
            assert given["experiment"] == name
            for stated, size in (
                (given["amplitude"] or 0.0, own.amplitude),
                (given["duration"], own.duration),
            ):  # three digits, rounded down
                assert 0.99 * size <= stated <= size * (1.0 + 1e-6)
            ways.append((given["folder"], given["out"]))
        assert ways == [(Path("experiments"), None), (None, Path("experiments"))]


def test_a_few_samples_are_refused(refused: Refused, tmp_path: Path) -> None:
    few = Trace(0, SPEC.sample_period, np.zeros(10), np.zeros(10))
    assert "holds 10 samples" in refused(write(tmp_path / "bag", few, few))


def test_model_without_model_discrepancy_is_refused(
    refused: Refused, healthy: Scan, tmp_path: Path
) -> None:
    model = default_model()
    unknown = evolve(model, x=evolve(model.x, model_discrepancy=None))
    save_model(tmp_path / "model.yaml", unknown, "")
    bag = write(tmp_path / "bag", healthy.drive, healthy.measured)
    message = refused(bag, tmp_path / "model.yaml")
    assert "model.yaml: the model of axis x states no model_discrepancy" in message


@pytest.mark.evidence
@pytest.mark.parametrize(("recorded", "proposed"), [("rest", True), ("amplitudes", False)])
def test_what_is_recorded_already_is_not_proposed_again(
    tmp_path: Path, recorded: str, *, proposed: bool
) -> None:
    noise = np.random.default_rng(3).normal(0.0, 1e-9, (2, 4000))
    still = Trace(0, 5e-4, np.zeros(4000), np.zeros(4000))
    bag = write(
        tmp_path / "bag", still, Trace(0, 5e-4, *noise), ScanInfo("one", 0, recorded, 5e-4, 5000)
    )
    words = [str(bag), "--model", str(MODEL), "--out", str(tmp_path / "out")]
    message = CliRunner().invoke(diagnose, words).output
    assert "the last 1000 samples are missing" in message
    assert "insufficient excitation" in message
    page = (tmp_path / "out/report.html").read_text("utf-8")
    assert "the last 1000 samples are missing" in page[: page.index("<h2>What to do next")]
    assert "<td>4,000 of 5,000</td>" in page[page.index("Provenance") :]
    document = json.loads((tmp_path / "out/diagnosis.json").read_text("utf-8"))
    (record,) = document["provenance"]["records"]
    assert (record["samples"], record["samples_announced"]) == (4000, 5000)
    assert ("--experiment amplitudes" in message) == proposed
