"""No file of a user is executed or unpickled: neither by the code's text nor in trial."""

import ast
import pickle
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.cli.main import main
from afm_scan_ros.files import share_directory

ROOT = Path(__file__).parents[1]
CONFIG = share_directory() / "config"
EXECUTE = {"eval", "exec", "compile"}
UNPICKLE = {"pickle", "cPickle", "shelve", "marshal", "dill", "joblib", "cloudpickle"}


def test_no_code_executes_or_unpickles_what_it_reads() -> None:
    for path in (ROOT / "afm_scan_ros").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [each.name for each in node.names] + [getattr(node, "module", "") or ""]
                assert not {name.split(".")[0] for name in names} & UNPICKLE, path
            if isinstance(node, ast.Call):
                see_call(path, ast.unparse(node.func), node.keywords)


def see_call(path: Path, named: str, keywords: list[ast.keyword]) -> None:
    options = {each.arg: ast.unparse(each.value) for each in keywords}
    assert named not in EXECUTE, path
    assert options.get("allow_pickle", "False") == "False", path
    assert options.get("shell", "False") == "False", path
    if named == "yaml.load" and options:  # the package's own takes none
        assert options["Loader"] in {"_Loader", "yaml.BaseLoader"}, path


class Canary:
    """Leaves a file behind where it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return Path.touch, (self.path,)


def array(canary: Canary) -> np.ndarray:
    holder = np.empty((1, 1), dtype=object)
    holder[0, 0] = canary
    return holder


def in_model(folder: Path, canary: Canary) -> list[object]:
    path = folder / "model.yaml"
    path.write_text((CONFIG / "model.yaml").read_text("utf-8"), "utf-8")
    arrays = dict(np.load(CONFIG / "model.npz"))
    np.savez(folder / "model.npz", **(arrays | {"x_forward": array(canary)}))
    return ["scan", "--model", path, "--bag", folder / "bag"]


def as_archive(folder: Path, canary: Canary) -> list[object]:
    given = in_model(folder, canary)
    (folder / "model.npz").write_bytes(pickle.dumps(canary))
    return given


def as_member(folder: Path, canary: Canary) -> list[object]:
    given = in_model(folder, canary)
    with zipfile.ZipFile(folder / "model.npz", "w") as archive:
        archive.writestr("x_forward.npy", pickle.dumps(canary))
    return given


def as_table(folder: Path, canary: Canary) -> list[object]:
    np.save(folder / "table.npy", array(canary))
    columns = ["--columns", "drive_x=1:V", "--sample-rate", "10"]
    return ["import-csv", folder / "table.npy", *columns, "--bag", folder / "bag"]


def as_bag(folder: Path, canary: Canary) -> list[object]:
    (folder / "bag.mcap").write_bytes(pickle.dumps(canary))
    return ["analyze", folder / "bag.mcap"]


def in_yaml(name: str) -> Callable[[Path, Canary], list[object]]:
    def make(folder: Path, canary: Canary) -> list[object]:
        words = f"a: !!python/object/apply:pathlib.Path.touch [{canary.path}]\n"
        words += f"b: !!python/object/apply:os.system ['touch {canary.path}']\n"
        (folder / f"{name}.yaml").write_text(words, "utf-8")
        return ["scan", f"--{name}", folder / f"{name}.yaml", "--bag", folder / "bag"]

    return make


def in_metadata(folder: Path, canary: Canary) -> list[object]:
    (folder / "bag").mkdir()
    in_yaml("spec")(folder, canary)
    (folder / "spec.yaml").rename(folder / "bag/metadata.yaml")
    return ["analyze", folder / "bag"]


HOSTILE = {
    "array of a model": in_model,
    "archive that is a pickle": as_archive,
    "member that is a pickle": as_member,
    "table": as_table,
    "bag that is a pickle": as_bag,
    "metadata": in_metadata,
    **{name: in_yaml(name) for name in ("spec", "model", "plant")},
}


@pytest.mark.parametrize("make", HOSTILE.values(), ids=HOSTILE)
def test_no_file_does_what_it_says(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    make: Callable[[Path, Canary], list[object]],
) -> None:
    canary = Canary(tmp_path / "canary")
    given = make(tmp_path, canary)
    monkeypatch.setattr(sys, "argv", ["afm-scan", *map(str, given)])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not canary.path.exists()


def test_the_canary_would_have_sung(tmp_path: Path) -> None:
    pickle.loads(pickle.dumps(Canary(tmp_path / "canary")))  # noqa: S301 - what others must not do
    assert (tmp_path / "canary").exists()
