"""The option ``--order``: poles and zeros, or the word for choosing them by the record."""

import click

from afm_scan_ros.core.identification.vibration.rational_form import PAPER, Order

AUTO = "auto"


class OrderCommand(click.Command):
    """A command whose ``--order`` is two numbers or ``auto``, which click cannot say by itself."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Let the one word stand for both numbers."""
        words: list[str] = []
        for word in args:
            after = words[-1:] == ["--order"] and word == AUTO
            words += [word, word] if after else [word]
        return super().parse_args(ctx, words)


def _order(ctx: click.Context, param: click.Parameter, value: tuple[str, str]) -> Order | None:
    """Return the order, None for ``auto``."""
    if value == (AUTO, AUTO):
        return None
    poles, zeros = (
        click.IntRange(min=least)(number, param, ctx)
        for least, number in zip((1, 0), value, strict=True)
    )
    return Order(poles, zeros)


order_option = click.option(
    "--order",
    nargs=2,
    default=(str(PAPER.poles), str(PAPER.zeros)),
    show_default=True,
    metavar=f"POLES ZEROS|{AUTO}",
    callback=_order,
    help="Order of the vibration model, or 'auto' to choose it by prediction of held-out waves.",
)
