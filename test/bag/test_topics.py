"""Streams are found in a bag by name, namespace, type, or because the user says so."""

import sys
from pathlib import Path

import numpy as np
import pytest

import afm_scan_ros as afm
from afm_scan_ros.bag.reader import assigned
from afm_scan_ros.bag.scan_info import DISPLACEMENT, STREAMS, VOLTAGE, encode_block, encode_info
from afm_scan_ros.bag.scan_info import TYPE as SCAN_INFO
from afm_scan_ros.bag.writer import BagWriter
from afm_scan_ros.cli.main import main
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace

INFO = ScanInfo("someone's", 10**18, "ignored", 1e-3, 100)
TWO = {f"/{lab}/{name}": type_name for lab in "ab" for name, type_name in STREAMS.items()}
TWO |= {f"/{lab}/scan_info": SCAN_INFO for lab in "ab"}


def afm_scan(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["afm-scan", *words])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def bag_of(folder: Path, topics: dict[str, float]) -> Path:
    """Write a bag: a block on each topic, whose samples are this number."""
    with BagWriter(folder) as writer:
        writer.add_topic("/stage/announcement", SCAN_INFO)
        writer.write("/stage/announcement", INFO.start, encode_info(INFO))
        for topic, value in topics.items():
            type_name = VOLTAGE if "volts" in topic else DISPLACEMENT
            samples = value * np.arange(1.0, 101.0)
            block = Trace(0, INFO.sample_period, samples, samples)
            writer.add_topic(topic, type_name)
            writer.write(topic, INFO.start, encode_block(type_name, INFO, block, last=True))
    return folder


def test_remapped_topics_are_found_by_their_types(tmp_path: Path) -> None:
    found = afm.read_record(bag_of(tmp_path / "bag", {"/volts": 1.0, "/stage/position": 2.0}))
    assert found.info is not None
    assert (found.drive[0, 0], found.displacement[0, 0]) == (1.0, 2.0)


def test_of_several_the_user_says_which(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", {"/volts": 1.0, "/here": 2.0, "/there": 3.0})
    said = (
        "holds both /here and /there: say which one is achieved_displacement, as --topic"
        " achieved_displacement=/here"
    )
    with pytest.raises(InputError, match=said):
        afm.read_record(bag)
    found = afm.read_record(bag, topics={"achieved_displacement": "/there"})
    assert found.displacement[0, 0] == 3.0


def test_the_command_takes_the_topic(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    topics = {"/volts": 1.0, "/desired_displacement": 2.0, "/here": 3.0, "/there": 3.5}
    bag = str(bag_of(tmp_path / "bag", topics))
    assert afm_scan(monkeypatch, "analyze", bag) == 2
    assert "--topic achieved_displacement=/here" in capsys.readouterr().err
    chosen = "achieved_displacement=/there"
    assert afm_scan(monkeypatch, "analyze", bag, "--topic", chosen) == 0
    assert "peak 150,000,000,000 nm" in capsys.readouterr().out


@pytest.mark.parametrize("wrong", ["position=/here", "drive_voltage", "drive_voltage=here"])
def test_a_topic_that_is_none_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], wrong: str
) -> None:
    bag = str(bag_of(tmp_path / "bag", {"/volts": 1.0}))
    assert afm_scan(monkeypatch, "analyze", bag, "--topic", wrong) == 2
    assert f"{wrong}: give NAME=/TOPIC" in capsys.readouterr().err


def test_a_table_has_no_topics(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "scan.csv"
    table.write_text("time [s],drive_x [V],achieved_x [um]\n0,0,0\n1,1,5\n2,0,0\n", "utf-8")
    words = str(table), "--topic", "drive_voltage=/u", "--out", str(tmp_path / "model.yaml")
    assert afm_scan(monkeypatch, "identify", *words) == 2
    assert "a table has no topics: leave --topic out" in capsys.readouterr().err


def test_one_topic_that_is_chosen_chooses_its_namespace() -> None:
    for lab in "ab":
        found = assigned(TWO, {"drive_voltage": f"/{lab}/drive_voltage"}, "bag")
        assert found == {name: f"/{lab}/{name}" for name in (*STREAMS, "scan_info")}
    with pytest.raises(InputError, match=r"^bag: holds both /a/\w+ and /b/\w+: say which one is"):
        assigned(TWO, {}, "bag")


def test_a_name_goes_before_a_type() -> None:
    there = {"/model": DISPLACEMENT, "/lab/achieved_displacement": DISPLACEMENT}
    assert assigned(there, {}, "bag") == {"achieved_displacement": "/lab/achieved_displacement"}


@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        ({"drive_voltage": "/c/drive"}, "^bag: holds no topic /c/drive, but /a/achieved_disp"),
        ({"drive_voltage": "/a/scan_info"}, "^bag: /a/scan_info is of type .*, not .*VoltageBl"),
    ],
)
def test_a_chosen_topic_has_to_be_there_and_fit(chosen: dict[str, str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        assigned(TWO, chosen, "bag")
