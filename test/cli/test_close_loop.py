"""``afm-scan close-loop``, its scans made in this process but for one, made by the nodes."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attrs import evolve, frozen
from click.testing import CliRunner, Result

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli import close_loop as command
from afm_scan_ros.cli.driving import DrivenScanner, RecordedSession
from afm_scan_ros.core.diagnosis import search as selection
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files import share_directory, version, yaml
from afm_scan_ros.files.model_file import load_model, model_hash, save_model
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.records import to_mapping
from helpers.in_process import InProcessSession, default_model

CONFIG = share_directory() / "config"
SPEC = ScanSpec(
    range_x=20e-6,
    range_y=20e-6,
    line_rate=20.0,
    lines=8,
    samples_per_line=500,
    preparation_cycles=5,
)
TRIALS = ("same", "rate", "amplitude", "pattern")


@frozen
class Run:
    """What the command wrote and how it ended."""

    out: Path
    result: Result

    def read(self, name: str) -> Any:  # noqa: ANN401 - whatever the file holds
        """Return a JSON file."""
        return json.loads((self.out / name).read_text("utf-8"))


class OneProcess(InProcessSession):
    """Keeps no bags, and so knows of no records."""

    sources = ()


def close(folder: Path, plant: str, *entries: str) -> Run:
    """Close the loop on a plant, with a few entries of the catalogue."""
    section = {"/**/trajectory_generator": {"ros__parameters": to_mapping(SPEC)}}
    yaml.save(folder / "spec.yaml", section, "A scan.")
    few = tuple(c for c in selection.CANDIDATES if c.effect.name in entries)
    words = ["--spec", folder / "spec.yaml", "--plant", CONFIG / plant, "--out", folder / "out"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(selection, "CANDIDATES", few)
        patch.setattr(
            command,
            "RecordedSession",
            lambda driven, _: OneProcess(load_plant(driven.plant), driven.seed),
        )
        return Run(folder / "out", CliRunner().invoke(command.close_loop, list(map(str, words))))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A scanner with a delay."""
    return close(tmp_path_factory.mktemp("delay"), "plants/delay_large.yaml", "delay", "drift")


def test_the_effect_is_found_inverted_and_its_error_gone(run: Run) -> None:
    assert run.result.exit_code == 0, run.result.output
    found = run.read("diagnosis.json")
    assert found["verdict"] == "effect_found"
    (effect,) = found["effects"]
    assert (effect["name"], effect["axis"]) == ("delay", "x")
    before, after = found["tracking_rms_before_m"], found["tracking_rms_after_m"]
    assert after["x"] < 0.3 * before["x"]
    assert after["y"] == pytest.approx(before["y"], rel=0.02)
    (added,) = load_model(run.out / "model.extended.yaml").x.added
    assert added.values[0] == effect["parameters"]["delay"]["value"]


def test_each_round_is_reported_to_machines(run: Run) -> None:
    rounds = run.read("closed_loop.json")["rounds"]
    assert run.read("closed_loop.json")["failure"] is None
    assert [(r["kept"], r["improved"]) for r in rounds] == [(True, True), (False, False)]
    assert tuple(rounds[0]["trials"]) == TRIALS
    for trial in rounds[0]["trials"].values():
        measured, true = (
            [trial[f"{which}_{moment}"]["x"]["all"]["rms_m"] for moment in ("before", "after")]
            for which in ("measured", "true")
        )
        assert true[1] < 0.5 * true[0]
        assert trial["after_over_before"]["x"] == pytest.approx(measured[1] / measured[0])
        residual = trial["residual"]["x"]
        assert residual["after_m"] < 0.5 * residual["before_m"]


def test_the_errors_stand_in_80_columns(run: Run) -> None:
    lines = run.result.output.splitlines()
    for name in TRIALS:
        place = next(i for i, line in enumerate(lines) if line.startswith(f"{name}:"))
        assert [line.count(" → ") for line in lines[place : place + 2]] == [4, 4]


def test_all_that_is_written_names_model_and_package(run: Run) -> None:
    digest = model_hash(load_model(CONFIG / "model.yaml"))
    for name in ("diagnosis.json", "closed_loop.json", "round_1/diagnosis.json"):
        assert run.read(name)["provenance"]["model_hash"] == digest
    for name in ("report.html", "round_1/report.html", "model.extended.yaml"):
        written = (run.out / name).read_text("utf-8")
        assert digest in written
        assert f"afm_scan_ros {version()}" in written


def test_each_round_is_reported_to_people(run: Run) -> None:
    page = (run.out / "report.html").read_text("utf-8")
    assert page.count("<figure>") == 2
    assert page.count("<summary>Round ") == 2
    for number in (1, 2):
        assert f'href="round_{number}/report.html"' in page
        assert (run.out / f"round_{number}/report.html").is_file()
    first = page[page.index("<body>") : page.index("<summary>Round 1")]
    for text in (first, run.result.output):
        assert "delay" in text
        assert " → " in text
        assert "model.extended.yaml" in text
    assert run.result.output.count("next: ") == 2


