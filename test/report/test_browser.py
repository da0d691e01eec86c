"""Each of the eight reports in a real browser, which is Debian's chromium."""

import shutil
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.report.page import ReportPage
from afm_scan_ros.report.picture import Curve, Map, Panel, Picture
from helpers.given_commands import refuse_unknown
from helpers.report_pages import REPORTS, SPEC, of_scan, of_survey, recorded

pytest.importorskip("playwright", reason="playwright is not installed: it drives chromium")

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright

CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="chromium is not installed: apt-get install chromium"
)
LARGEST = 3_000_000
"""Bytes of a report."""
READY = "window.Bokeh && Bokeh.documents.length === 1 && Bokeh.documents[0].is_idle"
DESK: ViewportSize = {"width": 1280, "height": 800}
PHONE: ViewportSize = {"width": 400, "height": 800}
START = "panel => plotOf(panel).x_range.start"
"""Where a panel begins, by the page's own function."""
FIRST = f"({START})(document.querySelector('.panel'))"
BACKGROUND = "getComputedStyle(document.body).backgroundColor"


Made = Callable[[str], Path]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the reports, each under the name of its command."""
    return tmp_path_factory.mktemp("reports")


@pytest.fixture(scope="module")
def made(folder: Path) -> Made:
    """Return a function that writes the report of a command, once."""
    bag = recorded(folder / "bag")

    @cache
    def make(name: str) -> Path:
        REPORTS[name](bag).write(folder / f"{name}.html", None)
        return folder / f"{name}.html"

    return make


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as started:
        # Root has no sandbox; the pages are our own.
        yield started.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """An empty page, without a network; what it writes to the console fails the test."""
    said: list[str] = []
    context = browser.new_context(viewport=DESK, offline=True)
    shown = context.new_page()
    shown.on(
        "request", lambda asked: None if asked.url.startswith("file:") else said.append(asked.url)
    )
    shown.on("pageerror", lambda error: said.append(str(error)))
    shown.on("console", lambda m: said.append(m.text) if m.type in {"error", "warning"} else None)
    yield shown
    context.close()
    assert said == []


def opened(page: Page, file: Path) -> Page:
    page.goto(file.as_uri())
    page.wait_for_function(READY)
    return page


def serious(page: Page, **options: object) -> list[dict[str, Any]]:
    """Return what axe finds that keeps someone from reading."""
    found = Axe().run(page, options=options).response["violations"]
    return [each for each in found if each["impact"] in {"serious", "critical"}]


EACH = [
    pytest.param(name, marks=[] if name == "analyze" else pytest.mark.evidence) for name in REPORTS
]
"""All reports, of which one is opened in the suite, and the others in the evidence."""


@pytest.mark.parametrize("name", EACH)
def test_each_report_answers_zooms_and_is_read_by_everyone(
    name: str, page: Page, made: Made
) -> None:
    file = made(name)
    opened(page, file)
    _answers_above_the_fold(page)
    page.screenshot(path=file.with_suffix(".png"))
    for command in page.locator("pre").all_inner_texts():
        refuse_unknown(command)
    _zooms_by_keys(page)
    page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
    assert serious(page) == []
    light = page.evaluate(BACKGROUND)
    page.click("#theme")
    assert page.get_attribute("#theme", "aria-pressed") == "true"
    assert page.evaluate(BACKGROUND) != light
    assert serious(page, runOnly=["color-contrast"]) == []
    page.set_viewport_size(PHONE)
    page.wait_for_function(f"document.documentElement.scrollWidth <= {PHONE['width']}")
    assert file.stat().st_size < LARGEST


def _answers_above_the_fold(page: Page) -> None:
    answer = page.locator(".answer p").last.bounding_box()
    panel = page.locator("figure .panel canvas").first.bounding_box()
    assert answer is not None
    assert panel is not None
    assert answer["height"] > 0
    assert answer["y"] + answer["height"] <= panel["y"]
    assert panel["y"] + panel["height"] <= DESK["height"]
    assert page.locator(".answer p").count() <= 3
    assert page.locator("h2").first.inner_text() == "What to do next"


def _zooms_by_keys(page: Page) -> None:
    before = page.evaluate(FIRST)
    page.locator("figure .panel").first.focus()
    page.keyboard.press("+")
    assert page.evaluate(FIRST) > before
    page.keyboard.press("0")
    page.wait_for_function(f"before => {FIRST} <= before", arg=before)


def test_a_value_is_shown_and_a_box_zooms_every_panel_over_the_same_time(
    page: Page, made: Made
) -> None:
    opened(page, made("analyze"))
    panels = page.locator("figure").first.locator(".panel")
    box = panels.nth(0).bounding_box()
    assert box is not None
    left, middle = box["x"], box["y"] + 0.45 * box["height"]
    told = page.locator(".bk-tooltip-row-label", has_text="time in ms")
    page.mouse.move(left + 0.40 * box["width"], middle)
    page.mouse.move(left + 0.41 * box["width"], middle)
    told.first.wait_for(state="visible")
    before = [panels.nth(k).evaluate(START) for k in range(5)]
    page.mouse.down()
    page.mouse.move(left + 0.7 * box["width"], middle + 5, steps=4)
    page.mouse.up()
    page.wait_for_function(f"before => {FIRST} > before", arg=before[0])
    after = [panels.nth(k).evaluate(START) for k in range(5)]
    assert min(after) > max(before)
    assert max(after) == min(after)


def picked(page: Page) -> Any:  # noqa: ANN401 - a list of numbers
    """Values of the line that the demonstration's second row shows."""
    return page.evaluate(
        "() => { const plot = plotOf(document.querySelectorAll('figure .panel')[2]);"
        " return [...plot.renderers[1].data_source.data.y]; }"
    )


