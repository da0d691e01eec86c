"""Pictures of notebooks are those of reports, and images where no script runs."""

import numpy as np
import pytest

from afm_scan_ros import notebook
from afm_scan_ros.core.types import Step
from afm_scan_ros.notebook import Curve, Map, Panel, html_of, progress_line, show
from afm_scan_ros.report.picture import Picture

Shown = list[dict[str, str]]


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> Shown:
    """What a notebook is told to display, in a kernel that has begun anew."""
    display = pytest.importorskip("IPython.display", reason="the extra docs is not installed")
    found: Shown = []

    class Line:
        def update(self, data: dict[str, str], *, raw: bool) -> None:
            assert raw
            found.append(data)

    def note(data: dict[str, str], **_: object) -> Line:
        found.append(data)
        return Line()

    monkeypatch.setattr(display, "display", note)
    notebook._load_library.cache_clear()  # noqa: SLF001 - as a kernel that begins
    return found


def test_a_picture_is_an_image_until_the_library_draws_it() -> None:
    time = np.linspace(0.0, 1.0, 500)
    curve, of = Curve(time, np.sin(9.0 * time), "a sine"), "A sine and its <image>"
    image = Map(np.outer(time[:64], time[:64]), (0.0, 1.0, 0.0, 1.0), "nm", 0.0, 1.0)
    rows = [[Panel([curve], "time in s", "x in nm")], [Panel([image], "x in µm", "y in µm")]]
    page = html_of(Picture("picture", of, rows))
    assert '<img alt="A sine and its &lt;image&gt;" src="data:image/png;base64,' in page
    assert page.count("data-root-id") == 2
    assert "a sine</span>" in page
    assert len(page) < 100_000


def test_the_library_comes_once(shown: Shown) -> None:
    panel = Panel([Curve(np.arange(9.0), np.arange(9.0))], "V", "µm")
    show(panel, caption="a line")
    show([panel, panel], caption="two lines")
    sizes = [len(each["text/html"]) for each in shown]
    assert sizes[0] > 1e6
    assert max(sizes[1:]) < 1e5
    assert len(sizes) == 3


def test_progress_stays_one_line(shown: Shown) -> None:
    report = progress_line()
    report(Step("x: looking for modes", 0, 2))
    assert [each["text/plain"] for each in shown] == ["begun", "x: looking for modes (0 s)"]
