"""Bags of two topics alone, as ``ros2 bag record`` leaves them: they are records."""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import STREAMS, encode_block, encode_info
from afm_scan_ros.bag.scan_info import TYPE as SCAN_INFO
from afm_scan_ros.bag.writer import BagWriter
from afm_scan_ros.cli.main import main
from afm_scan_ros.core.diagnosis import search
from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace

PERIOD, BLOCK = 1e-3, 50
INFO = ScanInfo("someone's", 10**18, "ignored", PERIOD, 10**6)
TOPICS = ("drive_voltage", "achieved_displacement")


def block(first: int, scale: float = 1.0) -> Trace:
    numbers = scale * np.arange(first, first + BLOCK, dtype=np.float64)
    return Trace(first, PERIOD, numbers, np.zeros(BLOCK))


def bag_of(
    folder: Path, firsts: Sequence[range], topics: Sequence[str] = TOPICS, info: ScanInfo = INFO
) -> Path:
    """Write blocks that begin at these samples, of one topic each, and no ``scan_info``."""
    with BagWriter(folder) as writer:
        for topic, type_name in ((name, STREAMS[name]) for name in topics):
            writer.add_topic(f"/stage/{topic}", type_name)
        for name, starts in zip(topics, firsts, strict=True):
            for first in starts:
                cdr = encode_block(STREAMS[name], info, block(first), last=False)
                writer.write(f"/stage/{name}", info.stamp(first), cdr)
    return folder


def test_what_both_topics_hold_is_the_record(tmp_path: Path) -> None:
    found = afm.read_record(bag_of(tmp_path / "bag", [range(300, 1000, 50), range(450, 1200, 50)]))
    assert (found.axes, found.kind, found.scan, found.info) == (("x",), None, None, None)
    assert (found.sample_period, found.missing) == (PERIOD, 0)
    np.testing.assert_array_equal(found.drive[:, 0], np.arange(450.0, 1000.0))
    np.testing.assert_array_equal(found.displacement[:, 0], np.arange(450.0, 1000.0))
    assert any("holds no scan_info: it is taken as a record" in s for s in found.shortcomings)
    assert any("the first 450 samples are missing" in s for s in found.shortcomings)


def test_its_beginning_is_that_of_sample_zero(tmp_path: Path) -> None:
    recording = read_scan(bag_of(tmp_path / "bag", [range(300, 500, 50)] * 2))
    assert (recording.info.start, recording.info.scan_id) == (INFO.start, "someone's")
    assert not recording.stated


def test_a_jump_is_named(tmp_path: Path) -> None:
    gap = [range(300, 800, 50), [*range(300, 600, 50), *range(650, 800, 50)]]
    with pytest.raises(afm.InputError, match=r"achieved_displacement: samples 600 to 649 are miss"):
        afm.read_record(bag_of(tmp_path / "bag", gap))


def test_parts_of_different_times_are_no_record(tmp_path: Path) -> None:
    apart = [range(0, 300, 50), range(300, 600, 50)]
    message = r"no sample in common \(drive_voltage 0 to 299, achieved_displacement 300 to 599\)"
    with pytest.raises(afm.InputError, match=message):
        afm.read_record(bag_of(tmp_path / "bag", apart))


