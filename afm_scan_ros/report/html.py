"""Self-contained HTML pages from templates, in which no text is markup."""

from base64 import b64encode
from io import BytesIO
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure

from afm_scan_ros.report.quantity import nanometres
from afm_scan_ros.report.style import styled

TEMPLATES = Path(__file__).parent / "templates"


def page(name: str, folder: Path = TEMPLATES, **values: object) -> str:
    """Return a template of a folder as a page, with values; it may extend those of this package.

    Each text among the values is escaped. A value that a template names and that is not given is
    an error.
    """
    templates = Environment(
        loader=FileSystemLoader([folder, TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    templates.filters |= {"base64": _base64, "nm": nanometres}
    return templates.get_template(name).render(values)


@styled
def png(figure: Figure) -> bytes:
    """Draw a figure, as a PNG file has it."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=160)
    return stream.getvalue()


def _base64(content: bytes) -> str:
    return b64encode(content).decode("ascii")
