"""`fuzzytree learn`: from a table to a file with a tree or its rules."""

from __future__ import annotations

import itertools
import shlex
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click
import msgspec

from fuzzytree.cli.collect import STATE
from fuzzytree.cli.console import (
    Sections,
    TableOptions,
    answer_bytes,
    answer_json,
    argument,
    categorical_option,
    flag,
    ignore_option,
    missing_option,
    option,
    output_option,
    progress_bar,
    rows_per_class_option,
    say_rows,
    several,
    table_format,
    table_source,
    takes,
    wrong_options,
)
from fuzzytree.cli.convert import next_check
from fuzzytree.cli.representation import (
    RepresentationOptions,
    represented,
    wanted_format,
)
from fuzzytree.errors import TableError
from fuzzytree.files import check_place, read_bounded, write_atomically
from fuzzytree.model import Document, Format, depth, printable

if TYPE_CHECKING:
    from fuzzytree.api import Accuracy, LeafCounts, Summary
    from fuzzytree.learning import (
        Front,
        Learner,
        LearningReport,
        LearningSettings,
        Learnt,
    )
    from fuzzytree.model import FuzzyTree, IntArray, RuleBase
    from fuzzytree.tables import Table

State = TypeVar("State", "Learner", "LeafCounts")
Lines = list[tuple[str, str, str]]
Progress = Callable[[str, float], None]

FEW_GROUPS = 10
"""Groups of a class below which its accuracy says little."""


class TableAndColumns(TableOptions):
    """The options of the table, and of its columns."""

    heading: str = "Table"
    target: str | None = option(
        "--target COLUMN",
        "Column that holds the class of each row; states know theirs.",
    )
    weight: str | None = option(
        "--weight COLUMN",
        "Column that holds the weight of each row, and is no input; 3 counts as three "
        "equal rows, 0 leaves the row out.",
    )
    groups: str | None = option(
        "--groups COLUMN",
        "Column, no input, whose equal rows belong together, such as a person or a "
        "placement: cross-validation never learns from a group that it tests on.",
    )
    ignore: Sequence[str] = ignore_option
    categorical: Sequence[str] = categorical_option
    units: Sequence[str] = several("--unit COLUMN=UNIT", "Unit of a column (repeat).")
    costs: Sequence[str] = several(
        "--cost COLUMN=COST", "Cost of computing a column (repeat)."
    )
    missing: str | None = missing_option


class TreeOptions:
    """The options of the tree."""

    heading: str = "Tree"
    mode: Any = option(
        "--mode",
        "Learner: the default one, or that of the paper.",
        choices=["default", "paper"],
        default="default",
    )
    form: Any = option(
        "--form",
        "What to learn: a tree, or a rule for each class; by default rules of more "
        "than 200 classes.",
        choices=["tree", "rules"],
    )
    columns_per_node: Any = option(
        "--columns-per-node",
        "Largest number of columns in one node; 1 gives rules in the table's words.",
        type=int,
    )
    leaves: Any = option("--leaves", "Largest number of leaves.", type=int)
    min_rows: Any = option("--min-rows", "Fewest rows of a leaf.", type=int)
    depth: Any = option(
        "--depth", "Largest number of conditions that lead to a leaf.", type=int
    )
    entry: Any = option("--entry", "Gain that a further input must bring.", type=float)
    shrinkage: Any = option(
        "--shrinkage", "Shrinkage of the off-diagonal scatter, 0 to 1.", type=float
    )
    class_weight: Any = option(
        "--class-weight",
        "`balanced`: let all classes weigh the same, however many rows they have.",
        choices=["balanced"],
    )
    rows_per_class: int | None = rows_per_class_option
    points: Any = option(
        "--points", "Number n of the 2n + 1 points on a fitted set, 1 to 8.", type=int
    )
    separate_sides: Any = flag(
        "--separate-sides", "Fit the two sides of a set separately."
    )
    seed: int = option(
        "--seed", "Random seed for the cross-validation folds.", default=0
    )


