"""Files that were made of a model: their content, and then their answers.

To run a file is to execute what stands in it. So a program runs only if its text is
what this version writes of the model, or if the user says so.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple, cast, get_args

import msgspec
import numpy as np

from fuzzytree.checking.comparing import (
    OTHER_FUNCTION,
    Allow,
    Finding,
    ModelRun,
    RowSet,
    answer_names,
    compare,
    counted,
    file_content,
    judged,
    labels,
    within,
)
from fuzzytree.checking.equivalence import as_points_once, is_equivalent, with_functions
from fuzzytree.checking.subject import Subject, fixed_errors, rounding
from fuzzytree.errors import FuzzyTreeError, LossError, MissingExtraError
from fuzzytree.exporters import find_format, fixed_point, stated_options
from fuzzytree.model import (
    Comparison,
    Conjunction,
    Document,
    Dtype,
    FileContent,
    FloatArray,
    Format,
    FuzzySystem,
    FuzzyTree,
    Kind,
    Model,
    RuleBase,
    Unchecked,
    Use,
    Written,
    option_value,
)
from fuzzytree.numerics import by_points, short_above, strength_bounds
from fuzzytree.runtimes import (
    ENGINES,
    OnnxModel,
    Options,
    ProgramOutcome,
)
from fuzzytree.semantics import (
    ResultKind,
    as_rules,
    proof_faults,
    pruned,
    rules_from_tree,
)

_MOST_ROWS: Final = 2_000  # that a program answers, but for those of C
_LONGEST: Final = 80  # characters of a line
_SERVICES: Mapping[Use, str] = {
    "tree": "path",
    "relative": "relative rules",
    "raw": "raw rules",
}
_SERVED: tuple[tuple[Use, ...], ...] = (
    ("tree", "relative", "raw"),
    ("tree", "relative"),
    ("tree", "raw"),
    ("tree",),
)
"""What a pruned tree may serve, the most first."""


class ProgramFile(msgspec.Struct, frozen=True):
    """A file that is run and not read back.

    Attributes:
        format: The name of its format.
        content: The file.
        may_run: Whether it runs whatever its text is.
    """

    format: str
    content: bytes
    may_run: bool = False


Shipped = Document | OnnxModel | ProgramFile


def check_file(subject: Subject, title: str, other: Shipped) -> Iterator[Finding]:
    """Compare a file that was shipped beside a model: its content, then its answers."""
    if isinstance(other, ProgramFile):
        yield from check_program(subject, title, other)
    elif isinstance(other, OnnxModel):
        yield from _check_onnx(subject, title, other)
    else:
        yield from _check_model(subject, title, other)


def _compare_answers(
    subject: Subject,
    title: str,
    answers: ProgramOutcome,
    model: Document,
    dtype: Dtype,
    rows: RowSet,
    *,
    allow: Allow | None = None,
    with_results: bool = True,
) -> Iterator[Comparison]:
    """Compare what a file answers with the native runtime, then its labels.

    It has the bits of its number type, unless another bound is given. If the type
    cannot hold the model without loss, it is compared with double, within what rounding
    can change.
    """
    allow = subject.exactly(model) if allow is None else allow
    if model.outputs and dtype != "float64":
        allow, dtype = rounding(model, dtype), "float64"
    try:
        base = subject.native(model, dtype, rows=rows)
    except LossError:
        base, allow = subject.native(model, rows=rows), rounding(model, dtype)
    if with_results:
        actual = ModelRun(title, model, answers.outcome)
        kinds = [k for k in get_args(ResultKind) if k != "status" or answers.has_status]
        yield compare(actual, base, rows, allow, kinds=kinds)
    if answers.labels is not None:
        classes = [*answer_names(base), None]
        wanted = [classes[number] for number in labels(base).tolist()]
        pairs = zip(answers.labels, wanted, strict=True)
        faults = [
            f"{rows.name(row)}: label {text!r} where {label!r} is right"
            for row, (text, label) in enumerate(pairs)
            if text != label
        ]
        yield counted("rows", title, "the model's classes", len(wanted), faults)


# --- models


def _check_model(subject: Subject, title: str, other: Document) -> Iterator[Finding]:
    """Compare a file that is read as a model: its content, then its answers."""
    model, content = subject.model, file_content(title, other)
    yield content
    if content.form == "tree" and model.rules:
        other = _as_rules(cast("FuzzyTree", other), cast("RuleBase", model)) or other
    form = file_content(title, other).form
    conjunction = None if model.outputs else cast("Model", other).semantics.conjunction
    expected = counterpart(subject, form, conjunction)
    fault = _signature_fault(subject, other)
    if fault is not None:
        if expected is not None and not model.outputs:
            yield _content(subject, title, other, expected, [])
        yield counted("file", title, f"{subject.noun}'s {fault[0]}", 1, fault[1:])
        return
    actual = subject.native(other, title=title)
    base = subject.native(expected or model)
    near = [*_near(subject, actual, base)]
    if near:
        yield from near
        return
    fired, right = actual.outcome.strengths, base.outcome.strengths
    if fired is not None and right is not None and len(fired) != len(right):
        outcome = msgspec.structs.replace(actual.outcome, strengths=None)
        actual = ModelRun(title, other, outcome)
    is_like = bool(model.outputs) or answer_names(actual) == answer_names(base)
    kinds = None if is_like and expected is not None else ("class",)
    answers = compare(
        actual, base, subject.rows, subject.exactly(base.model), kinds=kinds
    )
    if expected is None:
        yield judged(title, subject.noun, (no_counterpart(subject),), [answers])
    else:
        yield _content(subject, title, other, expected, [answers])
    yield answers


def counterpart(
    subject: Subject, form: str, conjunction: Conjunction | None
) -> Document | None:
    """Return what a file of a form should hold: the model, or rules of a tree.

    None if they cannot be made from the model, or are raw where they should not be.
    """
    tree = subject.tree
    if (form == "tree") == (tree is not None):
        return subject.model
    kind: Kind = "raw" if form == "raw rules" else "relative"
    is_other = kind == "raw" and not (subject.model.sets and subject.terms == "raw")
    if tree is None or is_other:
        return None
    return rules_from_tree(tree, kind, conjunction=conjunction)


def no_counterpart(subject: Subject) -> str:
    """Return why a file has no counterpart."""
    if subject.tree is None:
        return "it is a tree, and no tree can be made of rules"
    if subject.terms != "raw":
        return OTHER_FUNCTION
    return "raw rules cannot be made of a tree without fitted sets"


def _signature_fault(subject: Subject, other: Document) -> tuple[str, str] | None:
    """Return which inputs or answers are others, and how; names of a system may be."""
    if subject.model.outputs:
        systems = [cast("FuzzySystem", one) for one in (other, subject.model)]
        (inputs, outputs), right = [(len(s.inputs), len(s.outputs)) for s in systems]
        if (inputs, outputs) == right:
            return None
        text = f"it computes {outputs} outputs from {inputs} inputs, and "
        text += f"the system {right[1]} from {right[0]}"
        return "inputs and outputs", text
    one, model = cast("Model", other), cast("Model", subject.model)
    for what, names, known in (
        ("inputs", one.inputs, model.inputs),
        ("classes", tuple(sorted(one.classes)), tuple(sorted(model.classes))),
    ):
        if names != known:
            return what, f"its {what} are {', '.join(names)}"
    return None


def _near(subject: Subject, actual: ModelRun, base: ModelRun) -> Iterator[Comparison]:
    """Compare rules that have points for curves of others, within their bound."""
    model, other = base.model, actual.model
    if subject.model.outputs or not (model.rules and other.rules):
        return
    both = cast("tuple[RuleBase, RuleBase]", (model, other))
    try:
        near = by_points(both[0], subject.tolerance)
    except LossError:
        return
    if not (near.terms and near.model == other):
        return

    def bounds(values: FloatArray) -> tuple[FloatArray, str]:
        first, second = (strength_bounds(one, "float64", values)[0] for one in both)
        return near.bound + first + second, near.origin

    against = f"the model within {short_above(near.bound)}: curves became points"
    yield counted("file", actual.title, against, 1, ())
    yield compare(actual, base, subject.rows, within(bounds))


def _as_rules(tree: FuzzyTree, model: RuleBase) -> RuleBase | None:
    """Return the rules of a tree that a model made from it should equal."""
    if model.kind is None or (model.kind == "raw" and not tree.sets):
        return None
    return rules_from_tree(tree, model.kind, conjunction=model.semantics.conjunction)


def _content(
    subject: Subject,
    title: str,
    other: Document,
    expected: Document,
    rows: Sequence[Comparison],
) -> Comparison:
    """Compare the content of a file with what it should be: whole, or pruned.

    What `fuzzytree needs` writes is made once more, then compared with the model by
    proof; what is left of a tree need not serve all that the tree does.
    """
    both = (with_functions(model, as_points_once) for model in (expected, other))
    fault = first_difference(*both)
    if fault and expected.outputs and is_equivalent(expected, other):
        return counted("file", title, "the system but for names", 1, ())
    for uses in _SERVED if fault else ():
        if "raw" in uses and not expected.sets:
            continue
        if pruned(expected, uses=uses).model == other:
            faults = tuple(proof_faults(expected, other, uses=uses))
            served = " and ".join(_SERVICES[use] for use in uses)
            served = "rules" if expected.rules else served
            return counted("proof", title, f"the model's {served}", 1, faults)
    return judged(title, subject.noun, (fault,) if fault else (), rows)


def first_difference(expected: msgspec.Struct, actual: msgspec.Struct) -> str | None:
    """Return where two models differ first, and how; None if they are equal.

    Example:
        >>> from fuzzytree.model.rulebase import Band
        >>> first_difference(Band(1.0, 2.0), Band(1.0, 3.0))
        'high: 3.0 where 2.0 is right'
    """
    if expected == actual:
        return None
    return _differ((), msgspec.to_builtins(expected), msgspec.to_builtins(actual))


def _differ(path: tuple[str, ...], expected: object, actual: object) -> str | None:
    if isinstance(expected, dict) and isinstance(actual, dict):
        for key in dict.fromkeys([*expected, *actual]):
            text = _differ((*path, str(key)), expected.get(key), actual.get(key))
            if text:
                return text
        return None
    where = ", ".join(path)
    if isinstance(expected, list | tuple) and isinstance(actual, list | tuple):
        for number, (one, two) in enumerate(zip(expected, actual, strict=False), 1):
            text = _differ((*path[:-1], f"{path[-1]} {number}"), one, two)
            if text:
                return text
        if len(expected) != len(actual):
            return f"{where}: {len(actual)} where {len(expected)} are right"
        return None
    if expected == actual:
        return None
    return f"{where}: {actual!r} where {expected!r} is right"


# --- ONNX


def _check_onnx(subject: Subject, title: str, file: OnnxModel) -> Iterator[Finding]:
    """Compare an ONNX file: what it says of itself, its graph, and its answers."""
    names = {"descent": "tree", "relative": "relative rules", "raw": "raw rules"}
    content = FileContent(title, names.get(file.kind, file.kind), file.dtype)
    yield content
    fault = _foreign(subject, file)
    if fault is not None:
        yield counted("file", title, f"{subject.noun}'s facts", 1, (fault,))
        return
    from fuzzytree.exporters import differences

    stated = "tree" if file.representation == "tree" else content.form
    form = counterpart(subject, stated, file.semantics.conjunction)
    faults: Sequence[str] = (no_counterpart(subject),)
    if form is not None:
        apart = differences(file.content, form)
        faults = apart.graph
        yield counted("file", title, f"{subject.noun}'s metadata", 1, apart.metadata)
    rows, run = subject.rows, file.run_labelled
    values = rows.values
    try:
        outcome, texts = (file.run(values), None) if run is None else run(values)
        answers = ProgramOutcome(outcome, texts, "status" in file.outputs)
        compared = _compare_answers(
            subject,
            title,
            answers,
            form or subject.model,
            file.dtype,
            rows,
            with_results=form is not None,
        )
        results = [*compared]
    except LossError as error:  # the file loads, but onnxruntime cannot run it
        size = len(rows.numbers)
        results = [counted("rows", title, subject.base, size, (str(error),))]
    yield judged(title, "a freshly written graph", faults, results)
    yield from results


def _foreign(subject: Subject, file: OnnxModel) -> str | None:
    """Return why an ONNX file cannot be one of this model; None if it can be."""
    native = next(iter(subject.runs.values()))
    right = subject.model.inputs, answer_names(native)
    if right == (file.inputs, file.classes or file.names):
        return None
    what = f"computes {', '.join(file.names)}"
    if not file.names:
        what = f"decides for {', '.join(file.classes)}"
    inputs = ", ".join(file.inputs)
    return f"it {what} from {inputs}, which are not {subject.noun}'s"


# --- programs


class _Text(NamedTuple):
    """What this version writes of a form of a model.

    Attributes:
        form: The form.
        options: The writer's.
        lines: The text.
    """

    form: Document
    options: Options
    lines: list[bytes]


def check_program(
    subject: Subject, title: str, program: ProgramFile
) -> Iterator[Finding]:
    """Compare a program with what is written now; run it if they are equal.

    Raw rules of a tree are not run unless they may stand in a file.
    """
    form = find_format(program.format)
    lines = program.content.splitlines(keepends=True)
    try:
        stated = stated_options(program.content).items()
        options = {name: option_value(form, name, text) for name, text in stated}
        nearest = _nearest(form, subject, lines, options)
    except ValueError as error:
        fault = f"the model cannot be written as {form.name}: {error}"
        yield counted("file", title, "a freshly written file", 1, (fault,))
        return
    content = file_content(title, nearest.form, options.get("dtype", "float64"))
    yield content
    if subject.tree and content.form == "raw rules" and subject.terms != "raw":
        yield judged(title, "a freshly written file", (OTHER_FUNCTION,), ())
        return
    faults = tuple(_faults(nearest.lines, lines))
    results: list[Finding] = []
    why = _why_not(nearest, form)
    if why is None and faults and not program.may_run:
        why = "only --run-code runs a file with another text"
    if why is None:
        try:
            results = [*_run(subject, title, program, nearest)]
        except MissingExtraError as error:
            why = str(error)
    if why is not None:
        yield Unchecked(title, why)
    yield judged(title, "a freshly written file", faults, results)
    yield from results


def _nearest(
    form: Format, subject: Subject, lines: list[bytes], options: Options
) -> _Text:
    """Return the text that a file equals, or else that shares the most first lines.

    Raises:
        ValueError: If nothing can be written with the options.
    """
    write = cast("Callable[..., Written]", form.write)  # the options are its own
    best, most = None, -1
    fault = ValueError("its numbers are no class of rules")
    for document in _documents(subject, form):
        try:
            written = write(document, allow_loss=True, **options)
        except ValueError as error:
            fault = error
            continue
        text = written.content.splitlines(keepends=True)
        same = (one == two for one, two in zip(text, lines, strict=False))
        shared = sum(1 for _ in itertools.takewhile(bool, same))
        if text == lines:
            return _Text(document, options, text)
        if shared > most:
            best, most = _Text(document, options, text), shared
    if best is None:
        raise fault
    return best


def _documents(subject: Subject, form: Format) -> Iterator[Document]:
    """Yield what a file may have been written of: a model, or rules made from it."""
    if subject.model.outputs and "system" not in form.carries:
        rules = as_rules(cast("FuzzySystem", subject.model))
        yield from () if rules is None else (rules,)
        return
    yield from subject.forms.values()
    tree = subject.tree
    if tree is not None:
        for kind in ("relative", "raw") if tree.sets else ("relative",):
            for conjunction in ("minimum", "product"):
                if conjunction != tree.semantics.conjunction:
                    yield rules_from_tree(tree, kind, conjunction=conjunction)


def _faults(right: list[bytes], lines: list[bytes]) -> Iterator[str]:
    """Yield the first line that differs."""
    for number, (one, two) in enumerate(
        itertools.zip_longest(right, lines, fillvalue=b""), 1
    ):
        if one != two:
            yield f"line {number}: {_shown(two)} where {_shown(one)} is right"
            return


def _shown(line: bytes) -> str:
    text = line.decode("utf-8", "replace").rstrip("\n")
    return repr(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}...")


def _why_not(text: _Text, form: Format) -> str | None:
    """Return why no engine runs a program here; None if one does."""
    if form.name not in ENGINES:
        return f"no engine for {form.name} is known here"
    dialect = text.options.get("dialect", "sqlite")
    if dialect not in ("sqlite", "duckdb"):
        return f"no engine for SQL of the dialect {dialect} is known here"
    if text.options.get("module") == "script":
        return "only JavaScript modules are run"
    if text.options.get("keep"):
        return "a query runs here if it gives the inputs, and no other columns"
    if text.options.get("curves") == "points":
        return "PMML whose curves became points is another function"
    return None


def _run(
    subject: Subject, title: str, program: ProgramFile, text: _Text
) -> Iterator[Finding]:
    """Run a program, and compare its answers with those of the form it was made of.

    Raises:
        MissingExtraError: If an engine is missing.
    """
    rows, model, allow = subject.rows, text.form, None
    total, stated = len(rows.numbers), text.options.get("dtype")
    dtype: Dtype = "float32" if stated == "float32" else "float64"
    if stated in ("q15", "q31"):
        fixed = fixed_point(model, text.options)
        rows = rows.part(np.flatnonzero(~np.isnan(rows.values).any(axis=0)))
        values = fixed.whole_inputs(rows.values) / fixed.input_units
        rows, allow = msgspec.structs.replace(rows, values=values), fixed_errors(fixed)
        if count := total - len(rows.numbers):
            yield f"{title}: {count} of {total} rows; fixed point has no missing values"
    if model.outputs and dtype == "float32":
        with np.errstate(over="ignore"):  # it is missing in that type
            single = rows.values.astype(np.float32).astype(np.float64)
        rows = msgspec.structs.replace(rows, values=single)
    if program.format == "sql":
        rows = _table_rows(model, rows)
    if program.format != "c":
        rows = rows.share(_MOST_ROWS)
        if len(rows.numbers) < total:
            count = len(rows.numbers)
            yield f"{title}: {total - count} of {total} rows; {count} others were run"
    try:
        engine = ENGINES[program.format]
        result = engine(program.content, model, text.options, rows.values)
    except MissingExtraError:
        raise
    except (FuzzyTreeError, ValueError, LookupError) as error:
        faults = ("; ".join(str(error).splitlines()),)
        yield counted("rows", title, "the model", len(rows.numbers), faults)
        return
    yield from _compare_answers(subject, title, result, model, dtype, rows, allow=allow)


def _table_rows(model: Document, rows: RowSet) -> RowSet:
    """Return rows as a table of SQL can hold them: of categories those with a name."""
    values = rows.values.copy()
    inputs = [variable for variable in model.variables if not variable.parts]
    for line, variable in enumerate(inputs):
        if variable.categories:
            places = np.rint(values[line])
            values[line] = np.clip(places, 0, len(variable.categories) - 1)
    return msgspec.structs.replace(rows, values=values)
