"""The generated parts of the documentation, for `<!-- generated: NAME -->` in a page.

mkdocs calls `on_page_markdown` and `on_page_content` for each page. Verbs and options
come from click, formats and runtimes from their tables, findings from the codes of the
audit, and the API from the public names of `fuzzytree`.
"""

from __future__ import annotations

import functools
import inspect
import json
import pkgutil
import re
from collections.abc import Callable, Iterable, Iterator, MutableMapping, Sequence
from html import escape, unescape
from pathlib import Path
from typing import TYPE_CHECKING

import click
import griffe

import fuzzytree
from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.auditing.findings.records import LIMITS
from fuzzytree.cli.program import program
from fuzzytree.exporters.table import all_formats
from fuzzytree.model.options import options_of
from fuzzytree.report.formats import promise_of
from fuzzytree.runtimes.table import all_runtimes

if TYPE_CHECKING:
    from mkdocs.structure.pages import Page

WINE = Path(__file__).parents[1] / "examples" / "wine" / "wine.csv"
MARK = re.compile(r"<!-- generated: (\w+) -->")
CODE = re.compile(
    r'<div class="highlight">(?=<pre><span></span><code>(.*?)</code>)', re.DOTALL
)
TABLE = re.compile(r"<table>.*?</table>", re.DOTALL)
MOST_ROWS = 40
PICTURE = re.compile(r'<p>(<img [^>]*src="([^"]+)"[^>]*>)</p>')
OPTION = re.compile(r"<code>(-[^<\n]{1,30})</code>")
COMMAND = re.compile(r'^<span class="gp">.*?</span>(.*)$', re.MULTILINE)


class Examples(griffe.Extension):
    """Renders the section `Example:` of a docstring as code, and names keywords."""

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        """Rename the section in the docstring of an object."""
        if obj.docstring:
            obj.docstring.value = obj.docstring.value.replace(
                "Example:\n", "Examples:\n"
            )

    def on_function(self, *, func: griffe.Function, **_: object) -> None:
        """Name the keywords of `**options` where the docstring describes them."""
        for parameter in func.parameters if func.docstring else ():
            kind = parameter.annotation
            if isinstance(kind, griffe.ExprSubscript) and "Unpack" in str(kind.left):
                assert isinstance(kind.slice, griffe.Expr)
                keywords = func.modules_collection[kind.slice.canonical_path].attributes
                names = ", ".join(f"`{name}`" for name in keywords)
                assert func.docstring
                func.docstring.value = func.docstring.value.replace(
                    f" {parameter.name}: ", f" {parameter.name}: {names}. ", 1
                )


def on_page_markdown(markdown: str, page: Page | None = None, **_: object) -> str:
    """Return a page with its marks replaced by what they name.

    The search finds a page by its words in `WORDS`, too, and guides before the API. A
    page that is in no folder has no neighbours to list beside it.
    """
    if page and "/" not in page.file.src_uri:
        page.meta["hide"] = ["navigation"]
    if page and page.file.src_uri in WORDS:
        page.meta["tags"] = [*WORDS[page.file.src_uri]]
    if page and page.file.src_uri.startswith("reference/api"):
        page.meta["search"] = {"boost": 0.5}
    return MARK.sub(lambda mark: "\n".join(PARTS[mark[1]]()), markdown)


def on_page_content(html: str, **_: object) -> str:
    """Return a page with sessions that copy well, and long tables behind a link.

    A session is copied without its prompts and output. Tables of options stay open,
    an option stays on one line, and a picture opens in its full size.
    """
    html = OPTION.sub(r'<code class="whole">\1</code>', html)
    html = PICTURE.sub(r'<p><a href="\2">\1</a></p>', html)
    return TABLE.sub(_behind_link, CODE.sub(_with_commands, html))


def on_post_build(config: MutableMapping[str, str], **_: object) -> None:
    """Write a page that runs the wine tree, and one for each address that has moved."""
    tree = fuzzytree.learn(WINE, target="cultivar", columns_per_node=1, leaves=4)
    fuzzytree.page(tree, WINE).save(Path(config["site_dir"], "wine.html"))
    for old, new in MOVED.items():
        folder = Path(config["site_dir"], old)
        folder.mkdir(parents=True, exist_ok=True)
        leads_on = f'<!doctype html><meta http-equiv="refresh" content="0; url={new}">'
        (folder / "index.html").write_text(leads_on, "utf-8")


def _behind_link(table: re.Match[str]) -> str:
    rows = table[0].count("<tr>") - 1
    if rows <= MOST_ROWS or "<th>option</th>" in table[0]:
        return table[0]
    return f"<details><summary>Show {rows} rows</summary>{table[0]}</details>"


def _with_commands(block: re.Match[str]) -> str:
    lines = [re.sub("<[^>]*>", "", line) for line in COMMAND.findall(block[1])]
    if not lines:
        return block[0]
    commands = escape(unescape("\n".join(lines)))
    return f'<div class="highlight" data-copy="{commands}">'