class PaperOptions:
    """The options that only the paper's learner has."""

    heading: str = "Tree of --mode paper"
    alpha: Any = option(
        "--alpha",
        "Weight of the means in the distance of patterns, 0 to 1.",
        type=float,
    )
    l_max: Any = option(
        "--l-max",
        "The paper's L_MAX: how wide a gap one column must leave; 8 by default.",
        type=float,
    )
    patterns_per_class: Any = option(
        "--patterns", "Number of patterns of each class.", type=int
    )
    keep_reversals: Any = flag(
        "--keep-reversals",
        "Let a wide set take back the far tails of others.",
    )


class OutputOptions(RepresentationOptions):
    """The options of what is written and printed."""

    output: str = output_option(
        "-o --output FILE", "File to write; `-` is stdout.", required=True
    )
    name: str | None = option(
        "--name TEXT", "Name of the tree; the name of TABLE by default."
    )
    no_test: bool = flag(
        "--no-test", "Learn without measuring the cross-validated accuracy."
    )
    front: str | None = output_option(
        "--front FILE.svg",
        "Picture to draw: the accuracy of small trees, by columns per node and leaves.",
    )
    model: str | None = option(
        "--for MODEL",
        "Write this tree with the supports that states of `collect --for` count.",
    )
    repeated: bool = flag(
        "--repeated", "Count the rows of a state twice that is part of two others."
    )


class LearnOptions(TableAndColumns, TreeOptions, PaperOptions, OutputOptions):
    """The arguments and options of the verb."""

    tables: Sequence[str] = argument("TABLE", nargs=-1, required=True)


@click.command("learn", cls=Sections, short_help="Learn a tree from a table.")
@takes(LearnOptions)
def command(options: LearnOptions) -> None:
    """Learn a fuzzy tree from TABLE and write it to FILE.

    Of more than 200 classes a rule is learnt for each, and no tree; --form chooses.

    Learning straight to C, SQL or ONNX also saves the model as YAML, unless that file
    exists.

    TABLE is CSV, Parquet or Arrow: a file, a folder, a pattern such as 'rows/*.csv', a
    place such as s3://place/rows.parquet, or `-` for standard input; or there are
    several, the states of all parts of a table, which `fuzzytree collect` wrote. Files
    of any length are read in bounded memory. The accuracy is
    cross-validated: it is that of trees learnt without the rows that they are tested
    on, and each fold chooses anew how to split and to prune; the folds are made of
    20,000 rows at most. Where the table has 1,000 rows or more of each class that
    the tree was not learnt from, it is that of the tree on these rows. For states,
    and for tables above 33 million cells, accuracy and supports of leaves are
    estimated from the rows that are kept.
    """
    form = wanted_format(options.output, None)
    if options.output != "-":
        check_place(_model_file(options.output, form))
    is_state = _is_states(options)
    if options.weight is not None and (is_state or options.model is not None):
        raise click.UsageError("--weight: states count rows, which have no weights")
    if options.rows_per_class is not None and is_state:
        raise click.UsageError("--rows-per-class: states have kept their rows already")
    work = _learnt if options.model is None else _counted
    tree, rows, facts = work(options, is_state=is_state)
    _write(options, tree, rows, form, is_data=not is_state and options.tables[0] != "-")
    if options.as_json and options.output != "-":
        answer_json(facts)


