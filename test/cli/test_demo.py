"""The demonstration, with its scans run in this process in place of the nodes' processes."""

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli import demo as demonstration
from afm_scan_ros.cli.main import COMMANDS
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.files.plant_file import load_scan
from helpers.in_process import scan


def in_process(files: ScanFiles, inverses: tuple[str, ...], *, images: bool) -> None:
    assert images
    spec, _ = load_scan(files.spec)
    signals = scan(spec, () if inverses == ("none",) else inverses)
    with ScanWriter(files.bag, info_of_scan(spec, files.bag.name, 10**18)) as writer:
        writer.add("desired_displacement", signals.desired)
        writer.add("drive_voltage", signals.drive)
        writer.add("achieved_displacement", signals.measured)
        writer.add("true_displacement", signals.true)


@pytest.mark.evidence
def test_the_demonstration_shows_what_each_inverse_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demonstration, "run_scan", in_process)
    monkeypatch.setattr(demonstration, "LINE_RATES", (30.0,))
    for _ in range(2):  # it can be run again
        done = CliRunner().invoke(
            demonstration.demo, ["--out", str(tmp_path), "--figures", "png"], catch_exceptions=False
        )
        assert done.exit_code == 0
    none, every = json.loads((tmp_path / "tracking.json").read_text("utf-8"))["rows"]
    assert none["inverses"] == "none"
    assert every["x_rms"] < 0.1 * none["x_rms"]
    parts = json.loads((tmp_path / "contributions.json").read_text("utf-8"))["rows"]
    assert [part["inverse"] for part in parts] == list(INVERSES)
    for part in parts:
        assert part["alone"] < part["none"]
        assert part["all_but"] > part["all"]
    assert (tmp_path / "report_30hz.png").stat().st_size > 10_000
    page = (tmp_path / "report.html").read_text("utf-8")
    assert page.count("<figure>") == 2  # a grating, and one line rate
    found = re.search(r"wrong by ([\d.]+) nm rms without .* by ([\d.]+) nm with it", page)
    assert found is not None
    assert float(found[2]) < 0.1 * float(found[1])
    following = page[page.index("<h2>What to do next") : page.index("<h2>Evidence")]
    assert set(re.findall(r"afm-scan ([\w-]+)", following)) <= set(COMMANDS)
    assert following.count("afm-scan ") == 5