def test_a_scanner_that_is_the_model_s_needs_no_loop(tmp_path: Path) -> None:
    run = close(tmp_path, "plant.yaml", "delay", "drift")
    assert run.result.exit_code == 0, run.result.output
    assert run.read("diagnosis.json")["effects"] == []
    assert load_model(run.out / "model.extended.yaml").x.added == ()


@pytest.mark.evidence
def test_a_residual_that_nothing_explains_is_no_success(tmp_path: Path) -> None:
    run = close(tmp_path, "plants/delay_large.yaml", "drift")
    assert isinstance(run.result.exception, ScanError)
    assert "verdict unexplained: " in str(run.result.exception)
    found = run.read("diagnosis.json")
    assert found["verdict"] == "unexplained"
    assert found["tracking_rms_after_m"] is None
    assert load_model(run.out / "model.extended.yaml").x.added == ()


def test_a_model_of_unmodel_discrepancy_is_refused_before_it_scans(tmp_path: Path) -> None:
    model, given = default_model(), tmp_path / "model.yaml"
    save_model(given, evolve(model, y=evolve(model.y, model_discrepancy=None)), "A model.")
    words = ["--model", str(given), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(command.close_loop, words)
    assert isinstance(result.exception, InputError)
    assert str(result.exception).startswith(f"{given}: y: model_discrepancy is missing: ")
    assert not (tmp_path / "out").exists()


def test_a_model_of_one_axis_is_refused_before_it_scans(tmp_path: Path) -> None:
    given = tmp_path / "model.yaml"
    save_model(given, evolve(default_model(), y=None), "A model.")
    words = ["--model", str(given), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(command.close_loop, words)
    assert isinstance(result.exception, InputError)
    assert str(result.exception).startswith(f"{given}: holds no axis y, which a scan moves")


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"--plant": "plant.yaml"}, "mechanisms should be a list"),
        ({"--spec": "line.yaml"}, "lines = 1 is out of range"),
    ],
)
def test_nothing_is_written_before_all_that_is_given_is_read(
    tmp_path: Path, given: dict[str, str], reason: str
) -> None:
    (tmp_path / "plant.yaml").write_text("mechanisms: 1\n", "utf-8")
    line = "/**/trajectory_generator: {ros__parameters: {lines: 1}}\n"
    (tmp_path / "line.yaml").write_text(line, "utf-8")
    words = [word for key, name in given.items() for word in (key, str(tmp_path / name))]
    result = CliRunner().invoke(command.close_loop, [*words, "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, InputError)
    assert reason in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_records_of_another_loop_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "bags").mkdir()
    result = CliRunner().invoke(command.close_loop, ["--out", str(tmp_path)])
    assert isinstance(result.exception, InputError)
    assert "bags exists already" in str(result.exception)
    assert [path.name for path in tmp_path.iterdir()] == ["bags"]


@pytest.mark.evidence
def test_what_was_reached_before_a_failure_is_written(tmp_path: Path) -> None:
    """The diagnosis fails in the second round; the first had found what there is."""
    traced = command.diagnose

    def once(*given: Any) -> ScannerDiagnosis:  # noqa: ANN401 - diagnose's
        if len(given[1]) > 1:
            raise ScanError("the second round came to nothing")
        return traced(*given)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "diagnose", once)
        run = close(tmp_path, "plants/delay_large.yaml", "delay")
    assert isinstance(run.result.exception, ScanError)
    assert str(run.result.exception) == "the second round came to nothing"
    found = run.read("closed_loop.json")
    assert found["failure"] == "the second round came to nothing"
    assert [done["improved"] for done in found["rounds"]] == [True]
    assert run.read("diagnosis.json")["effects"][0]["name"] == "delay"
    assert [added.name for added in load_model(run.out / "model.extended.yaml").x.added] == [
        "delay"
    ]
    for message in (run.result.output, (run.out / "report.html").read_text("utf-8")):
        assert "Round 2 failed" in message
        assert "the second round came to nothing" in message


def test_nodes_scan_as_one_process_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    by_nodes = RecordedSession(DrivenScanner(seed=7), tmp_path)
    in_process = InProcessSession(load_plant(CONFIG / "plant.yaml"), seed=7)
    model = default_model()
    one, other = (each.scan("same_0", SPEC, model) for each in (by_nodes, in_process))
    for name in ("desired", "drive", "measured", "true"):
        for axis in ("x", "y"):
            signals = (getattr(scan, name).axis(axis) for scan in (one, other))
            np.testing.assert_allclose(*signals, rtol=0.0, atol=1e-9)
    assert read_scan(tmp_path / "bags/same_0").info.spec == SPEC
    (source,) = by_nodes.sources
    assert (source.bag, source.samples) == (str(tmp_path / "bags/same_0"), len(one.true.x))
    assert source.model_hash == model_hash(model)
    (saved,) = (tmp_path / "models").glob("*.yaml")
    assert load_model(saved).x.creep == model.x.creep
