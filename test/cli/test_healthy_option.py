"""``afm-scan diagnose --healthy``: text files in, and the model's error on motion of their kind."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from click.testing import CliRunner

import afm_scan_ros as afm
from afm_scan_ros.cli.recorded import diagnose
from afm_scan_ros.files.model_file import load_model, save_model
from helpers.in_process import default_model

PERIOD = 2e-4


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """File of the model of one axis, which knows nothing of its error."""
    x = evolve(default_model().x, model_discrepancy=None, known_elsewhere=())
    save_model(tmp_path / "model.yaml", evolve(default_model(), x=x, y=None), "A model.")
    return tmp_path / "model.yaml"


def table(path: Path, model: Path, seed: int) -> str:
    time = np.arange(0.0, 2.0, PERIOD)
    drive = 2.0 * np.minimum(1.0, 5.0 * time) * np.sin(20.0 * np.pi * time)
    noise = np.random.default_rng(seed).normal(0.0, 2e-9, len(time))
    moved = 1e6 * (1.002 * afm.load_model(model).predict(drive, PERIOD) + noise)
    rows = np.column_stack([time, drive, moved])
    heading = "time [s],drive_x [V],achieved_x [um]"
    np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=heading, comments="")
    return str(path)


def test_healthy_text_files_stand_for_a_validation_record(model: Path, tmp_path: Path) -> None:
    files = [table(tmp_path / f"{seed}.csv", model, seed) for seed in range(3)]
    words = [files[0], "--model", str(model), "--out", str(tmp_path / "out")]
    refused = CliRunner().invoke(diagnose, words)
    assert "give records of the healthy scanner" in str(refused.exception)
    healthy = ["--healthy", files[1], "--healthy", files[2]]
    done = CliRunner().invoke(diagnose, [*words, *healthy], catch_exceptions=False)
    assert "The model is sufficient" in done.output, done.output
    known = load_model(tmp_path / "out/model.extended.yaml").axis("x").model_discrepancies
    assert [one.record.split(":")[0] for one in known] == ["healthy"] * 2
