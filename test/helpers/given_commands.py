"""Commands that a report names: each can be given as it stands."""

import html
import re
import shlex

import click

from afm_scan_ros.cli.main import cli


def commands_of(page: str) -> list[list[str]]:
    """Return the words of each command; raises where one has a placeholder or an unknown option."""
    lines = [html.unescape(line) for line in re.findall(r"<pre[^>]*>(.*?)</pre>", page, re.DOTALL)]
    for line in lines:
        refuse_unknown(line)
    return [shlex.split(line) for line in lines]


def refuse_unknown(line: str) -> None:
    """Raise for a command with a placeholder, as ``BAG``, or an option that is unknown."""
    program, name, *words = shlex.split(line)
    assert program == "afm-scan"
    assert not re.search(r"\b[A-Z]{3,}\b", line), "a placeholder"
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    command.make_parser(click.Context(command)).parse_args(args=words)
