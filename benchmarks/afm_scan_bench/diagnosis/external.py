"""``afm-scan close-loop`` with the scanner on another host, beside the same loop with ``sim``.

Both hosts are network namespaces on this machine, with nothing but a link between them. The
scanner's node ends with each scan, and a shell loop starts it again.
"""

import json
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from afm_scan_bench.diagnosis.closed_loop import SPEC
from afm_scan_bench.faults.injection.hosts import (
    ADDRESSES,
    NetworkLink,
    host_environment,
    on_host,
    two_hosts,
)
from afm_scan_ros.cli.processes import NodeCommand
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.drivers import settings_file
from afm_scan_ros.files import share_directory, yaml
from afm_scan_ros.files.records import to_mapping
from afm_scan_ros.report.table import Row, Table

PLANT = share_directory() / "config/plants/delay_medium.yaml"
MODEL = share_directory() / "config/model.yaml"
LINK = NetworkLink(loss=0.0, delay=1e-3, spread=0.0)
HERE, THERE = ADDRESSES
AFM_SCAN = [sys.executable, "-P", "-c", "from afm_scan_ros.cli.main import main; main()"]
UNHURRIED: Mapping[str, object] = {"real_time": False, "liveness_timeout_s": 60.0}
"""Of the scanner's node, as of those that the command starts: nobody's pace matters."""
COLUMNS = {
    "scanner": ("scanner", ""),
    "verdict": ("verdict", ""),
    "delay_us": ("delay in x, µs", ".1f"),
    "half_us": ("± µs", ".1f"),
    "before_nm": ("error of x, nm", ".1f"),
    "after_nm": ("→ nm", ".1f"),
}


def measure() -> Table:
    """Close the loop on ``delay_medium``: in simulation, and with a driver on another host.

    Raises ScanError without root, which network namespaces need.
    """
    if os.geteuid() != 0:
        raise ScanError("network namespaces need root: run this as root")
    with TemporaryDirectory() as name, working("closed loop") as announce:
        folder = Path(name)
        spec = folder / "spec.yaml"
        section = {"/**/trajectory_generator": {"ros__parameters": to_mapping(SPEC)}}
        yaml.save(spec, section, "A scan.")
        announce("simulation")
        sim = closed(["--plant", str(PLANT)], spec, folder / "sim", {}, HERE)
        announce("driver on another host")
        with two_hosts(LINK, 1), scanner_loop(folder, PLANT, *_joined(THERE)):
            words = ["--scanner", "external", "--time-scale", "0", "--model", str(MODEL)]
            joined, on = _joined(HERE)
            external = closed(words, spec, folder / "external", joined, on)
    title = "The loop closed on a plant with a delay of 50 µs in x"
    return Table("external", title, COLUMNS, [_row("sim", sim), _row("external", external)])


def _joined(host: str) -> tuple[Mapping[str, str], str]:
    """Return the environment of a process on a host, and the host."""
    return host_environment(host), host


@contextmanager
def scanner_loop(
    folder: Path, plant: Path, environment: Mapping[str, str], host: str = ""
) -> Iterator[None]:
    """Keep a scanner's node running, started anew after each scan, until a scan fails."""
    settings = folder / "stage.yaml"
    content = yaml.load(settings_file("simulated", ""))
    yaml.save(settings, {**content, "options": {"plant_file": str(plant)}}, "A scanner.")
    given = {"driver": "simulated", "settings_file": str(settings), **UNHURRIED}
    parameters = NodeCommand("scanner_driver", given).arguments()[3:]
    node = shlex.join([*AFM_SCAN, "run", "scanner_driver", *parameters])
    loop = ["/bin/sh", "-c", f"while {node}; do sleep 1; done"]
    with (folder / "scanner.txt").open("wb") as output:
        process = subprocess.Popen(  # noqa: S603 - our own words
            on_host(host, loop) if host else loop,
            stdout=output,
            stderr=output,
            env={**os.environ, **environment},
            start_new_session=True,
        )
        try:
            yield
        finally:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()


def closed(
    words: Sequence[str], spec: Path, out: Path, environment: Mapping[str, str], host: str
) -> Mapping[str, Any]:
    """Run the command and return its ``diagnosis.json``; raises ScanError where it fails."""
    command = [*AFM_SCAN, "close-loop", "--spec", str(spec), *words, "--out", str(out)]
    done = subprocess.run(  # noqa: S603 - our own words
        on_host(host, command) if environment else command,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise ScanError(f"close-loop {' '.join(words)}: {done.stderr.strip().splitlines()[-1]}")
    found: Mapping[str, Any] = json.loads((out / "diagnosis.json").read_text("utf-8"))
    return found


def _row(scanner: str, found: Mapping[str, Any]) -> Row:
    delays = [e for e in found["effects"] if (e["name"], e["axis"]) == ("delay", "x")]
    delay = delays[0]["parameters"]["delay"] if delays else {}
    low, high = delay.get("interval_95", (nan, nan))
    before, after = (
        (found[f"tracking_rms_{moment}_m"] or {}).get("x", nan) for moment in ("before", "after")
    )
    return {
        "scanner": scanner,
        "verdict": found["verdict"],
        "delay_us": 1e6 * delay.get("value", nan),
        "half_us": 0.5e6 * (high - low),
        "before_nm": 1e9 * before,
        "after_nm": 1e9 * after,
    }
