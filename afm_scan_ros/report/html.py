"""Self-contained HTML pages from templates, in which no text is markup."""

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

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
    templates.tests["kind"] = lambda part, name: type(part).__name__ == name
    templates.filters["zip"] = zip
    return templates.get_template(name).render(values)
