"""The command ``afm-scan``: finds the subcommand, and ends with one line and a status.

``afm-scan run`` runs one node, where there is no ``ros2 run``.
"""

import os
import sys
import warnings
from importlib import import_module
from importlib.metadata import entry_points
from typing import NoReturn

import click

from afm_scan_ros import features
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.files import version
from afm_scan_ros.nodes import NODES, lacking_ros, start
from afm_scan_ros.report.terminal import complain, showing_log

COMMANDS = {
    "demo": "Scan a simulated scanner without and with compensation, with a report.",
    "scan": "Make one scan and record it in a bag.",
    "calibrate": "Record the scanner under the identification drives.",
    "plan": "Propose the records that would identify a scanner, and export their drives.",
    "identify": "Identify a model of the scanner from its records.",
    "analyze": "Compare desired with achieved displacement in a bag.",
    "diagnose": "Identify the effect that a model lacks, and write the extended model.",
    "close-loop": "Scan, diagnose what the model lacks, extend it, and scan again.",
    "invert": "Write the drive that makes the scanner follow a path, as CSV.",
    "import-csv": "Convert text or array files of measured data to a bag.",
    "run": "Run one node, with the arguments of 'ros2 run afm_scan_ros'.",
    **features.commands(),
}

MODULES = {
    "analyze": "recorded",
    "diagnose": "recorded",
    "invert": "import_csv",
    "run": "main",
}
"""Modules of the commands that do not stand in one of their name."""

BENCHMARKS = {
    "reproduce": "Recompute the paper's tables and figures, beside the published ones.",
    "bench": "Measure the package's accuracy and speed.",
}
"""Commands of the package ``afm_scan_bench``, which is installed apart."""

PLUGINS = "afm_scan_ros.commands"
"""Entry-point group in which another package offers a command under its name."""

BAD_INPUT, DOES_NOT_HOLD, INTERRUPTED = 2, 3, 130


class _Lazy(click.Group):
    """Imports a subcommand when it runs, so that ``--help`` does not wait for numpy."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of use."""
        del ctx
        return [*COMMANDS, *BENCHMARKS]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command NAME of its module in ``afm_scan_ros.cli``, or of its feature.

        It is imported with one thread of linear algebra, unless the environment says otherwise: the
        matrices are small, and more threads wait for each other twice as long as they work.
        """
        del ctx
        os.environ.setdefault("OMP_NUM_THREADS", "1")
        if cmd_name not in COMMANDS:
            return _plugin(cmd_name)
        name = cmd_name.replace("-", "_")
        module = f"afm_scan_ros.cli.{MODULES.get(cmd_name, name)}"
        if cmd_name in features.commands():
            module = features.module_of(cmd_name)
        command: click.Command = getattr(import_module(module), name)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing them."""
        del ctx
        with formatter.section("Commands"):
            formatter.write_dl(list((COMMANDS | BENCHMARKS).items()))


def _plugin(name: str) -> click.Command | None:
    """Return a command that another package offers.

    Raises InputError for a command of the benchmarks where these are not installed.
    """
    for point in entry_points(group=PLUGINS, name=name):
        command: click.Command = point.load()
        return command
    if name in BENCHMARKS:
        raise InputError(
            f"{name} is a command of the benchmarks, which are not installed:"
            " 'pip install ./benchmarks' in a checkout of afm_scan_ros installs them"
        )
    return None


def _show_version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:  # noqa: FBT001 - click calls it
    if wanted:
        click.echo(f"afm-scan {version()}")
        ctx.exit()


@click.group(cls=_Lazy, name="afm-scan", invoke_without_command=True)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_show_version,
    help="Show the version and exit.",
)
@click.pass_context
def cli(ctx: click.Context) -> None:
    """Scan with an AFM piezoscanner in x and y by inverting a model of it.

    Exit status: 0 done; 2 bad arguments or input; 3 a limit was exceeded or a scan is incomplete;
    130 after Ctrl-C.
    """
    if ctx.invoked_subcommand is None:  # click from 8.2 on would call that an error
        click.echo(ctx.get_help())


@click.command(
    context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False},
    epilog=f"Nodes: {', '.join(NODES)}.",
)
@click.argument("name", type=click.Choice(NODES), metavar="NAME")
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def run(name: str, arguments: tuple[str, ...]) -> int:
    """Run the node NAME with the arguments of 'ros2 run afm_scan_ros NAME'.

    For example: afm-scan run scan_recorder --ros-args -p bag:=scan1
    """
    if lacking := lacking_ros():
        raise InputError(f"run: {lacking}; a node needs ROS 2, the other commands do not")
    sys.argv = [name, *arguments]
    return start(name)


def _end(message: object, status: int) -> NoReturn:
    complain("afm-scan", message)
    sys.exit(status)


def main() -> NoReturn:
    """Run the command; whatever goes wrong is one line on stderr and an exit status.

    Python's warnings are for programmers, and shown where ``-W`` asks for them.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    try:
        with showing_log():
            sys.exit(cli.main(prog_name="afm-scan", standalone_mode=False))
    except InputError as error:
        _end(error, BAD_INPUT)
    except ScanError as error:
        _end(error, DOES_NOT_HOLD)
    except click.Abort as error:
        _end(str(error.__cause__ or "") or "interrupted", INTERRUPTED)
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "afm-scan"
        _end(f"{error.format_message().removesuffix('.')}. See '{command} --help'.", BAD_INPUT)
    except click.ClickException as error:
        _end(error.format_message(), BAD_INPUT)
    except MemoryError as error:
        _end(f"this takes more memory than there is ({error}): give less at once", BAD_INPUT)
    except OSError as error:
        if error.filename is None:
            raise
        _end(f"{error.filename}: {error.strerror}", BAD_INPUT)
