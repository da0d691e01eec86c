"""Pages of the site that are made from the code, so that nothing in them is copied by hand.

MkDocs runs this file as a hook. ``pages`` needs nothing but the package and its benchmarks.
"""

import ast
import csv
import importlib
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import attrs
import click
from bokeh.resources import Resources

import afm_scan_ros
from afm_scan_ros.cli.main import BENCHMARKS, COMMANDS, cli
from afm_scan_ros.drivers import ScannerSettings
from afm_scan_ros.files import model_file, plant_file, share_directory
from afm_scan_ros.files.records import key_of
from afm_scan_ros.nodes import NODES as NODE_NAMES
from afm_scan_ros.nodes.parameters import FLOW, NodeParameter, scan_spec_parameters
from names_of_ros import names_of_ros
from settings_page import settings_page

ROOT = Path(__file__).parents[1]
LIBRARY = "examples/bokeh.js"
NOTEBOOKS = {f"examples/{path.stem}.md": path for path in (ROOT / "examples").glob("*.ipynb")}
TABLES = {
    str(path.relative_to(ROOT / "docs").with_suffix(".md")): path
    for path in (ROOT / "docs").rglob("tables/*.csv")
}
"""Tables that are too long for the pages that discuss them: a page of the site each."""

SOURCES = {
    "reference/api.md": "afm_scan_ros/__init__.py",
    "reference/nodes.md": "launch/scan.launch.py",
    "reference/settings.md": "docs/settings_page.py",
    "reference/messages.md": "msg",
    "reference/files.md": "config",
}
"""What links to generated pages lead to in a checkout, which has no such pages."""

API = (
    "Public is what `import afm_scan_ros as afm` offers. Units are SI: m, V, s, Hz. Arrays have the"
    " shape `(n,)` or `(n, channels)`. An example:"
)
NODES = (
    "A node needs ROS 2, and runs by `ros2 run afm_scan_ros NAME` or, with the same arguments, by"
    " `afm-scan run NAME`. All parameters are fixed when a node starts."
)
FILES = (
    "All of them are YAML. A key ends with its unit. ROS's rules for numbers hold: `1e-6` is a"
    " float, `5` is an integer, and a float key refuses an integer."
)
SCAN_FILE = (
    "It holds parameters of the trajectory generator under `/**/trajectory_generator:` and"
    " `ros__parameters:`."
)
MODEL_FILE = (
    "`afm-scan identify` writes it. The arrays lie in an `.npz` file beside it. `content_sha256` is"
    " a digest of all else in the file, by which one that was cut short or edited is refused;"
    " delete that line where the edit is meant, or write the file without it."
)
SETTINGS_FILE = (
    "It describes a scanner that a driver moves. The section `options:` holds the driver's own"
    " keys. [Your own scanner](../tutorials/own_scanner.md) has an example."
)
PLANT_FILE = (
    "It describes the simulated scanner. A file may name another one by `base:` and add"
    " `mechanisms:`."
)


def on_files(files: Any, config: Any) -> Any:  # noqa: ANN401 - MkDocs' own types
    """Add the generated pages to the site's files."""
    from mkdocs.structure.files import File  # noqa: PLC0415 - absent where only the tests run

    for name, content in pages().items():
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Turn links that work in a checkout into links to the pages that the site makes of the files.

    These files are notebooks, tables, and what ``SOURCES`` lists. Where a link to a table is a
    paragraph, the table stands there.
    """
    tables = {path.stem: path for path in TABLES.values()}
    markdown = re.sub(
        r"^\[.*\]\([^)]*tables/(\w+)\.csv\)$",
        lambda found: rows_of(tables[found[1]]),
        markdown,
        flags=re.MULTILINE,
    )
    markdown = re.sub(r"\]\(([^)]*tables/\w+)\.csv\)", r"](\1.md)", markdown)
    for page, source in SOURCES.items():
        markdown = re.sub(rf"\]\(\.\./((\.\./)*){re.escape(source)}\)", rf"](\1{page})", markdown)
    return re.sub(r"\]\(\.\./((\.\./)*examples/\w+)\.ipynb\)", r"](\1.md)", markdown)


def on_page_content(html: str, **_: object) -> str:
    """Turn the page's LaTeX into MathML, which browsers draw without a script."""
    from latex2mathml.converter import convert  # noqa: PLC0415 - as above

    def inline(found: re.Match[str]) -> str:
        return str(convert(_unescaped(found[1])))

    def display(found: re.Match[str]) -> str:
        return str(convert(_unescaped(found[1]), display="block"))

    html = re.sub(r'<span class="arithmatex">\\\((.*?)\\\)</span>', inline, html, flags=re.DOTALL)
    return re.sub(
        r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', display, html, flags=re.DOTALL
    )