def _learnt(
    options: LearnOptions, *, is_state: bool
) -> tuple[FuzzyTree | RuleBase, Lines, object]:
    """Return a model of all rows, what to say about it, and the facts."""
    from fuzzytree.api import (
        accuracy,
        accuracy_of,
        front,
        grouped,
        learn_table,
        majority,
    )
    from fuzzytree.learning import remarks
    from fuzzytree.report import counted
    from fuzzytree.tables import Table

    settings, units_of = _settings(options), dict(_pairs("--unit", options.units))
    begin = time.perf_counter()
    is_silent = options.quiet or options.output == "-"
    with progress_bar(quiet=is_silent) as show:
        result = _read(options, settings, show, is_state=is_state)
    found = result if isinstance(result, Table) else result.table()
    groups: IntArray | None = None
    if options.groups is not None:
        if not isinstance(result, Table):
            text = "the table is larger than memory, or a state, which has no rows"
            raise click.UsageError(f"--groups: {text}")
        result, groups = grouped(found, options.groups)
        found = result
    read = ("read", found.name, _timed(_read_text(found), begin))
    noticed = dict(remarks(found, lambda column: f"--ignore {shlex.quote(column)}"))
    begin = time.perf_counter()
    with wrong_options(), progress_bar(quiet=is_silent) as show:
        learnt = learn_table(
            result,
            name=_title(options),
            units=units_of,
            settings=settings,
            progress=show,
        )
    tree = learnt.model
    size = f"{len(tree.inputs)} of {len(tree.columns)} columns"
    if tree.leaves:
        parts = counted(len(tree.leaves), "leaf", "leaves")
        size = f"depth {depth(tree)}, {size}"
    else:
        parts = counted(learnt.report.rules, "rule")
        why = ", as they are more than 200; --form tree learns a tree"
        size = f"one for each class{'' if options.form else why}; {size}"
    rows = [("learnt", parts, _timed(size, begin)), read]
    rows += [("remark", column, f"has {text}") for column, text in noticed.items()]
    if len(tree.leaves) == 1:
        text = f"has one leaf: it predicts {tree.leaves[0].label!r} for every row"
        rows.append(("remark", "the tree", printable(text)))
    rows += _report_rows(learnt.report, is_verbose=options.verbose)
    tested = small = None
    if not options.no_test:
        begin = time.perf_counter()
        with progress_bar(quiet=is_silent) as show:
            if groups is None:
                tested = accuracy_of(found, learnt, settings)
            tested = tested or accuracy(
                found, settings, seed=settings.seed, groups=groups, progress=show
            )
        said = _timed(_accuracy_text(tested, found, settings), begin)
        if groups is not None:
            said = f"folds of whole groups; {said}"
            rows += _few_groups(found, groups)
            if tested is not None and tested.weak is not None:
                learnt = _with_floor(learnt, tested.floor)
                rows.append(_floor_row(tested))
        if tested is not None and tested.mean <= majority(found, settings):
            text = "is not above the share of the majority class"
            rows.append(("remark", "accuracy", text))
        rows.insert(0, ("accuracy", f"{tested.mean:.3f}" if tested else "-", said))
        if groups is None:  # its folds know none
            small = front(found, settings)
        rows += _front_rows(small)
    if options.front is not None:
        rows.append(_drawn(small, options.front, _title(options)))
    facts = _summary(found, noticed, learnt, tested, settings, options.output)
    facts = msgspec.structs.replace(facts, front=small)
    return learnt.model, rows, facts


def _with_floor(learnt: Learnt, floor: float) -> Learnt:
    """Return a tree whose semantics state the floor of strengths."""
    semantics = msgspec.structs.replace(learnt.model.semantics, floor=floor)
    model = msgspec.structs.replace(learnt.model, semantics=semantics)
    return msgspec.structs.replace(learnt, model=model)


def _floor_row(tested: Accuracy) -> tuple[str, str, str]:
    """Return a line about the floor of strengths, and why it is that one."""
    from fuzzytree.model import USUAL_FLOOR

    weak = 100 * (tested.weak or 0.0)
    text = f"{USUAL_FLOOR:g} rejects {weak:.1f} % of the rows left out"
    return "floor", f"{tested.floor:g}", f"{text}; below it a row is unknown"


def _few_groups(table: Table, groups: IntArray) -> Lines:
    """Return a line about classes of few groups: their accuracy says little."""
    import numpy as np

    from fuzzytree.report import counted

    few = [
        name
        for code, name in enumerate(table.classes)
        if len(np.unique(groups[table.codes == code])) < FEW_GROUPS
    ]
    if not few:
        return []
    names = ", ".join(few[:3]) + (" and others" if len(few) > 3 else "")
    text = f"below {FEW_GROUPS} groups, more of their rows will be strange to the tree"
    return [("few", counted(len(few), "class", "classes"), f"{names}: {text}")]


def _front_rows(small: Front | None) -> Lines:
    """Return the choice between small trees: a line for each number of leaves."""
    if small is None:
        return []
    heads, *lines = str(small).splitlines()
    said = f"{heads.removeprefix('leaves ')}  unpruned, on other folds than accuracy"
    rows = [("choice", "columns per node", said)]
    for place, line in enumerate(lines):
        if place == 0 or line[7:] != lines[place - 1][7:]:
            rows.append(("", f"{small.leaves[place]} leaves", line[7:]))
    return rows


