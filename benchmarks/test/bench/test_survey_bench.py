"""The benches of the survey: few nights of two instruments, and few bags on Dask workers."""

import re
from pathlib import Path

from afm_scan_bench.scans import default_model, default_plant
from afm_scan_bench.survey import survey, survey_speed
from afm_scan_bench.survey.fleet import Instrument

NIGHTS, CHANGED = 8, 5


def test_the_one_that_changes_is_found_with_its_night(tmp_path: Path) -> None:
    made = default_plant(), default_model()
    still = Instrument("afm_0", 1, *made)
    changing = Instrument("afm_1", 2, *made, "parameter_shift_resonance", "x", CHANGED)
    table = survey.table(tmp_path, iter([still, changing]), NIGHTS, jobs=1)
    first, second = table.rows
    assert (first["found"], first["true"]) == ("", "")
    assert "resonance of x" in str(second["found"])
    assert table.title.startswith("16 recordings of 2 instruments: 1 of 1 changes found, 1 with")
    table.show()


def test_workers_lose_nothing_and_do_nothing_twice() -> None:
    table = survey_speed.measure(8)
    assert [row["workers"] for row in table.rows] == ["1", "2", "2, one killed"]
    for row in table.rows:
        assert (row["rows"], row["lost"], row["twice"], row["errors"]) == (8, 0, 0, 0)
    table.show()


def test_the_settings_of_dask_are_those_that_users_are_given() -> None:
    page = (Path(__file__).parents[3] / "docs/how_to/survey.md").read_text("utf-8")
    given = re.findall(r"^export DASK_(\w+)=(\S+)", page, re.MULTILINE)
    stated = {name.lower().replace("__", "."): value for name, value in given}
    assert stated == {name: str(value) for name, value in survey_speed.DASK.items()}