def pages() -> dict[str, str | bytes]:
    """Return every generated file of the site: its path in ``docs/``, and its content."""
    made: dict[str, str | bytes] = {name: make() for name, make in PAGES.items()}
    made |= {name: notebook_page(notebook) for name, notebook in NOTEBOOKS.items()}
    return made | {name: table_of(path) for name, path in TABLES.items()}


def table_of(path: Path) -> str:
    """Return a file of comma-separated values as a page."""
    return f"# {path.stem.replace('_', ' ').capitalize()}\n\n{rows_of(path)}\n"


def rows_of(path: Path) -> str:
    """Return a file of comma-separated values as a table."""
    with path.open(encoding="utf-8", newline="") as file:
        heads, *rows = (tuple(row) for row in csv.reader(file))
    return _table(heads, rows)


def api() -> str:
    """Return the README's example, and a section for each name that the package exports."""
    readme = (ROOT / "README.md").read_text("utf-8")
    example = re.search(r"^```python\n.*?^```$", readme, re.MULTILINE | re.DOTALL)
    if example is None:
        raise ValueError("README.md has no example in Python")
    parts = ["# Python API", API, example[0]]
    for name in afm_scan_ros.__all__:
        parts += _exported(name, getattr(afm_scan_ros, name))
    return "\n\n".join(parts) + "\n"


def _exported(name: str, value: Any) -> Iterator[str]:  # noqa: ANN401 - a class, function or text
    if not hasattr(value, "__qualname__"):
        yield f"## {name}"
        yield f"`{value!r}`"
        return
    options = f"    options:\n      heading: {name}\n      toc_label: {name}"
    yield f"::: {value.__module__}.{value.__qualname__}\n{options}"
    if attrs.has(value) and "ade by ``" not in value.__doc__:
        yield _constructor(name, value)


def _constructor(name: str, cls: type) -> str:
    """Return what a class is made from; of documented fields with their meaning."""
    public = [a for a in attrs.fields(cls) if a.init and not a.name.startswith("_")]
    if any("help" in a.metadata for a in public):
        rows = [(f"`{a.name}`", _default(a), a.metadata["help"], _si(a)) for a in public]
        return _table(("argument", "default", "meaning", "unit"), rows)
    given = (a.name if a.default is attrs.NOTHING else f"{a.name}={a.default!r}" for a in public)
    return f"```python\n{name}({', '.join(given)})\n```"


def _si(attribute: "attrs.Attribute[Any]") -> str:
    """Return the SI unit of a quantity that people write with the unit of its suffix."""
    units = {"_um": "m", "_ms": "s", "_s": "s", "_hz": "Hz", "": ""}
    return units[attribute.metadata["suffix"]]


def commands() -> str:
    """Return the help of every subcommand."""
    context = click.Context(cli, info_name="afm-scan")
    parts = ["# Commands", _paragraphs(cli.help)]
    for name in (*COMMANDS, *BENCHMARKS):
        command = cli.get_command(context, name)
        if command is None:
            raise ValueError(f"afm-scan lists {name}, which does not exist")
        parts += _command(name, command, context)
    return "\n\n".join(parts) + "\n"


def _command(name: str, command: click.Command, above: click.Context) -> Iterator[str]:
    context = click.Context(command, info_name=name, parent=above)
    yield f"## {name}"
    yield _paragraphs(command.help)
    usage = " ".join(command.collect_usage_pieces(context))
    yield f"```text\nafm-scan {name} {usage}\n```"
    records = [option.get_help_record(context) for option in command.get_params(context)]
    rows = [(f"`{r[0]}`", _public(r[1])) for r in records if r and r[1] and r[0] != "--help"]
    if rows:
        yield _table(("option", "meaning"), rows)
    if command.epilog:
        yield _paragraphs(command.epilog)


