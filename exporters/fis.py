"""FIS: rule bases and systems for MATLAB, Octave's fuzzy-logic-toolkit and fuzzylite.

`docs/reference/fis.md` describes the file. A rule tests every input at most once and
joins all of them by `and` or all by `or`: other conditions become terms of their own
(`fuzzytree.exporters.fis_rules`), or the file is not written.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, Literal

from fuzzytree.errors import LossError
from fuzzytree.exporters.fis_rules import FisRule, FisTerms, lines_of
from fuzzytree.exporters.fis_terms import number_of, term_of, with_known_curves
from fuzzytree.exporters.fuzzy_files import (
    TITLE,
    FileNames,
    file_system,
    grid_losses,
    refuse,
    without_heights,
)
from fuzzytree.formats import (
    DEFAULTS,
    DIALECT,
    DIALECTS,
    FAR,
    FIS_METHODS,
    FIS_SNORMS,
    FIS_TNORMS,
    PRIVATE,
    Dialect,
    always_concluded,
    fuzzylite_losses,
    method_loss,
    middle,
    read_fis,
    word_for,
)
from fuzzytree.model import (
    Activation,
    Format,
    FuzzySystem,
    Loss,
    NameMap,
    RuleBase,
    SNorm,
    SystemOutput,
    Term,
    Variable,
    Written,
    refusal,
)
from fuzzytree.semantics import (
    FACTS,
    flattened,
    has_numbers,
    joined_outputs,
    number_losses,
    pointed,
    refuse_singletons,
)

_RESERVED: Final = (
    *("and", "or", "if", "then", "is", "with", "not", "any", "very", "somewhat"),
    *("extremely", "seldom", "nan", "inf", "min", "max", "sin", "cos", "exp", "log"),
)
_MATLAB_NORMS: Final = frozenset({"min", "prod", "max", "probor", "sum"})
_FUZZYLITE_NORMS: Final = frozenset(
    {"nilpotent_minimum", "nilpotent_maximum", "normalized_sum"}
)


def write(
    model: RuleBase | FuzzySystem,
    /,
    *,
    allow_loss: bool = False,
    dialect: Dialect = "octave",
    tolerance: float = 1e-6,
    curves: Literal["any", "standard"] = "any",
) -> Written:
    """Return a rule base or a system as a FIS file.

    Args:
        model: The model. Of a rule base each rule has a score, see
            `fuzzytree.semantics.conversion.scores`.
        allow_loss: Whether to write what FIS cannot express as near as it can.
        dialect: For whom the file is: `matlab`, `octave` or `fuzzylite`.
        tolerance: The largest error of a degree where points stand for a curve.
        curves: `standard` counts lists of points, `discretemf`, as a loss: MATLAB and
            Octave need a small function for them, which `docs/reference/fis.md` shows.

    Raises:
        LossError: If something would be lost, unless allowed; and always if the rules
            have no place in FIS.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(1, leaves=2, combinations=0.0))
        >>> text = write(rules, allow_loss=True).content.decode()
        >>> "AndMethod='min'" in text
        True
    """
    if dialect not in DIALECTS:
        raise ValueError(f"no dialect {dialect!r}; there is {', '.join(DIALECTS)}")
    source = file_system(model, tolerance, always="term")
    system, losses, remarks, facts, _ = source
    comments = [TITLE, f"{DIALECT}{dialect}", *([FACTS + facts] if facts else [])]
    if model.outputs:
        refuse_singletons(system, "fis")
    system, lost = flattened(system)
    losses += lost
    if any(one.height != 1.0 for v in system.all_variables for one in v.terms):
        system, lost = pointed(system, 1e-6)
        losses += lost
        system = without_heights(system, "FIS", losses)
    system, lost = with_known_curves(system, dialect, tolerance)
    losses += [*lost, *_losses(system, dialect)]
    if model.outputs:  # of scores, a rule always fires
        losses += _default_losses(system, dialect)
    terms = FisTerms(system, dialect, tolerance)
    lines = _lines(system, terms)
    losses += terms.losses
    private = [*_private_losses(terms, dialect)]
    if curves == "standard":
        losses += private
    elif private and dialect != "fuzzylite":
        remarks.append(
            f"{private[0].where}: {private[0].what}; terms that need a function of "
            f"docs/reference/fis.md: {len(private)}; --set curves=standard counts them "
            "as losses"
        )
    if losses and not allow_loss:
        raise refusal(model.name, "fis", losses)
    names = _naming(system, terms)
    remarks += names.remarks(system)
    text = _text(system, (terms, lines), (comments, names), dialect, remarks)
    return Written(text.encode("utf-8"), tuple(losses), tuple(remarks), names.changed())


def _naming(system: FuzzySystem, terms: FisTerms) -> FileNames:
    labels = {**terms.labels, **{one.name: one.terms for one in system.outputs}}
    return FileNames(
        NameMap.of([one.name for one in system.all_variables], reserved=_RESERVED),
        {
            name: NameMap.of([one.name for one in own], reserved=_RESERVED)
            for name, own in labels.items()
        },
        NameMap.of([system.name]),
    )


def _lines(system: FuzzySystem, terms: FisTerms) -> list[FisRule]:
    """Return all rules."""
    lines: list[FisRule] = []
    reasons: list[str] = []
    placed = [(block, rule) for block in system.blocks for rule in block.rules]
    for number, (block, rule) in enumerate(placed, 1):
        try:
            lines += lines_of(rule, block, terms, number)
        except LossError as error:
            reasons.append(f"rule {number}: {error}")
    is_weighted = system.outputs[0].defuzzifier.is_weighted
    for output in system.outputs:
        if output.defuzzifier.is_weighted != is_weighted:
            reasons.append(
                f"output {output.name!r}: a file is Mamdani or Sugeno as a whole, "
                "and the first output is the other"
            )
            continue
        for label in output.terms:
            if not _terms(output, [label], terms.dialect):
                reasons.append(
                    f"term {label.name!r} of {output.name!r}: {terms.dialect} has no "
                    "such conclusion"
                )
    refuse(system.name, "fis", reasons)
    return lines


def _losses(system: FuzzySystem, dialect: Dialect) -> Iterator[Loss]:
    """Yield what one set of methods for the whole file cannot express."""
    first = system.outputs[0]
    joined = joined_outputs(system)
    for output in system.outputs:
        where = f"output {output.name!r}"
        how = output.defuzzifier
        if how.method != first.defuzzifier.method:
            what = f"{how.method} becomes {first.defuzzifier.method}, as of the first"
            yield Loss(where, what)
        if lost := method_loss(how.method, output.low, dialect):
            yield Loss(where, lost)
        whose = f"FIS does not say so; {dialect} takes"
        yield from grid_losses(output, DEFAULTS[dialect], whose)
        if output.aggregation != first.aggregation:
            yield Loss(where, f"joined by {first.aggregation}, as of the first output")
        elif how.is_weighted and output.aggregation and dialect != "octave":
            what = f"{output.aggregation} becomes a sum: {dialect} knows no other here"
            if output.name not in joined:
                what = "it is added in the order of the rules: only rounding differs"
            yield Loss(where, what)
        if dialect == "fuzzylite":
            yield from fuzzylite_losses(output)
    for variable in system.all_variables:
        if variable.clips and dialect != "fuzzylite":
            what = "values are not moved into the range"
            yield Loss(f"variable {variable.name!r}", what)
    if dialect == "octave":
        yield from number_losses(system)
    yield from _block_losses(system, dialect)


def _default_losses(system: FuzzySystem, dialect: Dialect) -> Iterator[Loss]:
    """Yield the defaults of outputs that a dialect cannot express."""
    always = always_concluded(system.rules)
    for output in system.outputs:
        where = f"output {output.name!r}"
        if dialect == "octave" and output.default is not None:
            what = f"FIS has no default, {output.default!r}, where no rule fires"
            yield Loss(where, what)
        elif dialect == "matlab" and output.name not in always:
            number = middle(*_range(output, _terms(output, output.terms, dialect)))
            if number != output.default:
                default = output.default
                other = "no number" if default is None else repr(default)
                what = f"where no rule fires, MATLAB answers {number!r}, not {other}"
                yield Loss(where, what)


def _block_losses(system: FuzzySystem, dialect: Dialect) -> Iterator[Loss]:
    for number, block in enumerate(system.blocks, 1):
        where = f"block {number} of rules"
        first = system.blocks[0]
        if block.activation != Activation():
            what = f"all rules are activated, not by {block.activation.method}"
            yield Loss(where, what)
        norms = (block.conjunction, block.disjunction, block.implication)
        if norms != (first.conjunction, first.disjunction, first.implication):
            yield Loss(where, "the file has one set of norms, those of the first block")
    for key, word in _methods(system, dialect).items():
        is_known = (
            word in _MATLAB_NORMS or word not in {**FIS_TNORMS, **FIS_SNORMS}
            if dialect == "matlab"
            else dialect == "fuzzylite" or word not in _FUZZYLITE_NORMS
        )
        if not is_known:
            yield Loss(key, f"{dialect} knows no {word!r}, and cannot run the file")


def _methods(system: FuzzySystem, dialect: Dialect) -> dict[str, str]:
    """Return the methods of a file by their keys."""
    block = system.blocks[0]
    output = system.outputs[0]
    is_weighted = output.defuzzifier.is_weighted
    aggregation = output.aggregation or ("sum" if is_weighted else "maximum")
    return {
        "AndMethod": word_for(FIS_TNORMS, block.conjunction, "min"),
        "OrMethod": _s_norm(block.disjunction or "maximum", dialect),
        "ImpMethod": word_for(
            FIS_TNORMS, block.implication, "prod" if is_weighted else "min"
        ),
        "AggMethod": _s_norm(aggregation, dialect),
        "DefuzzMethod": word_for(FIS_METHODS, output.defuzzifier.method),
    }


def _s_norm(norm: SNorm, dialect: Dialect) -> str:
    words = [word for word, meant in FIS_SNORMS.items() if meant == norm]
    return words[-1] if dialect == "octave" else words[0]


def _private_losses(terms: FisTerms, dialect: Dialect) -> Iterator[Loss]:
    for name, labels in terms.labels.items():
        for label in labels:
            result = term_of(label.function, dialect)
            if result is not None and result[0] in PRIVATE:
                yield Loss(
                    f"term {label.name!r} of {name!r}",
                    f"it is a {result[0]}, which MATLAB and Octave do not have",
                )


def _terms(
    one: Variable | SystemOutput, labels: Sequence[Term], dialect: Dialect
) -> list[tuple[str, str]]:
    """Return the terms of a variable; those that a dialect has none for are left out.

    `_lines` and `with_known_curves` refuse or replace them before a file is written.
    """
    find = number_of if has_numbers(one) else term_of
    results = (find(label.function, dialect) for label in labels)
    return [result for result in results if result is not None]


def _text(
    system: FuzzySystem,
    rules: tuple[FisTerms, list[FisRule]],
    header: tuple[list[str], FileNames],
    dialect: Dialect,
    remarks: list[str],
) -> str:
    terms, lines = rules
    comments, names = header
    is_weighted = system.outputs[0].defuzzifier.is_weighted
    head = {
        "Name": f"'{names.system[system.name]}'",
        "Type": "'sugeno'" if is_weighted else "'mamdani'",
        "Version": "2.0",
        "NumInputs": str(len(system.variables)),
        "NumOutputs": str(len(system.outputs)),
        "NumRules": str(len(lines)),
        **{key: f"'{word}'" for key, word in _methods(system, dialect).items()},
    }
    blocks = [[f"# {comment}" for comment in comments], _section("System", head)]
    for number, one in enumerate(system.variables, 1):
        labels = terms.labels[one.name]
        blocks.append(_variable(f"Input{number}", one, labels, names, dialect))
    for number, output in enumerate(system.outputs, 1):
        title = f"Output{number}"
        block = _variable(title, output, output.terms, names, dialect)
        if dialect == "fuzzylite" and output.default is not None:
            block.insert(3, f"Default={output.default!r}")
        blocks.append(block)
    rows = [_rule(line, system) for line in lines]
    blocks.append(["[Rules]", *rows])
    if any(one.low is None or one.high is None for one in system.variables):
        remarks.append("the range of an input is unknown; all numbers lie in it")
    if dialect == "octave":
        remarks.append(
            "Octave refuses rows with a value outside the Range of its input"
        )
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _section(title: str, entries: Mapping[str, str]) -> list[str]:
    return [f"[{title}]", *(f"{key}={value}" for key, value in entries.items())]


def _variable(
    title: str,
    one: Variable | SystemOutput,
    labels: Sequence[Term],
    names: FileNames,
    dialect: Dialect,
) -> list[str]:
    terms = _terms(one, labels, dialect)
    low, high = _range(one, terms)
    entries = {
        "Name": f"'{names.variables[one.name]}'",
        "Range": f"[{low!r} {high!r}]",
        "NumMFs": str(len(labels)),
    }
    for number, (label, term) in enumerate(zip(labels, terms, strict=True), 1):
        name = names.labels[one.name][label.name]
        entries[f"MF{number}"] = f"'{name}':'{term[0]}',[{term[1]}]"
    lines = _section(title, entries)
    if one.clips:
        lines.insert(3, "LockRange=1")
    return lines


def _range(
    one: Variable | SystemOutput, terms: Iterable[tuple[str, str]]
) -> tuple[float, float]:
    """Return a range; an end that is unknown is `FAR` away for an input.

    Of an output it is guessed from the numbers of its terms.
    """
    numbers: list[float] = []
    for kind, text in terms:
        if kind not in ("function", "linear"):
            result = [*map(float, text.split())]
            numbers += result[::2] if kind == "discretemf" else result
    near = [number for number in numbers if abs(number) < 1e290]
    if isinstance(one, Variable):
        near = [-FAR, FAR]
    low = one.low if one.low is not None else min(near, default=0.0)
    high = one.high if one.high is not None else max(near, default=1.0)
    if low >= high:
        low, high = min(low, high) - 1.0, max(low, high) + 1.0
    return (low, high) if math.isfinite(high - low) else (-1e300, 1e300)


def _rule(line: FisRule, system: FuzzySystem) -> str:
    codes = " ".join(line.codes.get(one.name, "0") for one in system.variables)
    concluded = " ".join(line.concluded.get(one.name, "0") for one in system.outputs)
    connection = 2 if line.is_or else 1
    return f"{codes}, {concluded} ({line.weight!r}) : {connection}"


FORMAT = Format(
    name="fis",
    suffixes=(".fis",),
    carries=("rules", "system"),
    write=write,
    read=read_fis,
    cannot=(
        "a rule that mixes and and or over several inputs, unless rules are joined by "
        "maximum; a rule that tests an output",
        "several blocks of rules, defuzzifiers or aggregations",
        "combinations of inputs: each becomes an input",
        "an answer where no rule fires",
    ),
)
