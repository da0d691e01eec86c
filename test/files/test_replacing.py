"""Whoever is killed while a file is written leaves the old one or the new one."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.arrays import SEAL
from afm_scan_ros.files.model_file import load_model, model_hash
from afm_scan_ros.files.paths import replacing, write_text

CONFIG = share_directory() / "config"
SAVE_FOR_EVER = """
import sys, afm_scan_ros as afm
models = [afm.load_model(path) for path in sys.argv[2:]]
print("begun", flush=True)
while True:
    for model in models:
        model.save(sys.argv[1])
"""


def hash_of(path: Path) -> str:
    return model_hash(load_model(path))


def other_model(folder: Path) -> Path:
    """Return the file of a model with other arrays."""
    model = afm.load_model()
    axis = model.scanner.x
    direct = evolve(axis.hysteresis.direct, values=1.01 * axis.hysteresis.direct.values)
    changed = evolve(axis, hysteresis=evolve(axis.hysteresis, direct=direct))
    path = folder / "other.yaml"
    afm.Model(evolve(model.scanner, x=changed), "").save(path)
    return path


@pytest.mark.evidence
def test_a_model_outlives_whoever_saves_it(tmp_path: Path) -> None:
    path, other = tmp_path / "model.yaml", other_model(tmp_path)
    for trial in range(6):
        words = [sys.executable, "-c", SAVE_FOR_EVER, path, CONFIG / "model.yaml", other]
        with subprocess.Popen(words, stdout=subprocess.PIPE) as saving:
            assert saving.stdout
            assert saving.stdout.readline()
            while not path.exists():
                time.sleep(0.01)
            time.sleep(0.05 + 0.037 * trial)
            saving.send_signal(signal.SIGKILL)
        assert afm.load_model(path).axes == ("x", "y")


@pytest.mark.parametrize("at", ["yaml.save", "Path.replace"])
def test_a_model_killed_between_its_files_is_the_old_or_the_new(tmp_path: Path, at: str) -> None:
    """After the arrays were written, and after the model file took its place."""
    path, other = tmp_path / "model.yaml", other_model(tmp_path)
    shutil.copy(CONFIG / "model.yaml", path)
    shutil.copy(CONFIG / "model.npz", tmp_path)
    code = f"""
import os, sys, afm_scan_ros as afm
from pathlib import Path
from afm_scan_ros.files import model_file, yaml
model, replace = afm.load_model(sys.argv[2]), Path.replace
if {at!r} == "yaml.save":
    model_file.yaml.save = lambda *_: os._exit(9)
else:
    def stop(path, target):
        if Path(target).name == "model.npz":
            os._exit(9)
        return replace(path, target)
    Path.replace = stop
model.save(sys.argv[1])
"""
    ended = subprocess.run([sys.executable, "-c", code, path, other], check=False)
    assert ended.returncode == 9
    new = other if at == "Path.replace" else CONFIG / "model.yaml"
    assert hash_of(path) == hash_of(new)
    afm.load_model(other).save(path)  # and can be saved again
    assert hash_of(path) == hash_of(other)


def test_an_edit_of_a_model_is_meant_where_its_digest_is_deleted(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    afm.load_model().save(path)
    path.write_text(f"# a remark\n{path.read_text()}")
    before = hash_of(path)
    content = path.read_text()
    place = content.index("gains: [") + len("gains: [")
    path.write_text(f"{content[:place]}0.001{content[content.index(',', place) :]}")
    with pytest.raises(InputError, match=f"edited after it was written.*delete its line {SEAL}"):
        load_model(path)
    path.write_text(re.sub(f"{SEAL}: .*\n", "", path.read_text()))
    assert hash_of(path) != before


def _fail_within(beside: Path) -> None:
    beside.write_text("half")
    raise RuntimeError


def test_a_failure_leaves_the_old_file_and_nothing_beside(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(RuntimeError), replacing(path) as beside:
        _fail_within(beside)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_and_a_device_stay_what_they_are(tmp_path: Path) -> None:
    path, link = tmp_path / "a.txt", tmp_path / "link"
    path.write_text("old")
    link.symlink_to(path)
    write_text(link, "new")
    assert (path.read_text(), link.is_symlink()) == ("new", True)
    write_text(Path(os.devnull), "gone")
    assert not Path(os.devnull).is_file()