@pytest.mark.evidence
def test_a_line_of_an_image_that_is_picked_shows_its_traces(page: Page, made: Made) -> None:
    opened(page, made("demo"))
    before = picked(page)
    image = page.locator("figure .panel").first.bounding_box()
    assert image is not None
    page.mouse.click(image["x"] + 0.5 * image["width"], image["y"] + 0.3 * image["height"])
    page.wait_for_timeout(400)  # a tap is one only when no second one follows
    tapped = picked(page)
    assert tapped != before
    slider, number = page.locator("[data-line-of]").first, page.locator("output").first
    assert slider.input_value() == number.inner_text() == "5"  # of six, counted from below
    slider.fill("1")
    assert number.inner_text() == "1"
    assert picked(page) != tapped


def test_an_offset_is_seen_as_one(page: Page, folder: Path) -> None:
    """The first range of an error holds zero, however far the error is from it."""
    error = Curve(np.arange(100.0), 50.0 + np.sin(np.arange(100.0)))
    picture = Picture("error", "", [[Panel([error], "time in s", "error in nm", level=0.0)]])
    file = folder / "offset.html"
    ReportPage("Offset", ["An answer."], picture, [], []).write(file, None)
    opened(page, file)
    start, end = page.evaluate(
        "() => { const range = plotOf(document.querySelector('.panel')).y_range;"
        " return [range.start, range.end]; }"
    )
    assert start <= 0.0
    assert end >= 51.0


@pytest.mark.parametrize("view", [DESK, PHONE], ids=["desk", "phone"])
@pytest.mark.parametrize(("wide", "shape"), [(20.0, 1.0), (40.0, 2.0), (2000.0, 3.0)])
def test_pixels_of_an_image_are_square(
    page: Page, folder: Path, view: ViewportSize, wide: float, shape: float
) -> None:
    """But for an image so long that it would be a line."""
    image = Map(np.eye(8), (0.0, wide, 0.0, 20.0), "height in nm", 0.0, 1.0)
    picture = Picture("image", "", [[Panel([image], "x in µm", "y in µm")] * 2])
    file = folder / "image.html"
    ReportPage("Image", ["An answer."], picture, [], []).write(file, None)
    page.set_viewport_size(view)
    opened(page, file)
    across, up = page.evaluate(
        "() => { const of = plotOf(document.querySelector('.panel'));"
        " return [of.inner_width, of.inner_height]; }"
    )
    assert across / up == pytest.approx(shape, rel=0.02)


