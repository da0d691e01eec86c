"""Shows a bag: its streams, and what else monitors recorded."""

import time
from collections.abc import Callable
from pathlib import Path

from afm_scan_ros.bag.folder import bag_files
from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.bag.monitored import IMAGE, heights, line_of, way_of
from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.bag.scan_info import LINE
from afm_scan_ros.bag.typestore import decode
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, DRIVE, end
from afm_scan_ros.features.view.blocks import ShownBlocks
from afm_scan_ros.features.view.screen import Screen, open_screen
from afm_scan_ros.features.view.settings import ViewSettings

RESIDUAL = "model_residual"


def show_bag(
    bag: Path, where: str, settings: ViewSettings, wanted: Callable[[], bool]
) -> tuple[str, ...]:
    """Show a bag as long as it is ``wanted``; return what is to be known of it.

    Raises InputError where it holds no stream, or a damaged one.
    """
    recording = read_scan(bag)
    names = [name for name in (DESIRED, DRIVE, ACHIEVED) if name in recording.topics]
    if not names:
        raise InputError(f"{bag}: holds no {DESIRED}, {DRIVE} or {ACHIEVED} to show")
    screen = open_screen(recording.info, where, settings)
    shown, due, sample = ShownBlocks(screen, settings.pixels), 0.0, 0
    for run in recording.blocks(*names):
        for name, trace in zip(names, run, strict=True):
            shown.add(name, trace)
        sample = end(run[0])
        if time.monotonic() >= due:
            screen.state("bag", "is read", sample, "")
            screen.refresh()
            due = time.monotonic() + settings.refresh
        if not wanted():
            break
    _show_findings(recording, screen)
    for warning in recording.warnings:
        screen.say(warning, sample)
    screen.state("bag", "is shown", sample, "")
    screen.refresh(last=True)
    return recording.warnings


def _show_findings(recording: ScanRecording, screen: Screen) -> None:
    """Show the residual of each line, and images, where they were recorded."""
    for message in (m for file in bag_files(recording.path)[0] for m in messages(file)):
        if message.type_name == LINE and message.topic.endswith(f"/{RESIDUAL}"):
            screen.line(RESIDUAL, line_of(recording.info, decode(LINE, message.cdr)))
        elif message.type_name == IMAGE and (way := way_of(message.topic)):
            screen.image(way, heights(decode(IMAGE, message.cdr)))
