"""Conditions in FIS: a number for each input, all joined by and or by or.

Several propositions on one input become one term of that input
(`fuzzytree.semantics.conversion.joint_terms`).
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from fuzzytree.errors import LossError
from fuzzytree.formats import CONCLUDING_HEDGES, FIS_HEDGES, Dialect
from fuzzytree.model import (
    Condition,
    FuzzySystem,
    Hedge,
    Loss,
    Not,
    Or,
    Proposition,
    RuleBlock,
    SystemOutput,
    SystemRule,
)
from fuzzytree.semantics import EVERYWHERE, JointTerms, operands, split


class FisRule(msgspec.Struct, frozen=True):
    """A rule: the codes of its inputs and outputs by name, and how it is joined."""

    codes: Mapping[str, str]
    concluded: Mapping[str, str]
    weight: float
    is_or: bool = False


class FisTerms(JointTerms):
    """The terms of all inputs; terms that a rule needs are added."""

    def __init__(self, system: FuzzySystem, dialect: Dialect, tolerance: float) -> None:
        super().__init__(system, tolerance)
        self.dialect: Dialect = dialect

    def place(self, variable: str, label: str) -> int:
        """Return the number of a term, from 1."""
        names = [one.name for one in self.labels[variable]]
        return names.index(label) + 1

    def everywhere(self) -> dict[str, str]:
        """Return a condition that is always true."""
        if not self.labels:
            raise LossError(
                "it has no condition, and there is no input that it could test"
            )
        first = next(iter(self.labels))
        if self.dialect == "fuzzylite":
            return {first: "0.99"}
        return {first: str(self.place(first, self.add(first, "always", EVERYWHERE)))}

    def code(self, proposition: Proposition) -> str | None:
        """Return the number of a proposition with its hedges; None if it has none."""
        hedges = _merged(proposition.hedges)
        is_negated = hedges[:1] == ("not",)
        hundredths = _hundredths(FIS_HEDGES[self.dialect], hedges[is_negated:])
        if hundredths is None:
            return None
        # Fuzzylite loads no rule with `any` before a term.
        has_label = proposition.term is not None and hedges[-1:] != ("any",)
        place = (
            self.place(proposition.variable, proposition.term or "") if has_label else 0
        )
        return _code(place, hundredths, is_negated=is_negated)


def lines_of(
    rule: SystemRule, block: RuleBlock, terms: FisTerms, number: int
) -> list[FisRule]:
    """Return a rule as lines.

    More than one where it concludes an output twice, or mixes and and or.

    Raises:
        LossError: If it has no place in FIS.
    """
    try:
        return _lines(rule, terms)
    except LossError:
        is_joined = terms.dialect == "octave" or not any(
            one.defuzzifier.is_weighted for one in terms.system.outputs
        )
        rules = split(rule, block, terms.system) if is_joined else ()
        if len(rules) < 2:
            raise
    lines = [line for one in rules for line in _lines(one, terms)]
    what = f"it is {len(rules)} rules, joined by maximum: that is equivalent"
    terms.losses.append(Loss(f"rule {number}", what, 0.0))
    return lines


def _lines(rule: SystemRule, terms: FisTerms) -> list[FisRule]:
    is_or = isinstance(rule.when, Or)
    codes = _codes(rule.when, terms)
    result: list[dict[str, str]] = []
    for name, code in _conclusions(rule, terms):
        if not result or name in result[-1]:
            result.append({})
        result[-1][name] = code
    return [FisRule(codes, concluded, rule.weight, is_or) for concluded in result]


def _codes(condition: Condition | None, terms: FisTerms) -> dict[str, str]:
    if condition is None:
        return {} if terms.dialect == "matlab" else terms.everywhere()
    is_or = isinstance(condition, Or)
    parts = [_simple(one) for one in operands(condition, terms.system.blocks[0])]
    if terms.dialect != "fuzzylite":
        plain = [
            p
            for p in parts
            if not (isinstance(p, Proposition) and p.hedges == ("any",))
        ]
        if not plain or (is_or and len(plain) < len(parts)):
            return _codes(None, terms)
        parts = plain
    codes: dict[str, str] = {}
    for name, proposition in terms.by_input(parts, is_or=is_or).items():
        code = terms.code(proposition)
        if code is None:
            hedges = " ".join(proposition.hedges)
            raise LossError(f"{terms.dialect} has no way to say {hedges!r}")
        codes[name] = code
    return {name: code for name, code in codes.items() if code != "0"}


def _simple(condition: Condition) -> Condition:
    match condition:
        case Not(part=Proposition(hedges=hedges) as part):
            return msgspec.structs.replace(part, hedges=("not", *hedges))
        case _:
            return condition


def _conclusions(rule: SystemRule, terms: FisTerms) -> list[tuple[str, str]]:
    """Return the outputs that a rule concludes, and their codes."""
    outputs: Mapping[str, SystemOutput] = {
        one.name: one for one in terms.system.outputs
    }
    table = FIS_HEDGES[terms.dialect]
    if terms.dialect == "octave":
        table = CONCLUDING_HEDGES
    so_far: tuple[Hedge, ...] = ()
    result: list[tuple[str, str]] = []
    for one in rule.then:
        output = outputs[one.output]
        place = [label.name for label in output.terms].index(one.term) + 1
        # Hedges act on the conclusions behind them too; in Octave on each alone.
        so_far = (*one.hedges, *so_far)
        is_shared = terms.dialect == "fuzzylite"
        hedges = _merged(one.hedges if is_shared else so_far)
        is_negated = hedges[:1] == ("not",)
        hundredths = _hundredths(table, hedges[is_negated:])
        is_plain = not is_negated and not hedges
        if hundredths is None or not (
            is_plain or is_shared or output.defuzzifier.is_weighted
        ):
            text = " ".join(hedges)
            raise LossError(f"{terms.dialect} cannot conclude {text!r} {one.term!r}")
        result.append((one.output, _code(place, hundredths, is_negated=is_negated)))
    return result


def _code(place: int, hundredths: int, *, is_negated: bool) -> str:
    sign = "-" if is_negated else ""
    return f"{sign}{place}.{hundredths:02d}" if hundredths else f"{sign}{place}"


def _merged(hedges: tuple[Hedge, ...]) -> tuple[Hedge, ...]:
    """Return hedges with `very very` as one, and nothing before the last `any`."""
    if "any" in hedges:
        rest = hedges[: hedges.index("any")]
        return (*_merged(rest), "any")
    return ("very very",) if hedges == ("very", "very") else hedges


def _hundredths(
    table: Mapping[int, tuple[Hedge, ...]], hedges: tuple[Hedge, ...]
) -> int | None:
    known = {hedge: code for code, hedge in reversed([*table.items()])}
    return known.get(hedges)
