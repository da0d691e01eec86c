"""``afm-scan view``: a bag in a file or a browser, and refusals in one line."""

import signal
import socket
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.bag.scan_info import LINE, STREAMS, encode_line
from afm_scan_ros.bag.typestore import encode
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import LineError, cut
from afm_scan_ros.core.trajectory import desired, phases
from afm_scan_ros.features.view import viewer
from helpers.viewed import WITHOUT_ROS, command, curve

INSTALLED = viewer.find_spec("rerun") is not None
needs_viewer = pytest.mark.skipif(
    not INSTALLED, reason="the viewer is not installed: pip install 'afm_scan_ros[view]'"
)
IMAGE = "sensor_msgs/msg/Image"
NO_DISPLAY = "import os; [os.environ.pop(n, 0) for n in ('DISPLAY', 'WAYLAND_DISPLAY')]; "
NO_VIEWER = "import sys; sys.modules['rerun'] = None; "


SPEC = ScanSpec(lines=4, line_rate=100.0, samples_per_line=500, preparation="none")
RESIDUAL = LineError(1, phases(SPEC).lines.start + 500, 1e-9, 2e-9, 3e-9, 4e-9)
HEIGHTS = np.arange(8.0, dtype="<f4").reshape(2, 4) * 1e-9


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scan with the residual of a line and an image."""
    folder = tmp_path_factory.mktemp("bag") / "scan"
    info = info_of_scan(SPEC, "one", 10**18)
    with ScanWriter(folder, info) as writer:
        for name in STREAMS:
            for block in cut(desired(SPEC, 0, info.total_samples)):
                writer.add(name, block)
        writer.add_topic("/model_residual", LINE)
        writer.put("model_residual", RESIDUAL.first_sample, encode_line(info, RESIDUAL))
        image = {"encoding": "32FC1", "height": 2, "width": 4, "step": 16}
        data = {"data": np.frombuffer(HEIGHTS.tobytes(), np.uint8)}
        writer.add_topic("/scan_image/trace", IMAGE)
        writer.put("scan_image/trace", 0, encode(IMAGE, 0, {**image, **data, "is_bigendian": 0}))
    return folder


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> int:
    """The first of three ports that are free."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        found: int = probe.getsockname()[1]
    monkeypatch.setenv(viewer.PORT_VARIABLE, str(found))
    return found


def said(*arguments: object, code: str = WITHOUT_ROS) -> tuple[int, str]:
    process = command(*arguments, code=code)
    out, error = process.communicate()
    return process.returncode, out + error


@needs_viewer
def test_a_bag_goes_to_a_file_with_all_that_monitors_recorded(bag: Path, tmp_path: Path) -> None:
    file = tmp_path / "scan.rrd"
    assert said("view", bag, "--save", file) == (0, f"Wrote {file}.\n")
    times, shown = curve(file, "/displacement/desired/x")
    period = SPEC.sample_period
    expected = desired(SPEC, 0, phases(SPEC).total)
    np.testing.assert_allclose(shown, 1e6 * expected.x[np.round(times / period).astype(int)])
    assert len(curve(file, "/lines/error/rms_x")[1]) == SPEC.lines
    times, residual = curve(file, "/lines/residual/max_y")
    np.testing.assert_allclose(times, RESIDUAL.first_sample * period)
    np.testing.assert_allclose(residual, 4.0)
    np.testing.assert_allclose(image(file, "trace").reshape(HEIGHTS.shape), 1e9 * HEIGHTS)


def image(file: Path, name: str) -> np.ndarray:
    import rerun as rr  # noqa: PLC0415 - need not be installed

    path = f"/image/{name}"
    view = rr.dataframe.load_recording(file).view(
        index="scan_time", contents=path, include_semantically_empty_columns=True
    )
    (buffer,) = view.select_static(f"{path}:ImageBuffer").read_all()[0].to_pylist()
    return np.frombuffer(bytes(buffer[0]), "<f4")


@needs_viewer
@pytest.mark.evidence
def test_a_browser_on_this_machine_gets_the_page_until_ctrl_c(bag: Path, port: int) -> None:
    process = command("view", bag, "--serve")
    assert process.stdout is not None
    line = process.stdout.readline()
    assert f"http://127.0.0.1:{port + 2}" in line, process.communicate()
    with urllib.request.urlopen(f"http://127.0.0.1:{port + 2}/", timeout=10.0) as page:
        assert b"<html" in page.read()
    listening = Path("/proc/net/tcp").read_text("utf-8").splitlines()[1:]
    places = [row.split()[1] for row in listening if row.split()[3] == "0A"]
    ours = {p for p in places if int(p.rpartition(":")[2], 16) in range(port, port + 3)}
    assert {place.partition(":")[0] for place in ours} == {"0100007F"}
    assert len(ours) == 3
    code, text = said("view", bag, "--serve")
    assert code == 2
    assert f"port {port} is in use" in text
    process.send_signal(signal.SIGINT)
    process.communicate()
    assert process.returncode == 0
    time.sleep(0.2)
    assert not viewer.ports().taken


@needs_viewer
@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("view",), "view: there is no display to open a window on: start 'afm-scan view --serve'"),
        (("view", "--save", "x.rrd"), "--save: no nodes can be heard without ROS 2"),
        (("view", "--save", "x.rrd", "--serve"), "--serve and --save: give one of them"),
        (("scan", "--bag", "b", "--view"), "--view: there is no display"),
        (("scan", "--bag", "b", "--view", "x.png"), "--view x.png: give a file that ends in .rrd"),
        (("scan", "--bag", "b", "--view", "no/x.rrd"), "no does not exist: make the folder"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(
    arguments: tuple[str, ...], why: str, port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(viewer.__file__).parents[3]))
    code, text = said(*arguments, code=NO_DISPLAY + WITHOUT_ROS)
    assert (code, text.count("\n")) == (2, 1), text
    assert text.startswith(f"afm-scan: {why}")
    assert list(tmp_path.iterdir()) == []
    assert port


@needs_viewer
def test_a_port_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for text in ("none", "0", "65534", "-1"):
        monkeypatch.setenv(viewer.PORT_VARIABLE, text)
        assert said("view", code=NO_DISPLAY + WITHOUT_ROS) == (
            2,
            f"afm-scan: {viewer.PORT_VARIABLE}={text}: give a port from 1 to 65533\n",
        )


@pytest.mark.parametrize("arguments", [("view", "--serve"), ("scan", "--bag", "b", "--view")])
def test_where_the_viewer_is_not_installed_its_command_is_named(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(viewer.__file__).parents[3]))
    code, text = said(*arguments, code=NO_VIEWER + WITHOUT_ROS)
    assert code == 2
    option = arguments[-1]
    install = "rerun-sdk is not installed: pip install 'afm_scan_ros[view]'"
    assert text == f"afm-scan: {option}: {install}\n"
    assert list(tmp_path.iterdir()) == []
