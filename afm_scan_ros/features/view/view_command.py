"""``afm-scan view``: shows a running scan, or a bag, in a window, a browser or a file."""

import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import click

from afm_scan_ros.cli.execution import nodes_can_run
from afm_scan_ros.cli.options import RECORD, warn
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.view.viewer import (
    FILE_SUFFIX,
    WINDOW,
    Viewer,
    ViewSettings,
    open_window,
    ports,
    refuse,
    refuse_uninstalled,
    serving,
)
from afm_scan_ros.pipeline import handling
from afm_scan_ros.report.terminal import say


@click.command()
@click.argument("bag", required=False, type=RECORD)
@click.option("--serve", is_flag=True, help="Show it in a browser on this machine until Ctrl-C.")
@click.option("--save", metavar=f"FILE{FILE_SUFFIX}", help="Write it to a file in place of that.")
def view(bag: Path | None, save: str | None, *, serve: bool) -> None:
    """Show a running scan, or BAG, in a viewer.

    Without BAG it shows what nodes of ROS publish, and each scan with --view.
    """
    if serve and save:
        raise InputError("--serve and --save: give one of them")
    _refuse(save, serve=serve)
    listens = bag is None and nodes_can_run()
    if save and bag is None and not listens:
        raise InputError(
            f"--save: no nodes can be heard without ROS 2: name a bag, or scan with --view {save}"
        )
    settings, interrupted = ViewSettings(), []
    os.nice(settings.niceness)
    with ExitStack() as open_ends:
        open_ends.enter_context(handling(lambda number, _: interrupted.append(number)))
        viewer = _opened(open_ends, settings, save, serve=serve)

        def wanted() -> bool:
            return not interrupted and (viewer is None or viewer.poll() is None)

        if bag is not None:
            _show_bag(bag, save or WINDOW, settings, wanted)
        elif listens:
            from afm_scan_ros.features.view.listening import listen  # noqa: PLC0415 - needs ROS

            listen(save or WINDOW, settings, wanted)
        else:
            say("Scans with 'afm-scan scan --view' are shown here.")
        while serve and wanted():
            time.sleep(settings.refresh)


def _refuse(save: str | None, *, serve: bool) -> None:
    if serve:
        refuse_uninstalled("--serve")
    else:
        refuse(save or WINDOW, "--save" if save else "view")


def _opened(
    open_ends: ExitStack, settings: ViewSettings, save: str | None, *, serve: bool
) -> Viewer:
    """Return the process of the viewer; None where it is a file, or another's."""
    if serve:
        viewer = open_ends.enter_context(serving(settings))
        say(f"Open {ports().address} in a browser on this machine; Ctrl-C ends this.")
        return viewer
    return None if save else open_window(settings)


def _show_bag(bag: Path, where: str, settings: ViewSettings, wanted: Callable[[], bool]) -> None:
    from afm_scan_ros.features.view.blocks import show_bag  # noqa: PLC0415 - imports the viewer

    warn(show_bag(bag, where, settings, wanted))
    if where != WINDOW:
        say(f"Wrote {where}.")
