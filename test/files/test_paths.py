"""Files that are written: missing folders are made, and what cannot be written is refused."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import afm_scan_ros as afm
from afm_scan_ros.cli.main import main
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files.columns import Signal, write_signals
from afm_scan_ros.files.paths import write_text
from afm_scan_ros.files.plant_file import save_scan

WRITERS: dict[str, Callable[[Path], object]] = {
    "model": lambda path: afm.load_model().save(path),
    "text": lambda path: write_text(path, "text"),
    "signals": lambda path: write_signals(path, [Signal("time", "s", np.zeros(3))]),
    "scan": lambda path: save_scan(path, ScanSpec(), "A scan."),
}


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
def test_missing_folders_are_made_and_a_file_in_their_place_is_named(
    tmp_path: Path, write: Callable[[Path], object]
) -> None:
    path = tmp_path / "new/folder/file.yaml"
    write(path)
    assert path.stat().st_size
    with pytest.raises(afm.InputError, match=r"^\S*file.yaml/in/it.yaml: .*: give another file or"):
        write(path / "in/it.yaml")


@pytest.mark.parametrize("name", [".", "model.npz"])
def test_a_model_is_not_written_where_its_arrays_or_a_folder_are(tmp_path: Path, name: str) -> None:
    with pytest.raises(afm.InputError, match=r"give the name of a file, as model\.yaml"):
        afm.load_model().save(tmp_path / name)
    assert not list(tmp_path.iterdir())
    assert not tmp_path.with_suffix(".npz").exists()


COMMANDS = [
    "analyze BAG --json OUT",
    "adapt BAG --model M --out OUT",
    "diagnose BAG --model M --out OUT",
    "export BAG --to OUT.csv",
    "grating I.npz --pitch 1um --out OUT",
    "identify BAG --out OUT",
    "import-csv T.csv --bag OUT",
    "invert --model M --desired T.csv --out OUT",
    "learn --out OUT",
    "plan --export OUT",
    "scan --bag OUT",
]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.split()[0])
@pytest.mark.parametrize("out", ["", "a_file/out"])
def test_a_command_refuses_its_output_before_it_reads_anything(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: str,
    out: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a_file").write_text("not a folder", "utf-8")
    given = command if out else command.replace("OUT.csv", "OUT")
    words = [word.replace("OUT", out) for word in given.split()]
    monkeypatch.setattr(sys, "argv", ["afm-scan", *words])
    with pytest.raises(SystemExit, match="2"):
        main()
    said = capsys.readouterr().err
    expected = f"{tmp_path / 'a_file'} is no folder" if out else "the path is empty"
    assert expected in said
    assert said.count("\n") == 1