def nodes() -> str:
    """Return the parameters of every node and the arguments of the launch file."""
    with names_of_ros():
        common = importlib.import_module("afm_scan_ros.nodes.scan_node").COMMON
        sections = [_node(name) for name in NODE_NAMES]
    parts = ["# Nodes and their parameters", NODES, "## Parameters of every node"]
    return "\n\n".join((*parts, _parameters(common), *sections, *_launch())) + "\n"


def _node(name: str) -> str:
    node = importlib.import_module("afm_scan_ros.nodes.run").node_class(name)
    own = [*node.PARAMETERS]
    if name == "trajectory_generator":
        own += scan_spec_parameters()
    return f"## {name}\n\n{_paragraphs(node.__doc__)}\n\n{_parameters(own)}"


def _launch() -> Iterator[str]:
    yield "## Arguments of scan.launch.py"
    tree = ast.parse((ROOT / "launch/scan.launch.py").read_text("utf-8"))
    calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call))
    rows = []
    for call in calls:
        if ast.unparse(call.func) == "DeclareLaunchArgument":
            given = {word.arg: word.value for word in call.keywords}
            default = given["default_value"]
            shown = default.value if isinstance(default, ast.Constant) else ast.unparse(default)
            name, text = (ast.literal_eval(part) for part in (call.args[0], given["description"]))
            rows.append((f"`{name}`", f"`{shown}`", text))
    yield _table(("argument", "default", "meaning"), rows)


def messages() -> str:
    """Return the fields of every message, and the topics."""
    parts = ["# Messages and topics", "## Topics"]
    parts.append(_table(("topic", "type", "delivery"), _topics()))
    for path in sorted((ROOT / "msg").glob("*.msg")):
        parts += _message(path)
    return "\n\n".join(parts) + "\n"


def _topics() -> Iterator[tuple[str, ...]]:
    with names_of_ros():
        topics = importlib.import_module("afm_scan_ros.nodes.topics")
        for topic in vars(topics).values():
            if isinstance(topic, topics.NodeTopic):
                promised = (topic.writer.reliability, topic.writer.durability, topic.writer.history)
                quality = ", ".join(each.name.lower().replace("_", " ") for each in promised)
                yield f"`{topic.name}`", topic.kind.__name__, quality


def _message(path: Path) -> Iterator[str]:
    first, *lines = path.read_text("utf-8").splitlines()
    yield f"## {path.stem}"
    yield first.removeprefix("# ")
    pairs = (line.partition("#")[::2] for line in lines if line)
    rows = []
    for declared, meaning in pairs:
        kind, name = declared.split(maxsplit=1)
        rows.append((f"`{name.strip()}`", f"`{kind}`", meaning.strip()))
    yield _table(("field", "type", "meaning"), rows)


def files_of_users() -> str:
    """Return the keys of the files that people write."""
    parts = [
        "# Scan, model, plant and settings files",
        FILES,
        "## Scan file",
        SCAN_FILE,
        _parameters([*scan_spec_parameters(), *FLOW]),
        _example("scan.yaml"),
        "## Model file",
        MODEL_FILE,
        *_records(model_file._File),  # noqa: SLF001 - the file's own description
        "## Plant file",
        PLANT_FILE,
        _example("plant.yaml"),
        *_records(plant_file.PlantSpec),
        "## Mechanisms of a plant file",
        *(
            part
            for kind, cls in sorted(plant_file.Mechanism.KINDS.items())
            for part in _mechanism(kind, cls)
        ),
        "## Settings of a scanner",
        SETTINGS_FILE,
        *_records(ScannerSettings),
    ]
    return "\n\n".join(parts) + "\n"


def _mechanism(kind: str, cls: type) -> Iterator[str]:
    yield f"### {kind}"
    yield _paragraphs(cls.__doc__)
    yield _keys(cls)


def _records(cls: type) -> Iterator[str]:
    """Yield a table for a record and for each record inside it, once each."""
    seen: list[type] = []
    waiting = [cls]
    while waiting:
        record = waiting.pop(0)
        if record in seen:
            continue
        seen.append(record)
        attrs.resolve_types(record)
        title = record.__name__.removeprefix("_")
        yield f"### {'The whole file' if title == 'File' else title}"
        if record.__doc__ and not record.__doc__.startswith("Method generated"):
            yield _paragraphs(record.__doc__)
        yield _keys(record)
        waiting += [inner for a in attrs.fields(record) for inner in _inner(a.type)]