@pytest.mark.evidence
def test_a_band_of_the_residual_that_is_picked_shows_its_spectrum(page: Page, made: Made) -> None:
    opened(page, made("diagnose"))
    panels = page.locator("figure").first.locator(".panel")
    box = panels.nth(0).bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.wait_for_timeout(400)
    shown = panels.nth(1).evaluate("each => [plotOf(each).x_range.start, plotOf(each).x_range.end]")
    edges = panels.nth(0).evaluate("each => [...plotOf(each).renderers[0].data_source.data.x]")
    bands = pairwise(edges)
    assert shown in [pytest.approx(band, rel=1e-4) for band in bands]


@pytest.mark.evidence
def test_links_lead_on(page: Page, folder: Path, made: Made) -> None:
    opened(page, made("close-loop"))
    (folder / "round_1").mkdir(exist_ok=True)
    shutil.copy(made("diagnose"), folder / "round_1/report.html")
    page.click("summary")
    page.click("text=Diagnosis of round 1")
    page.wait_for_function(READY)
    assert page.title() == "Diagnosis of a scanner's residual"


def test_everything_is_printed(page: Page, made: Made) -> None:
    opened(page, made("analyze"))
    assert page.title() == page.locator("h1").inner_text() == "Scan bag"
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("details:not([open])").count() == 0
    page.emulate_media(media="print")
    assert not page.locator("#theme").is_visible()


@pytest.mark.evidence
def test_a_survey_is_sorted_searched_and_leads_to_its_recordings(page: Page, made: Made) -> None:
    opened(page, made("survey"))
    rows, status = page.locator(".listing tbody tr"), page.locator(".listing [role=status]")
    assert rows.count() == 50
    assert status.inner_text() == "1 to 50 of 400"
    page.click("[data-turn='1']")
    assert status.inner_text() == "51 to 100 of 400"
    for direction in ("ascending", "descending"):
        page.click("th button:text('time')")
        assert page.locator(f"th[aria-sort={direction}] button").inner_text() == "time"
    times = rows.locator("td:nth-child(3)").all_inner_texts()
    assert times == sorted(times, reverse=True)
    page.fill(".listing input", "afm3 effect found")
    assert status.inner_text() == "1 to 49 of 49"
    page.click(".listing tbody tr:first-child button")
    told = page.locator(".listing .opened").inner_text()
    assert "gain 1.0100 ± 0.0010" in told
    page.fill(".listing input", "night_00000 afm0")
    made("demo")  # the report that all rows of this survey lead to
    page.click(".listing tbody a")
    page.wait_for_function(READY)
    assert page.title() == "A piezoscanner without and with compensation"


@pytest.mark.evidence
def test_trends_are_those_of_the_instrument_that_is_chosen(page: Page, made: Made) -> None:
    opened(page, made("survey"))
    values = "() => [...plotOf(document.querySelector('.panel')).renderers[4].data_source.data.y]"
    changed = page.evaluate(values)
    assert page.input_value("[data-variant-of]") == "afm3"
    assert max(changed) > 1.008
    page.select_option("[data-variant-of]", "afm0")
    assert max(page.evaluate(values)) < 1.002


@pytest.mark.evidence
def test_ten_thousand_recordings_are_sorted_again_and_again(page: Page, folder: Path) -> None:
    file = folder / "many.html"
    of_survey(10_000, 20).write(file, None)
    opened(page, file)
    page.evaluate(
        "() => { const sort = document.querySelector('[data-sort=\"3\"]');"
        " for (let k = 0; k < 10; k++) { sort.click(); } }"
    )
    assert page.locator(".listing tbody tr").count() == 50


@pytest.mark.evidence
def test_a_scan_of_a_million_samples_fits_into_one_report(page: Page, folder: Path) -> None:
    spec = evolve(SPEC, lines=256, samples_per_line=4000, line_rate=2.0, preparation="none")
    file = folder / "long.html"
    of_scan(recorded(folder / "long", spec)).write(file, None)
    assert file.stat().st_size < LARGEST
    opened(page, file)
