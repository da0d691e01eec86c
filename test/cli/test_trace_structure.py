"""``identify --linear`` and ``diagnose --structure`` on files of a drive that was measured."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.cli.main import cli
from helpers.duffing import Oscillator, multisine

PERIOD, FINER = 1.0 / 610.0, 8
SCANNER = Oscillator(cube=3e9)
RECORDED = ("--depolarised", "--intersample", "band_limited")


def written(folder: Path, seed: int, count: int) -> str:
    """Write a record as CSV; return its path."""
    fine = multisine(FINER * count, seed, share=0.3 / FINER)
    moved = 1e6 * SCANNER.moved(fine, PERIOD / FINER)[::FINER]
    moved += 2e-4 * np.random.default_rng(seed).standard_normal(count)
    columns = PERIOD * np.arange(count), fine[::FINER], moved
    path = folder / f"waves_{seed}.csv"
    head = "time [s],drive_x [V],achieved_x [um]"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=head, comments="")
    return str(path)


@pytest.mark.evidence
def test_the_spring_that_a_linear_model_lacks_is_found_by_commands(tmp_path: Path) -> None:
    fitted, held_out, fresh = (written(tmp_path, seed, 4000) for seed in (1, 2, 3))
    model, out = str(tmp_path / "model.yaml"), tmp_path / "lacking"
    orders = (
        ["identify", fitted, "--validation", held_out, "--linear", *RECORDED, "--out", model],
        ["diagnose", fresh, "--model", model, "--structure", *RECORDED, "--out", str(out)],
    )
    for words in orders:
        done = CliRunner().invoke(cli, words)
        assert done.exit_code == 0, done.output
    found = json.loads((out / "diagnosis.json").read_text("utf-8"))
    assert [effect["name"] for effect in found["effects"]] == ["nonlinear_spring"]
    before, after = (found[f"residual_rms_{when}_m"]["x"] for when in ("before", "after"))
    assert after < 0.1 * before
    assert set(found["refitted"]["x"]) == {
        *("factor", "frequency_factor", "damping_factor", "remainder_factor")
    }
    assert (out / "model.extended.yaml").exists()