def _drawn(small: Front | None, path: str, name: str) -> tuple[str, str, str]:
    """Draw the choice between small trees, and return a line about it."""
    from fuzzytree.report import draw_front

    if small is None:
        raise click.UsageError(
            "--front needs a tree of the default mode, a table of twenty rows or more "
            "and 100 classes at most, and a test"
        )
    picture = draw_front(small, title=f"{name}: accuracy of small trees")
    write_atomically(path, picture.svg.encode())
    return "drew", path, "the accuracy of small trees"


def _counted(
    options: LearnOptions, *, is_state: bool
) -> tuple[FuzzyTree, Lines, object]:
    """Return a tree with exact supports, what to say about it, and the facts."""
    from fuzzytree.api import LeafCounts
    from fuzzytree.model import fingerprint
    from fuzzytree.report import counted

    if not is_state:
        raise click.UsageError(
            f"--for takes states: fuzzytree collect --for {options.model} "
            f"{options.tables[0]} --target COLUMN -o part1{STATE}"
        )
    model = str(options.model)
    counts = _merged(options, lambda path: LeafCounts.load(path, model))
    tree, facts, confusion = counts.learn(), counts.facts(), counts.confusion()
    if options.name:
        tree = msgspec.structs.replace(tree, name=options.name)
    text = "on the rows that it was learnt from"
    share = counts.accuracy() if counts.rows else None
    rows = [("accuracy", "-" if share is None else f"{share:.3f}", text)]
    odd = (
        f"{facts['ties']} decided by the order of the leaves, "
        f"{facts['no_rule']} with no rule fired, "
        f"{facts['missing']} with a missing input"
    )
    rows.append(("counted", counted(facts["rows"], "row"), odd))
    most = None if options.verbose else 8
    for name, row in itertools.islice(confusion.items(), most):
        pairs = sorted(row.items(), key=lambda pair: (-pair[1], pair[0]))
        said = ", ".join(f"{other or 'no class'} {count:,}" for other, count in pairs)
        rows.append(("class", printable(name), f"predicted {printable(said)}"))
    if most and len(confusion) > most:
        rest = counted(len(confusion) - most, "more class", "more classes")
        rows.append(("class", rest, "--verbose lists them"))
    first = {"file": options.output, "fingerprint": fingerprint(tree)}
    return tree, rows, {**first, "accuracy": share, **facts, "confusion": confusion}


def _write(
    options: LearnOptions, tree: Document, rows: Lines, form: Format, *, is_data: bool
) -> None:
    """Write the model, and say what was done."""
    from fuzzytree.api import export

    model = represented(tree, form, options)
    content = export(model, form.name).content
    if options.output == "-":
        answer_bytes(content)
        return
    write_atomically(options.output, content)
    if model.outputs:  # a system takes the positions of categories
        is_data = is_data and not any(one.categories for one in tree.variables)
    rest = ["--data", options.tables[0]] if is_data else []
    rest += table_format(options).words() if rest else []
    written = [*_written_rows(model, options.output, form, rest)]
    width = max(map(len, (options.output, *(thing for _, thing, _ in rows))))
    say_rows(*rows, width=width, quiet=options.quiet)
    say_rows(*written, width=width, quiet=options.quiet)


def _is_states(options: LearnOptions) -> bool:
    """Return whether all tables are states; tables are refused beside another one."""
    tables = options.tables
    states = [one for one in tables if Path(one).suffix == STATE]
    if states and len(states) < len(tables):
        other = next(one for one in tables if one not in states)
        raise click.UsageError(
            f"{states[0]} is a state, and {other} is none: collect the tables first, "
            "and learn from states alone"
        )
    absent = [one for one in tables[1:] if not Path(one).exists()]
    if absent and options.target is None and Path(tables[0]).exists():
        raise click.UsageError(
            f"there is no file {absent[0]!r}; if it is the column of the classes, pass "
            f"--target {shlex.quote(absent[0])}"
        )
    if len(tables) > 1 and not states:
        raise click.UsageError(
            f"several tables: collect each of them first, as in `fuzzytree collect "
            f"{tables[0]} --target COLUMN -o part1{STATE}`"
        )
    return bool(states)


