"""FCL (IEC 61131-7) in four dialects: rule bases and fuzzy systems.

`docs/reference/fcl.md` says which engine reads which dialect, and where they differ.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.exporters.fcl_dialects import WORDS, Dialect, FclWords
from fuzzytree.exporters.fcl_rules import (
    accu_of,
    block_lines,
    check_list,
    has_accu,
    is_always_concluded,
    losses_of,
    norm_losses,
    with_conditions,
)
from fuzzytree.exporters.fcl_terms import (
    as_points,
    plain_linear,
    term_text,
    unspeakable,
)
from fuzzytree.exporters.fll_text import number, speakable
from fuzzytree.exporters.fuzzy_files import (
    TITLE,
    FileNames,
    file_system,
    refuse,
    refuse_scores,
)
from fuzzytree.formats import FACTS, MARK, read_fcl
from fuzzytree.model import (
    DATE_UNIT,
    Band,
    Format,
    FuzzySystem,
    NameMap,
    Or,
    RuleBase,
    SystemOutput,
    Variable,
    Written,
    joints,
    printable,
    refusal,
)
from fuzzytree.rechecking import interval_word
from fuzzytree.semantics import (
    Always,
    Scores,
    flattened,
    refuse_singletons,
)

__all__ = ["FORMAT", "check_list", "write"]


def write(
    model: RuleBase | FuzzySystem,
    /,
    *,
    allow_loss: bool = False,
    dialect: Dialect = "portable",
    scores: Scores = "rule",
    tolerance: float = 1e-6,
    checklist: bool = False,
) -> Written:
    """Return a rule base or a system as an FCL file, in UTF-8.

    Args:
        model: The model.
        allow_loss: Whether to write what the dialect cannot express as near as it can.
        dialect: `portable` is read alike by fuzzylite 6, jFuzzyLogic and JFML.
        scores: What the outputs of a rule base are: a score for each rule (`rule`) or
            class (`class`); see `fuzzytree.semantics.conversion.scores`.
        tolerance: The largest error of a degree where points stand for a curve.
        checklist: Whether the standard's data check list is added as comments.

    Raises:
        LossError: If something would be lost, unless allowed; and always if rules,
            terms or methods have no place in the dialect.
        ValueError: If `scores` is set, and the model is a system.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(1, leaves=2, combinations=0.0))
        >>> text = write(rules, allow_loss=True).content.decode()
        >>> text.splitlines()[0]
        '// FCL, dialect portable'
    """
    words = WORDS[dialect]
    refuse_scores(model, scores, "rule")
    if scores == "winner":
        raise LossError(
            "FCL activates all rules, and not the strongest alone; "
            "pass scores=rule or scores=class"
        )
    always: Always = "any" if words.has_hedges else "term"
    source = file_system(model, tolerance, scores, always=always)
    system, losses, remarks, facts, is_relative = source
    if is_relative and any(one.bound is not None for one in losses):
        remarks.append(
            "the decisions are exact: every term is 1 where it was, and less "
            "elsewhere, so the same rule wins in every row"
        )
    if model.outputs:
        refuse_singletons(system, "fcl")
        plain = plain_linear(system) if dialect == "jfuzzylogic" else system
        system = with_conditions(plain, words)
        if system != model:
            remarks.append(
                "rules without a condition, or weighted sums, were rewritten"
            )
    system, lost = flattened(system)
    losses += lost
    system, more = as_points(system, words, tolerance)
    losses += [*more, *losses_of(system, words)]
    system = _refused(system, words)
    if losses and not allow_loss:
        raise refusal(model.name, f"fcl ({dialect})", losses)
    names = _naming(system, words)
    comments = [one for one in (MARK + dialect, facts and FACTS + facts) if one]
    if checklist:
        comments += [f" {line}" for line in check_list(system).splitlines()]
    comments += [f" {line}" for line in _table_words(model)]
    comments.append(f" {TITLE}")
    start, end = ("(*", " *)") if dialect == "iec" else ("//", "")
    lines = [f"{start}{one}{end}" for one in comments]
    lines += _text(system, names, words)
    remarks += _remarks(system, names, words)
    text = "\n".join(lines) + "\n"
    return Written(text.encode("utf-8"), tuple(losses), tuple(remarks), names.changed())


def _table_words(model: RuleBase | FuzzySystem) -> Iterator[str]:
    """Yield what the numbers of dates and categories mean, and terms in their words."""
    for one in model.variables:
        if not (one.categories or one.unit == DATE_UNIT):
            continue
        places = [f"{place} is {name}" for place, name in enumerate(one.categories)]
        for term in one.terms:
            band = term.function
            if isinstance(band, Band):
                word = interval_word(one, band.low, band.high, "up to")
                places.append(f"{term.name!r} is {word.replace('> ', 'after ')}")
        about = one.unit if one.unit else "positions of categories"
        line = printable(f"{one.name!r}, {about}: {'; '.join(places)}")
        yield line.replace("*", "* ")  # which ends no comment of the dialect iec


class _FclNames(FileNames, frozen=True):
    """The names in a file, with those of its function block and blocks of rules."""

    title: str = ""
    blocks: tuple[str, ...] = ()


def _naming(system: FuzzySystem, words: FclWords) -> _FclNames:
    def named(names: list[str], taken: Iterable[str] = ()) -> NameMap:
        return NameMap.of(
            names,
            taken=taken,
            first="abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ",
            reserved=words.reserved,
            ignores_case=words.ignores_case,
        )

    blocks = [one.name or f"block_{k}" for k, one in enumerate(system.blocks, 1)]
    variables = named([one.name for one in system.all_variables])
    return _FclNames(
        title=named([system.name], variables.accepted.values())[system.name],
        variables=variables,
        labels={
            one.name: named([label.name for label in one.terms])
            for one in system.all_variables
        },
        blocks=tuple(named([name])[name] for name in blocks),
    )


def _refused(system: FuzzySystem, words: FclWords) -> FuzzySystem:
    """Return a system that the dialect has words for."""
    reasons = list(unspeakable(system, words))
    for output in system.outputs:
        where = f"output {output.name!r}"
        method = output.defuzzifier.method
        if method not in words.methods:
            reason = f"the dialect {words.name} has no {method}"
            if words.name == "portable" and not output.defuzzifier.is_weighted:
                reason += (
                    ": fuzzylite and jFuzzyLogic read no file with curves of outputs "
                    "alike; pass dialect=fuzzylite, jfuzzylogic or iec"
                )
            reasons.append(f"{where}: {reason}")
        norm = output.aggregation
        is_curve = not output.defuzzifier.is_weighted
        if is_curve and norm is not None and norm not in words.accus and words.accus:
            reasons.append(f"{where}: the dialect {words.name} has no ACCU {norm!r}")
    blocks = list(system.blocks)
    for k, block in enumerate(system.blocks, 1):
        reasons += norm_losses(block, k, words)
        act = block.implication
        if act is not None and act not in words.acts and words.acts:
            reasons.append(f"rule block {k}: {words.name} has no ACT {act!r}")
        if not words.has_not:
            try:
                blocks[k - 1] = speakable(block)
            except LossError as error:
                reasons.append(f"rule block {k}: {error}")
    if any(rule.when is None for rule in system.rules) and not system.variables:
        reasons.append("a rule without a condition needs an input to test")
    refuse(system.name, "fcl", reasons)
    return replace(system, blocks=tuple(blocks))


def _text(system: FuzzySystem, names: _FclNames, words: FclWords) -> Iterator[str]:
    """Yield the lines of a file."""
    yield f"FUNCTION_BLOCK {names.title}"
    yield "VAR_INPUT"
    for one in system.variables:
        yield f"  {names.variables[one.name]} : REAL;"
        if words.name == "jfuzzylogic":
            yield from _range(one, words)
    yield "END_VAR"
    yield "VAR_OUTPUT"
    for output in system.outputs:
        yield f"  {names.variables[output.name]} : REAL;"
    yield "END_VAR"
    for one in system.variables:
        yield f"FUZZIFY {names.variables[one.name]}"
        if words.name == "fuzzylite":
            yield from _range(one, words)
        yield from _terms(one, names, words)
        yield "END_FUZZIFY"
    for output in system.outputs:
        yield from _defuzzify(output, names, words)
    always = ""
    if system.variables:
        always = f"{names.variables[system.variables[0].name]} is any"
    for block, name in zip(system.blocks, names.blocks, strict=True):
        outputs = {one.output for rule in block.rules for one in rule.then}
        norm = accu_of(system, outputs, words) if has_accu(words) else None
        accu = "" if norm is None else words.accus[norm]
        yield from block_lines(block, name, words, names.words, always, accu)
    yield "END_FUNCTION_BLOCK"


def _range(variable: Variable | SystemOutput, words: FclWords) -> Iterator[str]:
    low, high = variable.low, variable.high
    if low is not None and high is not None:
        yield f"  RANGE := ({number(low)} .. {number(high)});"
    elif words.name == "fuzzylite" and (low is not None or high is not None):
        first = "-inf" if low is None else number(low)
        last = "inf" if high is None else number(high)
        yield f"  RANGE := ({first} .. {last});"


def _terms(
    variable: Variable | SystemOutput, names: _FclNames, words: FclWords
) -> Iterator[str]:
    for label in variable.terms:
        name = names.labels[variable.name][label.name]
        text = term_text(variable, label, words, names.variables.accepted)
        yield f"  TERM {name} := {text};"


def _defuzzify(
    output: SystemOutput, names: _FclNames, words: FclWords
) -> Iterator[str]:
    yield f"DEFUZZIFY {names.variables[output.name]}"
    yield from _terms(output, names, words)
    yield f"  METHOD : {words.methods[output.defuzzifier.method]};"
    if words.name == "fuzzylite" and output.aggregation is not None:
        yield f"  ACCU : {words.accus[output.aggregation]};"
    if output.default is not None:
        yield f"  DEFAULT := {number(output.default)};"
    elif words.name == "fuzzylite":
        yield "  DEFAULT := nan;"
    if output.clips and words.name == "fuzzylite":
        yield "  LOCK : RANGE;"
    yield from _range(output, words)
    yield "END_DEFUZZIFY"


def _remarks(system: FuzzySystem, names: _FclNames, words: FclWords) -> Iterator[str]:
    """Yield what else has no place in the file or has another form there."""
    yield from names.remarks(system)
    if any(one.unit for one in system.all_variables) or system.note:
        yield "units and the note of the system have no place"
    if any(rule.name for rule in system.rules):
        yield "names of rules have no place"
    ranged = [one.name for one in system.variables if one.low is not None]
    if ranged and words.name in ("portable", "iec"):
        yield f"ranges of inputs have no place: of {', '.join(map(repr, ranged[:5]))}"
    if words.is_lower:
        yield (
            "fuzzylite 6 treats values within 1e-6 as equal, and does not fire rules "
            "of a lower degree"
        )
    if words.name == "portable" and any(
        Or in joints(rule.when) for rule in system.rules
    ):
        yield "JFML does not read OR; fuzzylite and jFuzzyLogic agree on it"
    for one in system.outputs:
        has_default = one.default is not None or words.name == "fuzzylite"
        if not has_default and not is_always_concluded(one, system):
            yield (
                f"output {one.name!r}: no DEFAULT is written: where no rule fires, a "
                "row on its own has no number, and jFuzzyLogic's `getValue` that of "
                "the row before"
            )


FORMAT = Format(
    name="fcl",
    suffixes=(".fcl",),
    carries=("rules", "system"),
    write=write,
    read=read_fcl,
    cannot=(
        "a combination of columns; it becomes an input, to be given as its sum",
        "polynomial flanks and LR sets; they become points",
        "the strongest rule alone; each rule has a score, and the highest one wins",
        "the number of samples of a range",
        "inputs that are clamped to their range",
        "portable: outputs with curves, hedges, more than one form of ACCU",
    ),
    dtype="float64",
)