def test_one_topic_alone_says_what_is_lacking(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", [range(0, 300, 50)], TOPICS[:1])
    with pytest.raises(afm.InputError, match=r"holds no achieved_displacement: .*no scan_info"):
        afm.read_record(bag)


def test_two_recordings_in_one_bag_are_distinguished(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        for name in TOPICS:
            writer.add_topic(f"/{name}", STREAMS[name])
            for first, info in ((0, INFO), (BLOCK, evolve(INFO, scan_id="another"))):
                cdr = encode_block(STREAMS[name], info, block(first), last=False)
                writer.write(f"/{name}", info.stamp(first), cdr)
    with pytest.raises(afm.InputError, match="sample 50 is of scan 'another', not 'someone's'"):
        afm.read_record(tmp_path / "bag")


@pytest.fixture
def analyzed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> "Analyzed":
    return Analyzed(monkeypatch, capsys)


class Analyzed:
    """``afm-scan analyze`` of a bag: its status and its output."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._patch, self._captured = monkeypatch, capsys

    def __call__(self, bag: Path, *options: str) -> tuple[object, str]:
        self._patch.setattr(sys, "argv", ["afm-scan", "analyze", str(bag), *options])
        with pytest.raises(SystemExit) as end:
            main()
        message = self._captured.readouterr()
        return end.value.code, message.out + message.err


def test_a_scan_without_scan_info_cannot_be_analysed_by_lines(
    tmp_path: Path, analyzed: Analyzed
) -> None:
    status, message = analyzed(bag_of(tmp_path / "bag", [range(0, 300, 50)] * 2))
    assert status == 2
    assert f"{tmp_path / 'bag'}: holds no scan_info, so which samples are lines" in message
    assert "record this topic too" in message


def test_what_was_desired_is_compared_nevertheless(tmp_path: Path, analyzed: Analyzed) -> None:
    topics = ("desired_displacement", "achieved_displacement")
    bag = bag_of(tmp_path / "bag", [range(0, 500, 50), range(100, 400, 50)], topics)
    status, message = analyzed(bag)
    assert not status
    assert "300 samples of a record 'recording'" in message
    assert "x: achieved minus desired: rms 0" in message
    status, message = analyzed(bag, "--report", str(tmp_path / "a.html"))
    assert status == 2
    assert "without --report and --figure" in message


def test_a_model_is_identified_from_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drive = np.repeat([0.0, 1.0, 0.0], [500, 4000, 500])
    creep = Creep(CreepModel((0.2,), (10.0,)), 20.0 * PERIOD)
    moved = 5e-6 * creep.apply(creep.at_rest(), drive)[1]
    moved += 2e-9 * np.random.default_rng(1).standard_normal(len(drive))
    info = evolve(INFO, sample_period=20.0 * PERIOD)
    with BagWriter(tmp_path / "bag") as writer:
        for name, values in zip(TOPICS, (drive, moved), strict=True):
            writer.add_topic(f"/{name}", STREAMS[name])
            trace = Trace(700, info.sample_period, values, np.zeros(len(values)))
            cdr = encode_block(STREAMS[name], info, trace, last=False)
            writer.write(f"/{name}", info.stamp(700), cdr)
    words = ["identify", str(tmp_path / "bag"), "--out", str(tmp_path / "model.yaml")]
    monkeypatch.setattr(sys, "argv", ["afm-scan", *words])
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    assert "x: creep: identified" in capsys.readouterr().out
    assert afm.load_model(tmp_path / "model.yaml").axes == ("x",)


def test_it_is_diagnosed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = tuple(c for c in search.CANDIDATES if c.effect.name in {"delay", "drift"})
    monkeypatch.setattr(search, "CANDIDATES", few)
    model = afm.load_model()
    spec = afm.ScanSpec(range_x=10e-6, range_y=10e-6, lines=2, line_rate=20.0, y_step=2e-3)
    drive = model.invert(afm.trajectory(spec), spec.sample_period)[:, 0]
    still = np.zeros(len(drive))
    moved = model.predict(np.column_stack([drive, still]), spec.sample_period)[:, 0]
    moved = np.roll(moved, 4) + 2e-9 * np.random.default_rng(1).standard_normal(len(drive))
    info = evolve(INFO, sample_period=spec.sample_period)
    with BagWriter(tmp_path / "bag") as writer:
        for name, values in zip(TOPICS, (drive, moved), strict=True):
            writer.add_topic(f"/{name}", STREAMS[name])
            trace = Trace(0, info.sample_period, values, still)
            cdr = encode_block(STREAMS[name], info, trace, last=True)
            writer.write(f"/{name}", info.start, cdr)
    found = afm.diagnose(model, [afm.read_record(tmp_path / "bag")])
    assert found.verdict in {"effect_found", "ambiguous"}
    assert "delay" in {each.name for each in (*found.effects, *found.alternatives)}


def test_a_bag_that_missed_a_scans_beginning_is_a_record_of_the_rest(tmp_path: Path) -> None:
    info = evolve(INFO, total_samples=500, pattern="creep")
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/scan_info", SCAN_INFO, latched=True)
        writer.write("/scan_info", info.start, encode_info(info))
        for name in TOPICS:
            writer.add_topic(f"/{name}", STREAMS[name])
            for first in range(200, 500, BLOCK):
                cdr = encode_block(STREAMS[name], info, block(first), last=False)
                writer.write(f"/{name}", info.stamp(first), cdr)
    found = afm.read_record(tmp_path / "bag")
    assert (len(found.drive), found.missing) == (300, 200)
    assert "the first 200 samples are missing" in found.shortcomings[0]
    with pytest.raises(afm.InputError, match="the first 200 samples are missing; record it again"):
        afm.identify([found])