def _read(
    options: LearnOptions,
    settings: LearningSettings,
    progress: Progress,
    *,
    is_state: bool,
) -> Table | Learner:
    """Return the one table, or a learner of all states or of a large table."""
    from fuzzytree.learning import Learner, read_or_collect

    if is_state:
        name = _title(options)
        return _merged(
            options, lambda path: Learner.load(path, name=name, settings=settings)
        )
    if options.target is None:
        raise click.UsageError("name the column of the classes with --target")
    return read_or_collect(
        table_source(options.tables[0], options, options.categorical),
        target=options.target,
        weights=options.weight,
        ignore=options.ignore,
        settings=settings,
        name="standard input" if options.tables[0] == "-" else None,
        progress=progress,
    )


def _merged(options: LearnOptions, load: Callable[[str], State]) -> State:
    """Return the states of all files as one, merged in pairs."""
    found = [(path, load(path)) for path in options.tables]
    while len(found) > 1:
        pairs = itertools.zip_longest(found[::2], found[1::2])
        found = [_joined(*pair, repeated=options.repeated) for pair in pairs]
    state = found[0][1]
    if options.target not in (None, state.target):
        raise click.UsageError(f"--target: the states have {state.target!r}")
    return state


def _joined(
    one: tuple[str, State], other: tuple[str, State] | None, *, repeated: bool
) -> tuple[str, State]:
    if other is None:
        return one
    try:
        merge = cast("Callable[..., State]", one[1].merge)  # of two of one kind
        return one[0], merge(other[1], repeated=repeated)
    except ValueError as error:
        raise TableError(f"{other[0]}, beside {one[0]}: {error}") from error


def _title(options: LearnOptions) -> str:
    """Return the name of the tree."""
    if options.name:
        return options.name
    from fuzzytree.tables import stem_of

    is_named = len(options.tables) == 1 and options.tables[0] != "-"
    return (printable(stem_of(options.tables[0])) if is_named else "") or "tree"


def _model_file(output: str, form: Format) -> str:
    """Return the file that holds the model: a YAML file beside what is not read."""
    return output if form.read else str(Path(output).with_suffix(".yaml"))


def _written_rows(
    model: Document, output: str, form: Format, rest: Sequence[str]
) -> Iterator[tuple[str, str, str]]:
    """Yield lines about the files and the next step; write the model if it has none."""
    from fuzzytree.api import export

    files = [(_model_file(output, form), "yaml"), (output, form.name)]
    if form.read:
        yield "wrote", output, f"next: {next_check(files[1], more=rest)}"
        return
    yield "wrote", output, ""
    beside, content = files[0][0], export(model, "yaml").content
    if Path(beside).exists() and read_bounded(beside) != content:
        yield "kept", beside, "the file exists already, with another model"
        return
    write_atomically(beside, content)
    after = next_check(*files, more=rest) or next_check(files[0], more=rest)
    yield "wrote", beside, f"the model; next: {after}"


def _settings(options: LearnOptions) -> LearningSettings:
    """Return the settings of the options on the command line."""
    from fuzzytree.learning import LearningSettings

    values = {
        name: getattr(options, name)
        for name in LearningSettings.__struct_fields__
        if getattr(options, name) is not None
    }
    costs = values["costs"] = {}
    for column, text in _pairs("--cost", options.costs):
        try:
            costs[column] = float(text)
        except ValueError as error:
            text = f"--cost {column}: {text!r} is no number"
            raise click.UsageError(text) from error
    with wrong_options():
        return LearningSettings(**values)


def _pairs(option: str, texts: Sequence[str]) -> list[tuple[str, str]]:
    pairs: list[tuple[str, str]] = []
    for text in texts:
        column, equals, value = text.rpartition("=")
        if not (column and equals):
            raise click.UsageError(f"{option} {text!r}: is not COLUMN=VALUE")
        pairs.append((column, value))
    return pairs


