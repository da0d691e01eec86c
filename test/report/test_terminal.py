"""Text of files on the terminal is shown, and does nothing."""

import logging
import unicodedata
from pathlib import Path

import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.bag.writer import write_record
from afm_scan_ros.cli.main import main
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.report.table import Rows, Table
from afm_scan_ros.report.terminal import LONGEST, say, showing_log, visible

HOSTILE = "[/b][red]a\x1b[2Jb\nwarning: c\x9bd\u202ee\u2028f\x00g\udc80"
IN_UTF_8 = HOSTILE.removesuffix("\udc80")
SPEC = ScanSpec(lines=2, samples_per_line=400, line_rate=10.0, preparation="none")


@given(st.text(st.characters()))
def test_what_is_shown_does_nothing(text: str) -> None:
    shown = visible(text)
    assert all(c.isprintable() or unicodedata.category(c) == "Zs" for c in shown)
    shown.encode()


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=LONGEST))
def test_plain_text_is_shown_as_it_is(text: str) -> None:
    assert visible(text) == text


def test_a_long_line_is_shortened_and_says_so() -> None:
    shown = visible(LONGEST * "a" + 10 * "b" + LONGEST * "c")
    assert len(shown) < LONGEST + 100
    assert f"{LONGEST + 10} characters" in shown


def harmless(shown: str, lines: int) -> None:
    assert not set(shown) & set("\x1b\x9b\u202e\u2028\x00")
    assert "[/b]" in shown
    assert len(shown.splitlines()) == lines


def test_no_cell_title_or_line_is_markup(capsys: pytest.CaptureFixture[str]) -> None:
    Rows((), [("a", HOSTILE)], HOSTILE).show()
    harmless(capsys.readouterr().out.replace(" ", ""), 2)
    Table("t", HOSTILE, {"a": (HOSTILE, "")}, [{"a": HOSTILE}]).show()
    assert capsys.readouterr().out.count("[/b]") == 3
    say(HOSTILE)
    harmless(capsys.readouterr().out, 1)


def test_what_is_logged_is_one_line_and_shown_once(capsys: pytest.CaptureFixture[str]) -> None:
    with showing_log(), showing_log():
        logging.getLogger("afm_scan_ros.any").warning("%s", IN_UTF_8)
    harmless(capsys.readouterr().err, 1)


def test_a_hostile_scan_id_is_shown_on_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = desired(SPEC, 0, total_samples(SPEC))
    info = evolve(info_of_scan(SPEC, IN_UTF_8, 0), model_hash="[/]<b>")
    names = ("desired_displacement", "achieved_displacement")
    write_record(tmp_path / "bag", info, dict.fromkeys(names, whole))
    page = tmp_path / "a.html"
    words = ["afm-scan", "analyze", str(tmp_path / "bag"), "--report", str(page)]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code in (0, None)
    out = capsys.readouterr().out
    assert not set(out) & set("\x1b\x9b\u202e\u2028\x00")
    assert r"[/b][red]a\x1b[2Jb\nwarning: c" in out.replace("\n", " ").replace("  ", " ")
    assert ">[/]&lt;b&gt;<" in page.read_text("utf-8")
