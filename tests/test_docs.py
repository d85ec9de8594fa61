"""The documentation: links, names, generated parts, and tables that the code gives.

`python tests/test_docs.py` rewrites the tables of agreement and accuracy.
"""

from __future__ import annotations

import ast
import importlib
import re
import runpy
import warnings
from collections.abc import Callable, Iterator, Sequence
from html import unescape
from pathlib import Path

import click
import pytest

import fuzzytree
from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.cli.program import program
from fuzzytree.exporters.table import all_formats
from fuzzytree.model import Result
from fuzzytree.runtimes.table import all_runtimes

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
AT_THE_TOP = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
PAGES = [*AT_THE_TOP, *sorted(DOCS.rglob("*.md"))]
KINDS = {"tutorials", "how-to", "reference", "explanation"}
BARRED = re.compile(
    rf"\b(?:told|tells|asked|asks|held|whoever|{'carr'}iers?)\b", re.IGNORECASE
)
TABLE = re.compile(r"<!-- (\w+) -->\n\n(.*?)\n<!-- end -->\n", re.DOTALL)
HOOKS = runpy.run_path(str(DOCS / "hooks.py"))


def test_every_page_is_of_one_kind_and_in_the_navigation() -> None:
    listed = re.findall(r"\S+\.md", (ROOT / "mkdocs.yml").read_text("utf-8"))
    pages = [path.relative_to(DOCS) for path in DOCS.rglob("*.md")]
    assert sorted(map(str, pages)) == sorted(listed)
    assert {path.parts[0] for path in pages if len(path.parts) > 1} == KINDS


def test_every_link_of_a_page_leads_to_a_file() -> None:
    for page in PAGES:
        for target in re.findall(
            r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8")
        ):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_every_path_that_a_page_names_exists() -> None:
    pattern = (
        r"`((?:examples|benchmarks|fuzzytree|exporters|schemas|tests)/[\w./-]*\w)`"
    )
    for page in PAGES:
        for path in re.findall(pattern, page.read_text("utf-8")):
            if not re.search(r"turtle|NAME|fuzzytree/1", path):
                assert (ROOT / path).exists(), f"{page.name}: {path}"


def test_every_module_that_a_page_names_can_be_imported() -> None:
    for page in PAGES:
        for name in set(re.findall(r"`(fuzzytree(?:\.\w+)+)", page.read_text("utf-8"))):
            if name != "fuzzytree.formats":  # the group of entry points
                assert _resolves(name), f"{page.name}: {name}"


def _resolves(name: str) -> bool:
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            found: object = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def test_every_command_that_a_page_shows_exists_with_its_options() -> None:
    shown = r"(?<![\w./-])fuzzytree ((?:tactile )?[a-z]+)\b([^`|\n]*)"
    for page in PAGES:
        for names, rest in re.findall(shown, page.read_text("utf-8")):
            command: click.Command | None = program
            for name in names.split():
                if isinstance(command, click.Group):
                    command = command.get_command(click.Context(command), name)
            if command is None:  # prose, but not behind `tactile`
                assert " " not in names, f"{page.name}: {names}"
                continue
            known = {option for one in command.params for option in one.opts}
            for option in re.findall(r" (--[a-z][\w-]+)", rest):
                assert option in known, f"{page.name}: {names} {option}"


def test_the_pages_use_the_words_of_the_glossary() -> None:
    quoted = r"```.*?```|`[^`]*`|<!-- (\w+) -->\n\n.*?<!-- end -->"
    for page in PAGES:
        if page.name != "glossary.md":
            prose = re.sub(quoted, "", page.read_text("utf-8"), flags=re.DOTALL)
            assert not BARRED.findall(prose), page.name


def test_the_classes_that_the_glossary_names_exist() -> None:
    text = (DOCS / "glossary.md").read_text("utf-8")
    defined = {
        node.name
        for folder in ("fuzzytree", "exporters")
        for path in (ROOT / folder).rglob("*.py")
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.ClassDef)
    }
    assert set(re.findall(r"`([A-Z][a-z]\w+)`", text)) <= defined


def test_the_architecture_names_every_room_and_module_at_the_top() -> None:
    text = (DOCS / "architecture.md").read_text("utf-8")
    named = set(re.findall(r"`([\w./]+(?:/|\.py))`", text))
    assert all((ROOT / path).exists() for path in named if "NAME" not in path)
    rooms = {
        f"{path.relative_to(ROOT)}/" if path.is_dir() else f"{path.relative_to(ROOT)}"
        for path in (ROOT / "fuzzytree").iterdir()
        if not path.is_symlink() and not path.name.startswith("__")
    } - {"fuzzytree/py.typed"}
    assert rooms | {"exporters/", "schemas/"} <= named


