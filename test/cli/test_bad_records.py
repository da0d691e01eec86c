"""What is no good calibration record: one line that names it and the mend, and status 2."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.bag.record import read_record
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli.main import main
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Array, Trace

SAMPLES, PERIOD = 2000, 1e-3
RNG = np.random.default_rng(11)
X_DRIVE, Y_DRIVE = (
    3.0 * np.interp(np.arange(SAMPLES), np.linspace(0, SAMPLES, 41), np.append(0.0, levels))
    for levels in RNG.uniform(-1.0, 1.0, (2, 40))
)
NOISE = 2e-9 * RNG.standard_normal((2, SAMPLES))
GOOD = {
    "drive_voltage": (X_DRIVE, Y_DRIVE),
    "achieved_displacement": (5e-6 * X_DRIVE + NOISE[0], 5e-6 * Y_DRIVE + NOISE[1]),
}
Signals = dict[str, tuple[Array, Array]]
Refused = Callable[..., str]
KINDS = ("creep", "frequency", "hysteresis")


def write(folder: Path, signals: Signals, kind: str = "creep", total: int = SAMPLES) -> Path:
    with ScanWriter(folder, ScanInfo("s", 0, kind, PERIOD, total)) as bag:
        for name, (x, y) in signals.items():
            bag.add(name, Trace(0, PERIOD, x, y))
    return folder


@pytest.fixture
def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Refused:
    """Identify, which must end with status 2 and one line beside progress; return that line.

    Records that are not given are good ones.
    """

    def run(creep: Path, *others: Path) -> str:
        good = (write(creep.parent / f"good_{kind}", GOOD, kind) for kind in KINDS[1:])
        bags = (creep, *(others or good))
        options = [w for kind, bag in zip(KINDS, bags, strict=True) for w in (f"--{kind}", bag)]
        arguments = ["afm-scan", "identify", *map(str, options), "--out", str(creep / "model.yaml")]
        monkeypatch.setattr(sys, "argv", arguments)
        with pytest.raises(SystemExit) as end:
            main()
        message = capsys.readouterr().err
        assert end.value.code == 2, message
        (line,) = (each for each in message.splitlines() if not each.startswith("identifying: "))
        return line

    return run


def spoilt(stream: str, change: Callable[[Array], Array]) -> Signals:
    """Return a good record but for the x axis of one stream."""
    x, y = GOOD[stream]
    return GOOD | {stream: (change(x), y)}


def late(by: int) -> Callable[[Array], Array]:
    return lambda values: np.roll(values, by)


def with_form() -> Signals:
    x, y = GOOD["achieved_displacement"]
    return GOOD | {"achieved_displacement": (y, x)}


BAD = {
    "clipped above": (
        spoilt("achieved_displacement", lambda x: np.minimum(x, 5e-6)),
        "displacement x is clipped at its upper end, 5e-06 m",
        "with less drive or a wider sensor range",
    ),
    "clipped below": (
        spoilt("achieved_displacement", lambda x: np.maximum(x, -5e-6)),
        "displacement x is clipped at its lower end",
        "with less drive or a wider sensor range",
    ),
    "constant displacement": (
        spoilt("achieved_displacement", np.zeros_like),
        "displacement x never changes",
        "record it again",
    ),
    "the other axis": (with_form(), "displacement x follows drive y", "record again"),
    "another scanner": (
        spoilt("achieved_displacement", RNG.permutation),
        "displacement x does not follow drive x",
        "record both of one scanner",
    ),
    "late displacement": (
        spoilt("achieved_displacement", late(40)),
        "displacement x lags its drive by 0.04 s",
        "start both on one clock",
    ),
    "early displacement": (
        spoilt("achieved_displacement", late(-7)),
        "displacement x leads its drive by 0.007 s",
        "start both on one clock",
    ),
    "micrometres": (
        spoilt("achieved_displacement", lambda x: 1e6 * x),
        "is it in µm or in the sensor's V?",
        "record it in m",
    ),
    "other sign": (
        spoilt("achieved_displacement", np.negative),
        "displacement x falls where its drive rises",
        "with the sign turned",
    ),
    "millivolts": (spoilt("drive_voltage", lambda x: 1e3 * x), "is it in mV?", "record it in V"),
    "NaN": (
        spoilt("achieved_displacement", lambda x: np.where(x > 1e-5, np.nan, x)),
        "achieved_displacement",
        "nan",
    ),
}


@pytest.mark.parametrize(("signals", "names", "mends"), BAD.values(), ids=BAD)
def test_a_bad_record(
    refused: Refused, tmp_path: Path, signals: Signals, names: str, mends: str
) -> None:
    bag = write(tmp_path / "creep", signals)
    message = refused(bag)
    assert str(bag) in message
    assert names in message
    assert mends in message


def test_a_record_with_a_gap(refused: Refused, tmp_path: Path) -> None:
    bag = tmp_path / "creep"
    with ScanWriter(bag, ScanInfo("s", 0, "creep", PERIOD, SAMPLES)) as writer:
        for name, (x, y) in GOOD.items():
            for part in (slice(0, 500), slice(700, SAMPLES)):
                writer.add(name, Trace(part.start, PERIOD, x[part], y[part]))
    assert "samples 500 to 699 are missing: record with" in refused(bag)


def test_a_record_whose_end_is_missing(refused: Refused, tmp_path: Path) -> None:
    bag = write(tmp_path / "creep", GOOD, total=SAMPLES + 10)
    assert "the last 10 samples are missing; record it again" in refused(bag)


def test_a_file_cut_behind_its_samples_is_read_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bag = write(tmp_path / "creep", GOOD)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes((bag / "creep_0.mcap").read_bytes()[:-8])
    record = read_record(cut)
    record.warn()
    assert len(record.drive) == SAMPLES
    (message,) = (each.getMessage() for each in caplog.records)
    assert message.startswith(f"{cut} was cut short")
    assert "ros2 bag reindex" in message


def test_a_drive_and_displacement_of_unequal_length(refused: Refused, tmp_path: Path) -> None:
    x, y = GOOD["achieved_displacement"]
    short = GOOD | {"achieved_displacement": (x[:-3], y[:-3])}
    bag = write(tmp_path / "creep", short)
    assert "the last 3 samples are missing" in refused(bag)


def test_a_saturated_amplifier(refused: Refused, tmp_path: Path) -> None:
    limited = spoilt(
        "achieved_displacement",
        lambda x: np.minimum(x, 0.9 * x.max()) + 1e-9 * RNG.standard_normal(SAMPLES),
    )
    bags = [
        write(tmp_path / kind, limited if kind == "hysteresis" else GOOD, kind) for kind in KINDS
    ]
    message = refused(*bags)
    assert ": x saturates: at the top of its drive" in message
    assert "V peak to peak" in message
