"""The page of settings: each number that decides, with its unit, meaning and source."""

from collections.abc import Iterator

from attrs import fields

from afm_scan_ros.core.diagnosis.settings import (
    DecimationSettings,
    DescentSettings,
    EvidenceSettings,
    InitialStateSettings,
    LikelihoodSettings,
    LimitSettings,
    MismatchSettings,
    PartingSettings,
    PosteriorSettings,
    SearchSettings,
    StructureSettings,
    VarianceSettings,
)
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.intersample import IntersampleSettings
from afm_scan_ros.core.prediction import ExtensionSettings
from afm_scan_ros.drivers.safety import SafetySettings
from afm_scan_ros.features.view.viewer import ViewSettings
from afm_scan_ros.report.reduction import DrawingSettings

SETTINGS: tuple[type, ...] = (
    SafetySettings,
    FitSettings,
    IntersampleSettings,
    DescentSettings,
    PartingSettings,
    DecimationSettings,
    PosteriorSettings,
    SearchSettings,
    VarianceSettings,
    LikelihoodSettings,
    EvidenceSettings,
    LimitSettings,
    InitialStateSettings,
    MismatchSettings,
    StructureSettings,
    ExtensionSettings,
    DrawingSettings,
    ViewSettings,
)

INTRODUCTION = """\
# Settings

A number that decides is a field of a settings class, an instance of which is an argument of what it
decides on. Numbers that a lab sets for itself are [parameters of the nodes](nodes.md).
"""
HEAD = "| field | default | unit | meaning | source |\n| --- | --- | --- | --- | --- |"


def settings_page() -> str:
    """Return the page in Markdown, a table for each class."""
    return "\n".join([INTRODUCTION, *(line for each in SETTINGS for line in _section(each))])


def _section(settings: type) -> Iterator[str]:
    summary = str(settings.__doc__).partition("\n")[0]
    yield f"## {settings.__name__}\n\n{summary} (`{settings.__module__}`)\n"
    yield HEAD
    for each in fields(settings):
        facts = each.metadata
        cells = f"{each.default:g}", facts["unit"], facts["meaning"], facts["source"]
        yield f"| `{each.name}` | {' | '.join(cells)} |"
    yield ""