def test_the_reading_path_is_for_an_afternoon() -> None:
    text = (DOCS / "architecture.md").read_text("utf-8")
    path = text.split("reading path", 1)[1].split("## Where", 1)[0]
    files = re.findall(r"`([\w./]+\.py)`", path)
    lines = sum((ROOT / file).read_text("utf-8").count("\n") for file in files)
    assert 4_000 < lines < 6_000


@pytest.mark.parametrize(
    ("part", "names"),
    [
        ("findings", list(CODES)),
        ("formats", [one.name for one in all_formats()]),
        ("runtimes", [one.name for one in all_runtimes()]),
        ("peers", [*HOOKS["PEERS"].values()]),
        ("verbs", ["fuzzytree learn", "fuzzytree tactile live"]),
        ("api", [name for name in fuzzytree.__all__ if name[0] != "_"]),
        ("api_learn", ["::: fuzzytree.learn\n", "::: fuzzytree.Learner\n"]),
    ],
)
def test_a_generated_part_names_everything(part: str, names: list[str]) -> None:
    text = HOOKS["on_page_markdown"](f"<!-- generated: {part} -->")
    assert all(name in text for name in names)


def test_every_public_name_and_result_has_one_page() -> None:
    names = [name for group in HOOKS["GROUPS"].values() for name in group]
    public = {name for name in fuzzytree.__all__ if name[0] != "_"}
    assert public - {*names} == set(), "add it to a group in docs/hooks.py"
    assert len(names) == len(set(names))
    results = {kind.__name__ for kind in _kinds_below(Result)}
    assert results <= {name.split(".")[-1] for name in names} | {"AnyModel", "Answers"}


def _kinds_below(kind: type) -> Iterator[type]:
    below: type
    for below in kind.__subclasses__():
        if below.__module__.startswith("fuzzytree."):
            yield below
            yield from _kinds_below(below)


def test_a_session_is_copied_without_its_prompts_and_output() -> None:
    session = (
        '<div class="highlight"><pre><span></span><code><span class="gp">$ </span>'
        'run<span class="w"> </span><span class="s1">&#39;a b&#39;</span> &gt; c\n'
        '<span class="go">$ 3 of 4</span>\n<span class="gp">$ </span>ls</code></pre>'
    )
    copied = re.findall('data-copy="([^"]*)"', HOOKS["on_page_content"](session))
    assert [unescape(text) for text in copied] == ["run 'a b' > c\nls"]
    output = '<div class="highlight"><pre><span></span><code>3 of 4</code></pre></div>'
    assert HOOKS["on_page_content"](output) == output


def test_the_gallery_has_ten_pictures_and_each_has_a_command_or_a_guide() -> None:
    sections = (DOCS / "gallery.md").read_text("utf-8").split("\n## ")[1:]
    shown = [section for section in sections if "![" in section]
    assert len(shown) >= 10
    assert all(
        "```" in text or "`--front`" in text or "](how-to" in text for text in shown
    )


def test_an_option_stays_on_one_line() -> None:
    html = HOOKS["on_page_content"]("<code>--front</code> <code>a-b</code>")
    assert html == '<code class="whole">--front</code> <code>a-b</code>'


def test_a_picture_opens_in_its_full_size() -> None:
    html = HOOKS["on_page_content"]('<p><img alt="A" src="a.svg" /></p>')
    assert html == '<p><a href="a.svg"><img alt="A" src="a.svg" /></a></p>'
    assert HOOKS["on_page_content"](html) == html


def test_the_site_has_a_model_to_try_and_leads_from_old_pages(
    tmp_path: Path,
) -> None:
    HOOKS["on_post_build"]({"site_dir": str(tmp_path)})
    assert "flavanoids" in (tmp_path / "wine.html").read_text("utf-8")
    for old, new in HOOKS["MOVED"].items():
        assert f"url={new}" in (tmp_path / old / "index.html").read_text("utf-8")
        assert (DOCS / old / new).resolve().with_suffix(".md").exists()
        assert not (DOCS / old).with_suffix(".md").exists()


