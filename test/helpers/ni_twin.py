"""A server of NI's protocol in a process of its own, and the settings of its scanner."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
VOLTS_PER_M = 2.0**17
"""Of the twin's sensor: a power of two, so that volts become metres exactly."""
BUFFER = 0.1
"""Seconds, of the driver by default; the twin's scanner is on thereafter."""
SETTINGS = """\
amplifier: {{voltage_limit_v: 5.0, slew_limit_v_per_s: 2.0e5, ramp_down_slew_v_per_s: 40.0}}
x: {{{sensor}, output_channel: Dev1/ao0, input_channel: Dev1/ai0}}
y: {{{sensor}, output_channel: Dev1/ao1, input_channel: Dev1/ai1}}
sampling_instant: before_update
latency_samples: 0
response_time_s: 0.005
drive_resolution_v: 0.1
options: {{server: "{server}"}}
"""
SENSOR = (
    f"sensor_scale_m_per_v: {1.0 / VOLTS_PER_M!r}, sensor_offset_v: 0.0, sensor_low_v: -10.0,"
    " sensor_high_v: 10.0"
)


@contextmanager
def twin(folder: Path, *words: str) -> Iterator[str]:
    """Run the server with these words; yield its address."""
    paths = os.pathsep.join([str(ROOT), str(ROOT / "test"), os.environ.get("PYTHONPATH", "")])
    given = ["--log", str(folder / "outputs.bin"), "--volts-per-m", str(VOLTS_PER_M), *words]
    server = subprocess.Popen(
        [sys.executable, "-m", "helpers.ni_server", *given],
        env={**os.environ, "PYTHONPATH": paths},
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert server.stdout is not None
        yield f"127.0.0.1:{server.stdout.readline().strip()}"
    finally:
        server.kill()
        server.wait()


def outputs(folder: Path) -> np.ndarray:
    """Return all that was output (V), (n, 2)."""
    return np.fromfile(folder / "outputs.bin").reshape(-1, 2)


def settings_file(folder: Path, server: str) -> Path:
    """Write the settings of the twin's scanner."""
    path = folder / "stage.yaml"
    path.write_text(SETTINGS.format(sensor=SENSOR, server=server), "utf-8")
    return path
