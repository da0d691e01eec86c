"""Files that a killed process left are removed; those of a living one never are."""

import fcntl
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.nodes import shared_memory
from afm_scan_ros.nodes.shared_memory import clear, hangs

PORT, SEGMENT = "fastrtps_port7411", "fastrtps_0123456789abcdef"
HOLD = """\
import mmap, sys
file = open(sys.argv[1], "r+b")
held = mmap.mmap(file.fileno(), 0) if sys.argv[2] == "mapped" else file
if sys.argv[2] == "mapped":
    file.close()
print(flush=True)
sys.stdin.read()
"""


@contextmanager
def held(path: Path, how: str) -> Iterator[None]:
    """Let another process have a file open, or mapped and closed."""
    command = [sys.executable, "-c", HOLD, str(path), how]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield
        process.kill()


def initialised(content: bytes) -> bool:
    """Whether Boost's managed segment is done with a file, or finds it broken at once."""
    word = int.from_bytes(content[:4].ljust(4, b"\0"), sys.byteorder)
    return len(content) > 0 and word not in (0, 1)


@given(content=st.binary(max_size=8) | st.integers(0, 3).map(lambda n: n.to_bytes(4, "little")))
def test_what_hangs_is_removed_and_nothing_else(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        port, mutex = Path(folder, PORT), Path(folder, f"sem.{PORT}_mutex")
        for path in (port, mutex):
            path.write_bytes(content)
        said = clear(Path(folder))
        assert port.exists() == mutex.exists() == (not said)
        if len(content) in (0, 4, 8):
            assert bool(said) == (not initialised(content))
        assert all(str(port) in sentence and "removed" in sentence for sentence in said)


@pytest.mark.parametrize("how", ["open", "mapped"])
def test_a_living_processs_file_is_kept_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    monkeypatch.setattr(shared_memory, "STARTING", 0.1)
    port = tmp_path / PORT
    port.write_bytes(bytes(8))
    with held(port, how):
        (sentence,) = clear(tmp_path)
        assert port.exists()
        assert f"fuser {port}" in sentence
    assert "removed" in clear(tmp_path)[0]
    assert not port.exists()


def test_a_file_that_is_initialised_meanwhile_is_nobodys_trouble(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = tmp_path / PORT
    port.write_bytes(bytes(8))
    monkeypatch.setattr(shared_memory.time, "sleep", lambda _: port.write_bytes(b"\2" + bytes(7)))
    with held(port, "open"):
        assert clear(tmp_path) == []
    assert not hangs(port)


def test_a_dead_participants_segment_is_removed(tmp_path: Path) -> None:
    segment, lock = tmp_path / SEGMENT, tmp_path / f"{SEGMENT}_el"
    segment.write_bytes(bytes(3_000_000))
    lock.touch()
    with lock.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert clear(tmp_path) == []
        assert segment.exists()
    assert clear(tmp_path) == [f"removed 1 segments (3 MB) of killed processes in {tmp_path}"]
    assert list(tmp_path.iterdir()) == []


@given(
    name=st.text(st.characters(exclude_characters="/\0", codec="utf-8"), min_size=1, max_size=40)
)
def test_other_files_are_left_alone(name: str) -> None:
    others = {f"x{name}"[:40], "fastrtps_port", "fastrtps_port7411_el", "sem.haltmask", f"{PORT}x"}
    with tempfile.TemporaryDirectory() as folder:
        for other in others:
            Path(folder, other).touch()
        assert clear(Path(folder)) == []
        assert {path.name for path in Path(folder).iterdir()} == others


def test_where_there_is_no_such_memory_nothing_is_done(tmp_path: Path) -> None:
    assert clear(tmp_path / "none") == []


def test_a_participant_joins_past_what_a_killed_one_left() -> None:
    """It hung for ever: the file of the first port of a domain, empty."""
    pytest.importorskip("rclpy")
    port = shared_memory.MEMORY / f"fastrtps_port{7411 + 250 * int(os.environ['ROS_DOMAIN_ID'])}"
    port.touch()
    code = (
        "from afm_scan_ros.nodes.middleware import prepare; prepare(); import rclpy;"
        " rclpy.init(); rclpy.create_node('late').destroy_node(); rclpy.shutdown()"
    )
    subprocess.run([sys.executable, "-c", code], timeout=60, check=True)