def _summary(
    table: Table,
    noticed: Mapping[str, str],
    learnt: Learnt,
    tested: Accuracy | None,
    settings: LearningSettings,
    output: str,
) -> Summary:
    from fuzzytree.api import Summary, majority
    from fuzzytree.model import fingerprint

    return Summary(
        file=output,
        fingerprint=fingerprint(learnt.model),
        rows=table.rows,
        columns=table.columns,
        classes=table.classes,
        missing_cells=table.missing,
        rows_without_class=table.unlabelled,
        rows_without_weight=table.weightless,
        remarks=dict(noticed),
        inputs=learnt.model.inputs,
        leaves=len(learnt.model.leaves),
        accuracy=tested.mean if tested else None,
        majority=majority(table, settings),
        folds=tested.folds if tested and not tested.is_of_tree else None,
        rows_tested=tested.rows if tested else None,
        seed=settings.seed,
        report=learnt.report,
    )


def _read_text(table: Table) -> str:
    from fuzzytree.report import counted

    text = (
        f"{counted(table.rows, 'row')}, {counted(len(table.columns), 'column')}, "
        f"{counted(len(table.classes), 'class', 'classes')}"
    )
    odd = [counted(table.missing, "missing cell")] if table.missing else []
    if table.unlabelled:
        odd.append(counted(table.unlabelled, "row") + " without a class left out")
    if table.weightless:
        odd.append(counted(table.weightless, "row") + " of weight 0 left out")
    return f"{text} ({', '.join(odd)})" if odd else text


def _accuracy_text(
    tested: Accuracy | None, table: Table, settings: LearningSettings
) -> str:
    from fuzzytree.api import majority
    from fuzzytree.report import counted

    baseline = f"majority class {majority(table, settings):.3f}"
    if settings.class_weight is not None:
        baseline = f"by the weights of classes; {baseline}"
    if tested is None:
        return f"too few rows for cross-validation ({baseline})"
    if tested.is_of_tree:
        return f"on {tested.rows:,} rows that it was not learnt from ({baseline})"
    folds = counted(len(tested.folds), "fold")
    kept = f"the {len(table.codes):,} rows that were kept of "
    part = f" on {tested.rows:,} of {kept if table.weights is not None else ''}"
    part = f"{part}{tested.of:,} rows" if tested.rows < tested.of else ""
    span = f"{min(tested.folds):.3f} to {max(tested.folds):.3f}"
    return f"cross-validated ({baseline}; {folds}{part}: {span})"


def _timed(text: str, begin: float) -> str:
    return f"{text}, {time.perf_counter() - begin:.2f} s"


def _report_rows(
    report: LearningReport, *, is_verbose: bool
) -> list[tuple[str, str, str]]:
    """Return lines about what the learner left out or changed."""
    from fuzzytree.report import counted

    rows: list[tuple[str, str, str]] = []
    if report.rows_dropped:
        text = counted(report.rows_dropped, "row")
        rows.append(("dropped", text, "a value or the class is missing"))
    if report.rows_filled:
        text = counted(report.rows_filled, "row")
        why = "a value is missing; what stands for it is part of the model"
        rows.append(("filled", text, why))
    if report.sampled:
        text = counted(report.rows_sampled, "row")
        rows.append(("sampled", text, f"learnt from {report.sampling}"))
        text = "from the rows that were kept; `collect --for` counts all rows"
        rows.append(("estimated", "supports of leaves", text))
    if report.features_ignored:
        text = counted(len(report.features_ignored), "column")
        names = _names(report.features_ignored, is_verbose=is_verbose)
        rows.append(("ignored", text, f"constant or too large: {names}"))
    if report.classes_without_rows:
        text = counted(len(report.classes_without_rows), "class", "classes")
        names = _names(report.classes_without_rows, is_verbose=is_verbose)
        rows.append(("no rows", text, f"no usable row is left of: {names}"))
    if report.inseparable:
        text = counted(report.inseparable, "pattern")
        rows.append(("merged", text, "no input distinguishes their classes"))
    if report.repairs:
        text = counted(report.sets, "set")
        short = "fitted to rows that the paper's method does not expect; --verbose"
        why = "; ".join(report.repairs) if is_verbose else short
        rows.append(("adjusted", text, why))
    return rows


def _names(names: Sequence[str], *, is_verbose: bool) -> str:
    shown = names if is_verbose else names[:8]
    return ", ".join(shown) + (", ..." if len(shown) < len(names) else "")
