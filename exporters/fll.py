"""FLL: rule bases and systems for fuzzylite 6 and pyfuzzylite 8.

`docs/reference/fll.md` describes the file and says where the two engines differ.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.exporters.fll_text import (
    degree_text,
    has_not,
    hedge_losses,
    number_text,
    rule_text,
    speakable,
    weighted_type,
)
from fuzzytree.exporters.fuzzy_files import (
    TITLE,
    FileNames,
    file_system,
    grid_losses,
    refuse,
    refuse_scores,
)
from fuzzytree.formats import (
    ACTIVATIONS,
    FLL_METHODS,
    FLL_SNORMS,
    FLL_TNORMS,
    LONGEST_NAME,
    RULE_WORDS,
    differences,
    joined_twice,
    read_fll,
    word_for,
)
from fuzzytree.model import (
    FUNCTIONS,
    LR,
    Activation,
    Band,
    Format,
    FuzzySystem,
    Loss,
    NameMap,
    Points,
    RuleBase,
    RuleBlock,
    SystemOutput,
    Term,
    Trapezoid,
    Variable,
    Written,
    refusal,
)
from fuzzytree.semantics import (
    FACTS,
    Scores,
    flattened,
    has_numbers,
    pointed,
    refuse_singletons,
)

_RESERVED: Final = (*RULE_WORDS, *FUNCTIONS, "fabs", "pow", "pi", "inf", "nan", "x")
_FINEST: Final = 1e-3


def write(
    model: RuleBase | FuzzySystem,
    /,
    *,
    allow_loss: bool = False,
    scores: Scores = "winner",
    tolerance: float = 1e-6,
) -> Written:
    """Return a rule base or a system as an FLL file, in UTF-8.

    Args:
        model: The model.
        allow_loss: Whether to write what FLL cannot express as near as it can.
        scores: What the outputs of a rule base are: the number of the class that wins
            (`winner`), or a score for each rule (`rule`) or class (`class`); see
            `fuzzytree.semantics.conversion.scores`.
        tolerance: The largest error of a degree where points stand for a curve.

    Raises:
        LossError: If something would be lost, unless allowed; and always if rules or
            terms have no place in FLL.
        ValueError: If `scores` is set, and the model is a system.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(1, leaves=2, combinations=0.0))
        >>> text = write(rules, allow_loss=True).content.decode()
        >>> "activation: Highest 1" in text
        True
    """
    refuse_scores(model, scores, "winner")
    source = file_system(model, tolerance, scores)
    system, losses, remarks, facts, is_relative = source
    if facts and not is_relative:
        remarks.append("fuzzylite 6 treats a firing strength below 1e-6 as 0")
    if model.outputs:
        refuse_singletons(system, "fll")
        system, lost = pointed(
            system,
            tolerance,
            keeps=lambda _, term: not isinstance(term.function, Band | LR),
        )
        losses += lost
    system, lost = flattened(system)
    losses += [*lost, *_losses(system)]
    if any(has_not(rule.when) for rule in system.rules):
        remarks.append("NOT is written as the hedge 'not', with the same numbers")
    system = replace(system, blocks=_speakable(system))
    if losses and not allow_loss:
        raise refusal(model.name, "fll", losses)
    names = _naming(system)
    comments = [f"# {one}" for one in (TITLE, facts and FACTS + facts) if one]
    text = "\n".join([*comments, *_text(system, names)]) + "\n"
    remarks += [*_remarks(system, names), *differences(system)]
    remarks += [f"output {o.name!r}: {what}" for o, what, _ in joined_twice(system)]
    return Written(text.encode("utf-8"), tuple(losses), tuple(remarks), names.changed())


def _naming(system: FuzzySystem) -> FileNames:
    return FileNames(
        _accepted([one.name for one in system.all_variables]),
        {
            one.name: _accepted([label.name for label in one.terms])
            for one in system.all_variables
        },
    )


def _accepted(names: Sequence[str]) -> NameMap:
    # Words are reserved in small letters only: a variable may be called X.
    taken = {name.lower() for name in names if name != name.lower()} - {*names}
    reserved = [word for word in _RESERVED if word not in taken]
    return NameMap.of(names, reserved=reserved, longest=LONGEST_NAME)


def _losses(system: FuzzySystem) -> Iterator[Loss]:
    """Yield what outputs depend on and FLL cannot express."""
    for output in system.outputs:
        usual = replace(output.defuzzifier, grid="middle")
        yield from grid_losses(output, usual, "FLL knows only")
    yield from hedge_losses(system.rules)


def _speakable(system: FuzzySystem) -> tuple[RuleBlock, ...]:
    """Return blocks that FLL has words for."""
    reasons: list[str] = []
    blocks: list[RuleBlock] = []
    for block in system.blocks:
        try:
            blocks.append(speakable(block))
        except LossError as error:
            reasons.append(str(error))
    for variable in system.all_variables:
        for label in variable.terms:
            if _term_text(variable, label, {}) is None:
                where = f"term {label.name!r} of {variable.name!r}"
                kind = type(label.function).__name__
                reasons.append(f"{where}: FLL has no {kind} there")
    refuse(system.name, "fll", reasons)
    return tuple(blocks)


def _term_text(
    variable: Variable | SystemOutput, label: Term, names: Mapping[str, str]
) -> str | None:
    if isinstance(variable, SystemOutput) and has_numbers(variable):
        return number_text(label, weighted_type(variable), names)
    return degree_text(label, names)


def _text(system: FuzzySystem, names: FileNames) -> Iterator[str]:
    """Yield the lines of a file."""
    yield f"Engine: {_line(system.name)}".rstrip()
    if system.note:
        yield f"  description: {_line(system.note)}".rstrip()
    for one in system.variables:
        yield f"InputVariable: {names.variables[one.name]}"
        yield from _common(one)
        yield from _terms(one, names)
    for output in system.outputs:
        yield f"OutputVariable: {names.variables[output.name]}"
        yield from _common(output)
        yield f"  aggregation: {word_for(FLL_SNORMS, output.aggregation, 'none')}"
        how = output.defuzzifier
        rest = weighted_type(output) if how.is_weighted else str(how.samples)
        yield f"  defuzzifier: {word_for(FLL_METHODS, how.method, '')} {rest}"
        default = math.nan if output.default is None else output.default
        yield f"  default: {float(default)!r}"
        yield "  lock-previous: false"
        yield from _terms(output, names)
    # One with terms: pyfuzzylite takes a variable without them for none.
    variable = next(
        (one for one in system.all_variables if one.terms), system.outputs[0]
    )
    always = f"{names.variables[variable.name]} is any"
    for block in system.blocks:
        yield f"RuleBlock: {_line(block.name)}".rstrip()
        yield "  enabled: true"
        yield f"  conjunction: {word_for(FLL_TNORMS, block.conjunction, 'none')}"
        yield f"  disjunction: {word_for(FLL_SNORMS, block.disjunction, 'none')}"
        yield f"  implication: {word_for(FLL_TNORMS, block.implication, 'none')}"
        yield f"  activation: {_activation(block.activation)}"
        for rule in block.rules:
            yield f"  rule: {rule_text(rule, names.words, always)}"


def _common(variable: Variable | SystemOutput) -> Iterator[str]:
    low = -math.inf if variable.low is None else variable.low
    high = math.inf if variable.high is None else variable.high
    yield "  enabled: true"
    yield f"  range: {float(low)!r} {float(high)!r}"
    yield f"  lock-range: {str(variable.clips).lower()}"


def _terms(variable: Variable | SystemOutput, names: FileNames) -> Iterator[str]:
    for label in variable.terms:
        name = names.labels[variable.name][label.name]
        yield f"  term: {name} {_term_text(variable, label, names.variables.accepted)}"


def _activation(activation: Activation) -> str:
    word = word_for(ACTIVATIONS, activation.method)
    match activation.method:
        case "general" | "proportional":
            return word
        case "first" | "last":
            return f"{word} {activation.count} {float(activation.threshold)!r}"
        case "highest" | "lowest":
            return f"{word} {activation.count}"
        case "threshold":
            return f"{word} {activation.relation} {float(activation.threshold)!r}"


def _line(text: str) -> str:
    """Return a text for people without what would end a line or begin a comment."""
    kept = "".join(" " if not one.isprintable() else one for one in text)
    return " ".join(kept.replace("#", "no.").split())


def _remarks(system: FuzzySystem, names: FileNames) -> Iterator[str]:
    """Yield what else has no place in the file or has another form there."""
    yield from names.remarks(system)
    texts = [system.name, system.note, *(block.name for block in system.blocks)]
    if any(_line(text) != text for text in texts):
        yield "names of the system and of blocks, and its note, became single lines"
    units = [one.name for one in system.all_variables if one.unit]
    if units:
        yield f"units have no place: of {', '.join(map(repr, units[:5]))}" + (
            ", ..." if len(units) > 5 else ""
        )
    fine = [one.name for one in system.all_variables if _is_fine(one)]
    if fine:
        yield (
            "fuzzylite 6 treats values within 1e-6 as equal, and terms have corners "
            f"nearly as close: of {', '.join(map(repr, fine[:5]))}"
        )
    yield (
        "fuzzylite evaluates a row with a missing or infinite value by the rules that "
        "do not test it"
    )
    if any(rule.name for rule in system.rules):
        yield "names of rules have no place"


def _is_fine(variable: Variable | SystemOutput) -> bool:
    """Return whether 1e-6 is more than a thousandth of a distance between corners."""
    for label in variable.terms:
        match label.function:
            case Points(values=values):
                corners: Sequence[float] = values
            case Trapezoid(a=a, b=b, c=c, d=d):
                corners = [one for one in (a, b, c, d) if one is not None]
            case _:
                continue
        gaps = (high - low for low, high in itertools.pairwise(corners))
        if any(0.0 < gap < _FINEST for gap in gaps):
            return True
    return False


FORMAT = Format(
    name="fll",
    suffixes=(".fll",),
    carries=("rules", "system"),
    write=write,
    read=read_fll,
    cannot=(
        "a combination of columns; it becomes an input, to be given as its sum",
        "polynomial flanks and LR sets; they become points",
        "the hedges cubed, plus, minus and cube root",
        "curves that are sampled at the ends of a range too",
        "a NOT of several conditions, for other norms than minimum and maximum",
    ),
    dtype="float64",
)
