"""The script that installs on Jazzy, step by step; apt, rosdep and ros2 are replaced."""

import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "scripts/install_on_jazzy.sh"
SETUP = """\
export AMENT_PREFIX_PATH="{prefix}" PYTHONPATH="{packages}"
"""
NOTE = """\
#!/bin/sh
echo "$(basename "$0") $*" >>"{calls}"
"""
LIST = """\
#!/bin/sh
ls "$(echo "$AMENT_PREFIX_PATH" | cut -d: -f1)/lib/$3"
"""
"""In place of ``ros2 pkg executables``, which the wheels lack."""
UNTESTED = "build: {cmake-args: [-DBUILD_TESTING=OFF]}"
"""The wheels have no linters."""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Return an environment in which the script finds the ROS of these tests, and no packages."""
    folder, calls, setup = tmp_path / "bin", tmp_path / "calls.txt", tmp_path / "setup.bash"
    folder.mkdir()
    packages = sysconfig.get_paths()["purelib"]
    setup.write_text(SETUP.format(prefix=sys.prefix, packages=packages), "utf-8")
    texts = dict.fromkeys(("apt-get", "rosdep"), NOTE.format(calls=calls))
    for name, text in {**texts, "ros2": LIST, "sudo": '#!/bin/sh\nexec "$@"\n'}.items():
        (folder / name).write_text(text, "utf-8")
        (folder / name).chmod(0o755)
    path = os.pathsep.join([str(folder), os.environ["PATH"]])
    (tmp_path / "colcon.yaml").write_text(UNTESTED, "utf-8")
    given = {"PATH": path, "ROS_SETUP": str(setup), "HOME": str(tmp_path), "PIP_NO_INDEX": "1"}
    return {**os.environ, **given, "COLCON_DEFAULTS_FILE": str(tmp_path / "colcon.yaml")}


@pytest.mark.evidence
def test_the_script_installs_what_its_last_lines_give(
    environment: dict[str, str], tmp_path: Path
) -> None:
    workspace = tmp_path / "ws"
    done = subprocess.run(
        [SCRIPT, workspace], env=environment, check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    calls = (tmp_path / "calls.txt").read_text("utf-8").splitlines()
    assert calls[:2] == [
        "apt-get update",
        "apt-get install -y python3-colcon-common-extensions python3-rosdep python3-venv",
    ]
    assert calls[-1] == (
        f"rosdep install -y --rosdistro jazzy --ignore-src --from-paths {ROOT}"
        " --skip-keys python3-bokeh-pip mcap-ros2-support python3-rosbags-pip"
    )
    executables = (ROOT / "resource/executables.txt").read_text("utf-8").splitlines()
    assert {line.split(" = ")[0] for line in executables} <= {*done.stdout.split()}
    entering = re.findall(r"^  source .*$", done.stdout, re.MULTILINE)
    assert len(entering) == 3
    program = "exec afm-scan run scan_recorder"
    begun = subprocess.run(
        ["/bin/bash", "-c", "\n".join([*entering, program])],
        env=environment,
        check=False,
        capture_output=True,
        text=True,
    )
    assert begun.returncode == 2
    assert begun.stderr.splitlines()[-1].startswith("scan_recorder: parameter bag: give the folder")