def test_a_long_table_stands_behind_a_link() -> None:
    row = "<tr><td>a</td></tr>"
    long = f"<table><tr><th>file</th></tr>{41 * row}</table>"
    folded = HOOKS["on_page_content"](f"{long}<p>b</p>{long[:60]}</table>")
    assert folded.count("<details><summary>Show 41 rows</summary><table>") == 1
    options = long.replace("file", "option")
    assert HOOKS["on_page_content"](options) == options


ENGINES = ("dask", "duckdb", "ibis", "polars", "spark")


@pytest.mark.heavy
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_python_of_a_page_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if page.stem in ("add-a-format", "frames", "tactile", *ENGINES):
        pytest.skip("a test of its own follows the page")
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for code in re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of other libraries
            exec(code, names)  # the page's own


@pytest.mark.heavy
def test_the_differences_of_the_wine_tree_are_what_the_code_gives() -> None:
    assert _shown("differences") == TABLES["differences"]()


@pytest.mark.heavy
def test_the_accuracies_are_what_the_code_gives() -> None:
    """Other processors add in another order, which may turn a row or two of a table."""
    shown, found = _shown("accuracy").split(), TABLES["accuracy"]().split()
    assert len(shown) == len(found)
    for one, two in zip(shown, found, strict=True):
        if re.fullmatch(r"\d+\.\d", one):
            assert abs(float(one) - float(two)) <= 1.2, (one, two)
        elif not one.isdigit():
            assert one == two


def _shown(name: str) -> str:
    shown: dict[str, str] = dict(TABLE.findall(HOMES[name].read_text("utf-8")))
    return shown[name]


def _differences() -> str:
    """Return how far the runtimes' strengths lie apart on the wine tree."""
    import fuzzytree as ft
    from fuzzytree.runtimes.table import all_runtimes

    table = ROOT / "examples" / "wine" / "wine.csv"
    tree = ft.learn(table, target="cultivar", name="wine")
    # A compiler is not there for everyone.
    names = [one.name for one in all_runtimes() if not one.programs]
    rows = [
        (
            one.representation.split(":")[0],
            one.against,
            str(one.rows),
            f"{one.largest_difference:.2g}",
            f"{one.allowed:.2g}",
        )
        for one in ft.check(tree, data=table, runtimes=names).comparisons
        if one.representation.endswith(": relative rules") and one.basis == "rows"
    ]
    return _table("runtime", "against", "rows", "largest difference", "allowed", rows)


def _accuracy() -> str:
    """Return the accuracy of both modes beside three classifiers."""
    from sklearn import datasets
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
    from sklearn.model_selection import StratifiedKFold, cross_val_score
    from sklearn.naive_bayes import GaussianNB
    from sklearn.tree import DecisionTreeClassifier

    from fuzzytree.estimator import FuzzyTreeClassifier

    folds = StratifiedKFold(10, shuffle=True, random_state=0)
    learners = {
        "fuzzytree": FuzzyTreeClassifier(),
        "paper mode": FuzzyTreeClassifier(mode="paper"),
        "DecisionTree": DecisionTreeClassifier(random_state=0),
        "GaussianNB": GaussianNB(),
        "LDA": LinearDiscriminantAnalysis(),
    }
    rows: list[tuple[str, ...]] = []
    for name in ("iris", "wine", "breast_cancer", "digits"):
        values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
        with warnings.catch_warnings():
            # Columns of digits that never vary make LDA warn.
            warnings.simplefilter("ignore")
            shares = [
                cross_val_score(one, values, labels, cv=folds).mean()
                for one in learners.values()
            ]
        leaves = len(FuzzyTreeClassifier().fit(values, labels).tree_.leaves)
        cells = (f"{100 * share:.1f}" for share in shares)
        rows.append((name.replace("_", " "), *cells, str(leaves)))
    return _table("table", *learners, "leaves of fuzzytree", rows)


def _table(*parts: str | Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown; the last part is its rows, the others its head."""
    *head, rows = parts
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


TABLES: dict[str, Callable[[], str]] = {
    "differences": _differences,
    "accuracy": _accuracy,
}
HOMES = {
    "differences": DOCS / "explanation" / "agreement.md",
    "accuracy": DOCS / "explanation" / "learner.md",
}


if __name__ == "__main__":
    for name, table in TABLES.items():
        text = HOMES[name].read_text("utf-8")
        made = f"<!-- {name} -->\n\n{table()}\n<!-- end -->\n"
        HOMES[name].write_text(TABLE.sub(made.replace("\\", r"\\"), text), "utf-8")
