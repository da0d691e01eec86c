"""``afm-scan bench`` lists what there is by how long it takes, and runs the quick ones unasked."""

import re
from importlib import import_module, util
from itertools import chain
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from afm_scan_bench.commands import bench as command


def test_help_lists_each_bench_once_and_each_is_there() -> None:
    help_text = " ".join(CliRunner().invoke(command.bench, ["--help"]).output.split())
    names = list(command.MODULES)
    for name in names:
        assert len(re.findall(rf"\b{name}[,.]", help_text)) == 1
        assert util.find_spec(command.MODULES[name]) is not None


def test_without_a_name_the_quick_ones_run(monkeypatch: pytest.MonkeyPatch) -> None:
    ran = []

    def imported(name: str) -> SimpleNamespace:
        ran.append(name.rpartition(".")[2])
        return SimpleNamespace(measure=lambda: SimpleNamespace(show=lambda: None))

    monkeypatch.setattr(command, "importlib", SimpleNamespace(import_module=imported))
    assert CliRunner().invoke(command.bench, []).exit_code == 0
    assert ran == list(chain.from_iterable(command.QUICK.values()))
    assert not set(ran) & {*command.LONG, *command.LONGEST, *command.MEASURED}
    ran.clear()
    assert CliRunner().invoke(command.bench, ["faults"]).exit_code == 0
    assert ran == ["faults"]


def test_the_quick_ones_can_measure() -> None:
    assert all(
        callable(import_module(command.MODULES[n]).measure)
        for n in chain.from_iterable(command.QUICK.values())
    )