def verbs() -> Iterator[str]:
    """Yield a table of all verbs, and every verb with its usage and its options."""
    context = click.Context(program, info_name="fuzzytree")
    rows = []
    for name in program.list_commands(context):
        command = program.get_command(context, name)
        text = command.get_short_help_str(200) if command else ""
        rows.append((f"[`{name}`](#fuzzytree-{name})", text))
    yield _table(("verb", "what"), rows)
    yield from _commands(program, context, 2)


def _commands(group: click.Group, parent: click.Context, level: int) -> Iterator[str]:
    for name in group.list_commands(parent):
        command = group.get_command(parent, name)
        assert command is not None
        context = click.Context(command, info_name=name, parent=parent)
        yield f"{'#' * level} {context.command_path}\n"
        yield f"{_prose(command.help or '')}\n"
        if isinstance(command, click.Group):
            yield from _commands(command, context, level + 1)
            continue
        usage = " ".join(command.collect_usage_pieces(context))
        yield f"```text\n{context.command_path} {usage}\n```\n"
        records = (one.get_help_record(context) for one in command.params)
        rows = [(f"`{one[0]}`", one[1]) for one in records if one and one[1]]
        yield _table(("option", "meaning"), rows)


def formats() -> Iterator[str]:
    """Yield the table of formats."""
    rows = []
    for one in all_formats():
        kinds = ", ".join(one.carries)
        suffixes = ", ".join(f"`{suffix}`" for suffix in one.suffixes)
        reads = kinds if one.read else ""
        rows.append((one.name, suffixes, reads, kinds, one.extra or ""))
    yield _table(("format", "suffix", "reads", "writes", "extra"), rows)


def options() -> Iterator[str]:
    """Yield the options of each writer."""
    for form in all_formats():
        rows = [
            (
                f"`{one.name}`",
                f"`{one.default}`" if one.default not in (None, ()) else "",
                ", ".join(f"`{choice}`" for choice in one.choices),
                one.help,
            )
            for one in options_of(form)
        ]
        if rows:
            yield f"### {form.name}\n"
            yield _table(("option", "default", "choices", "meaning"), rows)


def runtimes() -> Iterator[str]:
    """Yield the table of runtimes."""
    rows = []
    for one in all_runtimes():
        runs, cannot = ", ".join(one.runs), "; ".join(one.cannot)
        rows.append(
            (one.name, runs, one.dtype, promise_of(one), one.extra or "", cannot)
        )
    head = ("runtime", "runs", "numbers", "strengths", "extra", "cannot run")
    yield _table(head, rows)


def findings() -> Iterator[str]:
    """Yield what each code of an audit means."""
    rows = [
        (f"[{one.code}](#{one.code.lower()})", one.severity, one.title)
        for one in CODES.values()
    ]
    yield _table(("code", "severity", "finding"), rows)
    for one in CODES.values():
        where = "" if one.decision == "any" else ", where the strongest rule decides"
        yield f"## {one.code}\n"
        yield f"**{one.title.capitalize()}** ({one.severity}{where}). {one.what}\n"
        yield f"*Why.* {one.why}\n\n```text\n{one.example}\n```\n"
        yield f"*What to do.* {one.remedy}\n"


def peers() -> Iterator[str]:
    """Yield how fast a tree is in our runtimes and in those of other tools."""
    study = json.loads((Path(__file__).parent / "how-to" / "bench.json").read_bytes())
    rows = []
    for name, shown in PEERS.items():
        (point,) = (one for one in study["points"] if one["name"] == f"{name}: tree")
        times = {
            sample["rows"]: sample["median_ns"] / sample["rows"]
            for sample in point["timings"]
            if sample["threads"] == 1
        }
        batch = f"{times[10**6]:.3g} ns" if 10**6 in times else ""
        changed = f"{point['probes']['flips']} of {point['probes']['rows']}"
        rows.append((shown, f"{times[1] / 1000:.3g} µs", batch, changed))
    head = ("", "one row", "a row of a million", "changed at cuts")
    yield _table(head, sorted(rows, key=lambda row: float(row[1].split()[0])))


def api() -> Iterator[str]:
    """Yield for each group of public names a heading and a table with links."""
    for name, group in GROUPS.items():
        page = Path(__file__).parent / "reference" / "api" / f"{name}.md"
        title = page.read_text("utf-8").partition("\n")[0]
        yield f"## [{title.removeprefix('# ')}](api/{name}.md)\n"
        yield _names(group)


def _members(group: Sequence[str]) -> Iterator[str]:
    yield _names(group)
    yield from (f"::: fuzzytree.{name}\n" for name in group)


