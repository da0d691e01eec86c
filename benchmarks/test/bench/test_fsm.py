"""The fine steering mirror measured by others, at one amplitude."""

import os

import pytest

from afm_scan_bench.measured import fsm_noise
from afm_scan_bench.measured.fsm_modes import modes
from afm_scan_bench.measured.mirror.figure import ORDER, fitted
from afm_scan_bench.measured.mirror.recordings import (
    identified,
    measured,
    percent,
    predicted,
    squares,
)
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files import share_directory

DATA = os.environ.get("AFM_SCAN_DATA") or str(share_directory().parent / "shared/data")
with_data = pytest.mark.skipif(
    not os.path.isdir(os.path.join(DATA, "piezo_fsm")),  # noqa: PTH112, PTH118
    reason=f"no piezo_fsm in {DATA}: AFM_SCAN_DATA",
)


@with_data
def test_realisation_left_out_is_simulated_within_the_target() -> None:
    model = identified((300,), (0,), states=ORDER)
    assert percent(squares(predicted(model, 300, 0), 300, 0)) < 5.0


@with_data
def test_modes_known_from_the_measurement_are_found() -> None:
    found = {round(mode.frequency): mode.damping for mode in modes(fitted(300, 0))}
    assert found[922] == pytest.approx(0.012, abs=0.0005)
    assert found[991] == pytest.approx(0.0215, abs=0.0005)


@with_data
def test_two_realisations_are_noisier_than_the_others() -> None:
    noisier = [row for row in fsm_noise.measure().rows if row["verdict"]]
    assert [(row["amplitude_mv"], row["realisation"]) for row in noisier] == [(100, 1), (100, 2)]


def test_missing_measurements_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AFM_SCAN_DATA", "/nowhere")
    measured.cache_clear()
    with pytest.raises(InputError, match="/nowhere/piezo_fsm: no measurements there"):
        measured(300)