def _inner(kind: Any) -> Iterator[type]:  # noqa: ANN401 - any annotation
    if attrs.has(kind):
        yield kind
    for part in getattr(kind, "__args__", ()):
        yield from _inner(part)


def _keys(cls: type) -> str:
    attrs.resolve_types(cls)
    rows = [
        (f"`{key_of(a)}`", _type(a.type), _default(a), _checks(a.validator))
        for a in attrs.fields(cls)
    ]
    return _table(("key", "type", "default", "allowed"), rows) if rows else ""


def _type(kind: Any) -> str:  # noqa: ANN401 - any annotation
    name = kind.__name__ if isinstance(kind, type) and not hasattr(kind, "__args__") else str(kind)
    name = re.sub(r"tuple\[(.+), \.\.\.\]", r"list of \1", name)
    return re.sub(r"\w+\.", "", name).replace("_", "").replace("|", "or")


def _default(attribute: "attrs.Attribute[Any]") -> str:
    if attribute.default is attrs.NOTHING:
        return "required"
    if attribute.default in {None, ""} or attribute.default == ():
        return "none"
    return f"`{attribute.default}`"


def _checks(validator: object) -> str:
    every = getattr(validator, "_validators", (validator,))
    found = []
    for check in every:
        if hasattr(check, "compare_op"):
            found.append(f"{check.compare_op} {check.bound:g}")
        elif hasattr(check, "options"):
            found.append("one of " + ", ".join(map(str, check.options)))
    return ", ".join(found)


def _example(name: str) -> str:
    return f"```yaml\n{(ROOT / 'config' / name).read_text('utf-8')}```"


def _parameters(parameters: Iterable[NodeParameter]) -> str:
    rows = []
    for each in parameters:
        default = each.default
        shown = ", ".join(default) if isinstance(default, list) else _public(str(default))
        ends = ((">=", each.low), ("<=", each.high))
        allowed = ", ".join(f"{sign} {end:g}" for sign, end in ends if end is not None)
        allowed = allowed or (f"one of {', '.join(each.choices)}" if each.choices else "")
        rows.append((f"`{each.name}`", f"`{shown}`" if shown else "", allowed, each.description))
    return _table(("parameter", "default", "allowed", "meaning"), rows)


def notebook_page(path: Path) -> str:
    """Return a notebook as a page, whose pictures find Bokeh's library in ``LIBRARY``."""
    parts = [f'<script src="../{Path(LIBRARY).name}"></script>']
    for cell in json.loads(path.read_text("utf-8"))["cells"]:
        source = "".join(cell["source"])
        parts.append(f"```python\n{source}\n```" if cell["cell_type"] == "code" else source)
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if "text/html" in data:
                parts.append(re.sub(r"\n\s*\n", "\n", "".join(data["text/html"])))
            elif text := "".join(output.get("text", data.get("text/plain", ()))):
                parts.append(f"```text\n{text.rstrip()}\n```")
    return "\n\n".join(parts) + "\n"


def bokeh() -> str:
    """Return Bokeh's library, which the pictures of notebooks need."""
    return "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)


def _paragraphs(text: str | None) -> str:
    """Return a docstring as Markdown, its code as code."""
    plain = "\n".join(line.strip() for line in (text or "").strip().splitlines())
    return _public(plain.replace("\b\n", "").replace("``", "`"))


def _public(text: str) -> str:
    """Return a text without the path of the machine that builds the site."""
    return text.replace(f"{share_directory()}/", "")


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [heads, ("---",) * len(heads), *rows]
    cells = ([cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in lines)
    return "\n".join(f"| {' | '.join(row)} |" for row in cells)


def _unescaped(text: str) -> str:
    return text.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")


PAGES = {
    LIBRARY: bokeh,
    "reference/api.md": api,
    "reference/commands.md": commands,
    "reference/nodes.md": nodes,
    "reference/settings.md": settings_page,
    "reference/messages.md": messages,
    "reference/files.md": files_of_users,
}