def _names(group: Sequence[str]) -> str:
    rows = []
    for name in group:
        path = f"fuzzytree.{name}"
        text = inspect.getdoc(pkgutil.resolve_name(path)) or ""
        shown = f"ft.{name}" if name.split(".")[0] in fuzzytree.__all__ else name
        rows.append((f"[`{shown}`][{path}]", text.partition("\n")[0]))
    return _table(("name", "what"), rows)


def _prose(text: str) -> str:
    """Return a help text as Markdown; its unwrapped parts become blocks."""
    parts = []
    for part in inspect.cleandoc(text).replace("\f", "").split("\n\n"):
        kept = part.startswith("\b\n")
        parts.append(f"```text\n{part[2:]}\n```" if kept else part)
    return "\n\n".join(parts)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(map(_on_one_line, line))} |\n" for line in lines)


def _on_one_line(cell: str) -> str:
    text = " ".join(cell.split())
    return text if text.startswith("`") else text.replace("|", "\\|")


WORDS = {
    "alternatives.md": ("comparison", "compare tools", "versus"),
    "gallery.md": ("gallery", "pictures"),
    "explanation/equivalence.md": ("proof",),
    "explanation/quality.md": ("accuracy", "benchmark"),
    "how-to/audit.md": ("audit", "review"),
    "how-to/bench.md": ("speed", "latency"),
    "how-to/draw-a-model.md": ("draw", "plot", "surface"),
    "how-to/everyday-tables.md": ("missing values", "categories", "dates"),
    "how-to/explain-one-decision.md": ("why", "counterfactual", "explain"),
    "how-to/install.md": ("install", "uninstall", "pip"),
    "how-to/use-results-in-python.md": ("notebook", "jupyter"),
    "how-to/what-if-page.md": ("what-if", "sliders"),
    "how-to/why-your-converted-tree-differs.md": (
        *("skl2onnx", "onnxmltools", "m2cgen", "treelite", "lightgbm", "xgboost"),
    ),
    "reference/c.md": ("microcontroller", "arduino", "embedded"),
    "reference/findings.md": ("dead rule", "conflict", "gap"),
    "reference/formats.md": ("export", "convert"),
    "tutorials/first-model.md": ("learn", "tutorial"),
}
MOVED = {"how-to/notebook": "../use-results-in-python/"}
GROUPS = {
    "learn": (
        *("learn", "LearningSettings", "FuzzyTreeClassifier", "Learner", "LeafCounts"),
        *("table", "TableFormat"),
    ),
    "models": (
        *("load", "read", "save", "convert", "rules_from_tree", "from_sklearn"),
        *("from_skfuzzy", "from_simpful", "ModelPath"),
        *("FuzzyTree", "RuleBase", "FuzzySystem"),
    ),
    "run": ("run", "predict", "why", "Predictions", "Outputs"),
    "export": (
        *("export", "export_text", "draw", "draw_reliability", "page", "needs"),
    ),
    "check": (
        *("check", "CheckSettings", "certify", "stability", "require"),
        *("bench", "BenchSettings"),
    ),
    "audit": (
        *("audit", "AuditSettings", "AuditSelection", "AuditDomain", "material"),
        *("diff", "recheck", "explain"),
    ),
    "results": (
        *(
            "Agreement",
            "model.TreeAgreement",
            "auditing.Audit",
            "auditing.Code",
            "auditing.Compliance",
        ),
        *("auditing.Difference", "auditing.Explanation"),
        *("benchmarking.Footprint", "benchmarking.Study"),
        *("checking.Conversion", "checking.Stability", "learning.Front"),
        *("learning.LearningReport", "model.Reading", "model.Written"),
        *("numerics.Certificate", "rechecking.Report", "report.Page", "report.Picture"),
    ),
    "tactile": ("tactile", "tactile.open", "tactile.features_of", "tactile.names_of"),
    "errors": (
        *("FuzzyTreeError", "ReadError", "WriteError", "TableError", "LearningError"),
        *("InvalidModelError", "LossError", "DisagreementError", "MissingExtraError"),
        "PortError",
    ),
}
PEERS = {
    "native": "fuzzytree, in Python",
    "onnxruntime float64": "fuzzytree's ONNX, in double",
    "onnxruntime float32": "fuzzytree's ONNX, in float",
    "scikit-learn": "scikit-learn, `predict`",
    "skl2onnx": "skl2onnx, in onnxruntime",
    "treelite": "treelite's interpreter",
    "m2cgen python": "m2cgen, Python",
    "m2cgen c": "m2cgen, C",
}
PARTS: dict[str, Callable[[], Iterable[str]]] = {
    "verbs": verbs,
    "formats": formats,
    "options": options,
    "runtimes": runtimes,
    "findings": findings,
    "peers": peers,
    "limits": lambda: (f"- {text}" for text in LIMITS),
    "api": api,
}
for _name, _group in GROUPS.items():
    PARTS[f"api_{_name}"] = functools.partial(_members, _group)
