"""Races have their rows; no test asserts how fast anything is."""

import numpy as np
import pytest

from afm_scan_bench.scans import default_model
from afm_scan_bench.speed import speed_diagnosis, speed_inverses
from afm_scan_bench.speed.timing import chain, growth, preisach
from afm_scan_bench.speed.timing.race import Task, race
from afm_scan_bench.speed.timing.ratios import COLUMNS
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.registry import CATALOGUE
from afm_scan_ros.report.table import Table


def test_every_race_has_its_row() -> None:
    rows = [
        *chain.rows(samples=3000, streamed=3000, turns=1),
        *preisach.rows(samples=500, relayed=20, turns=1),
        *growth.rows(lengths=(12_000,), loops=3000, turns=1),
    ]
    assert [row["what"] for row in rows if row["ratio"] <= 0.0] == []
    assert len(rows) == 3 + 18 + 2
    Table("speed", "", COLUMNS, rows).show()


def test_a_target_of_so_many_times_as_fast_is_theirs_over_ours() -> None:
    one, ten = (Task(lambda n=n: sum(range(n)), 1) for n in (10_000, 300_000))
    assert (
        race("", one, "", ten, "≥ 2", 3)["ratio"] > 1.0 > race("", one, "", ten, "≤ 2", 3)["ratio"]
    )


def test_the_relays_are_the_model_on_its_levels() -> None:
    surface = default_model().x.hysteresis.forward
    drive = np.random.default_rng(1).choice(surface.levels, 300)
    effect = Preisach(surface)
    expected = effect.apply(effect.saturated(), drive)[1]
    assert preisach.relay_grid(surface, drive) == pytest.approx(expected, abs=1e-9)


def test_a_diagnosis_has_its_row() -> None:
    (row,) = speed_diagnosis.rows((2,))
    assert row["growth"] == 1.0
    assert row["verdict"] != "model_sufficient"


def test_every_form_of_every_effect_has_its_row() -> None:
    rows = list(speed_inverses.rows(samples=1000, turns=1))
    forms = sum(len(each.forms) for each in CATALOGUE)
    assert len({row["effect"] for row in rows}) == 1 + forms + len(speed_inverses.BESIDE_HEAT)
    assert min(row["us"] for row in rows) > 0.0
