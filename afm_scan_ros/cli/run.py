"""``afm-scan run``: one node, where there is no ``ros2 run``; needs ROS."""

import sys

import click

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.nodes import NODES, lacking_ros, start


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
