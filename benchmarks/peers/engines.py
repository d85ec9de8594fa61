"""Peers that fire rules: fuzzy engines of others, with our terms as points.

Both join points by lines, and neither computes combinations: those are computed before,
within the timed call. They give the strengths of rules; the strongest rule is taken by
us, the first of equally strong ones, because neither has a word for ties.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fuzzytree.benchmarking.candidates import found_of
from fuzzytree.benchmarking.records import CandidateOutput, LoadedCandidate
from fuzzytree.errors import LossError
from fuzzytree.model.contracts import Outcome
from fuzzytree.model.rulebase import Proposition, Rule, RuleBase, Shape
from fuzzytree.runtimes.rows import checked, plan_axes, winners
from peers.crisp import lines_of
from peers.sampling import line_error, proposition_shapes, samples, universe

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

    Fire = Callable[[dict[str, FloatArray]], FloatArray]

FINE = 128
COARSE = 16
"""How many lines stand for each curved piece of a shape."""

MOST_TERMS = 3000
"""What takes a second or two to become points; more of them take minutes to load."""

_LOOK_S = 1.2e-7  # what simpful takes to look at a point, on a processor of 2020 or so
_NAME_S = 1e-5  # and for a term beside
_LONGEST_ROW_S = 1.0
_MOST_NAMES = 100_000  # that pyfuzzylite reads in about ten seconds
_BLOCK_NUMBERS = 1 << 22  # strengths that are made at once


class Knots(NamedTuple):
    """A term as points joined by lines.

    Attributes:
        values: Increasing.
        degrees: As many.
        error: How far the lines can be from the term's degrees, certified.
    """

    values: FloatArray
    degrees: FloatArray
    error: float


def knots(shape: Shape, points: int) -> Knots:
    """Return a shape as points, few where it is level.

    Args:
        shape: Any shape.
        points: How many lines stand for a curved piece.
    """
    values = universe([shape], points)
    degrees = samples(shape, values)
    level = np.zeros(len(values), np.bool_)
    level[1:-1] = (degrees[:-2] == degrees[1:-1]) & (degrees[1:-1] == degrees[2:])
    return Knots(values[~level], degrees[~level], line_error(shape, values))


Terms = Mapping[tuple[str, str], Knots]
"""The points of the terms that propositions name, by variable and term."""


def names_of(rules: RuleBase) -> dict[tuple[str, str], tuple[str, str]]:
    """Return plain words for variables and terms of propositions: v1 and t1 ..."""
    variables = {v.name: f"v{n}" for n, v in enumerate(rules.variables, 1)}
    names = enumerate(proposition_shapes(rules), 1)
    return {key: (variables[key[0]], f"t{number}") for number, key in names}


def sampled_terms(rules: RuleBase, points: int) -> dict[tuple[str, str], Knots]:
    """Return the points of every term that a proposition names."""
    shapes = proposition_shapes(rules).items()
    return {key: knots(shape, points) for key, shape in shapes}


def is_steep(terms: Terms) -> bool:
    """Return whether a slope between two points overflows.

    Division by the distance of neighbouring subnormals does; simpful then answers NaN.
    """
    with np.errstate(over="ignore"):
        return any(
            not np.isfinite(np.diff(one.degrees) / np.diff(one.values)).all()
            for one in terms.values()
        )


def row_seconds(rules: RuleBase, terms: Terms) -> float:
    """Return roughly what simpful takes for a row.

    For every term that a proposition names, it computes all terms of the variable, and
    for each of them looks at one point after another.
    """
    sizes: dict[str, int] = {}
    for (variable, _), one in terms.items():
        sizes[variable] = sizes.get(variable, 0) + len(one.values)
    looks = [sizes[c.variable] for r in rules.rules for c in r.when for _ in c.terms]
    return sum(looks) * _LOOK_S + (1 + len(looks)) * _NAME_S


def load_fuzzylite(rules: RuleBase, threads: int) -> LoadedCandidate:
    """Prepare a pyfuzzylite engine; its antecedents take whole columns.

    Raises:
        LossError: If a rule has no proposition, or negates several terms under a
            product; or if it would take minutes to read the rules.
    """
    import fuzzylite as fl

    _refuse(rules, "pyfuzzylite")
    names = sum(
        len(proposition.terms) for rule in rules.rules for proposition in rule.when
    )
    if names > _MOST_NAMES:
        raise LossError(
            f"cannot run {rules.name} as pyfuzzylite: its rules name terms {names} "
            f"times, and reading more than {_MOST_NAMES} takes too long"
        )
    terms, words = sampled_terms(rules, FINE), names_of(rules)
    variables: dict[str, Any] = {}
    for (variable, term), (short, label) in words.items():
        if variable not in variables:
            variables[variable] = fl.InputVariable(short)
        one = terms[variable, term]
        table = np.stack([one.values, one.degrees], axis=1)
        variables[variable].terms.append(fl.Discrete(label, table))
    answers = [fl.Constant(f"c{n}", n) for n in range(len(rules.classes))]
    output = fl.OutputVariable("answer", terms=answers)
    engine = fl.Engine(
        input_variables=list(variables.values()), output_variables=[output]
    )
    is_product = rules.semantics.conjunction == "product"
    conjunction = fl.AlgebraicProduct() if is_product else fl.Minimum()
    disjunction = fl.Maximum()
    made: list[Any] = []
    for rule in rules.rules:
        number = rules.classes.index(rule.then)
        text = f"if {_fll(rule, words)} then answer is c{number}"
        made.append(fl.Rule.create(text, engine))

    def fire(lines: dict[str, FloatArray]) -> FloatArray:
        for name, variable in variables.items():
            variable.value = lines[name]
        found = [rule.activate_with(conjunction, disjunction) for rule in made]
        return np.array(found, np.float64)

    return _loaded(rules, list(variables), fire)


def _fll(rule: Rule, words: dict[tuple[str, str], tuple[str, str]]) -> str:
    def proposition_text(proposition: Proposition) -> str:
        pairs = [words[proposition.variable, term] for term in proposition.terms]
        verb = "is not" if proposition.negated else "is"
        parts = [f"{variable} {verb} {term}" for variable, term in pairs]
        if len(parts) == 1:
            return parts[0]
        return f"( {(' and ' if proposition.negated else ' or ').join(parts)} )"

    return " and ".join(map(proposition_text, rule.when))


def load_simpful(rules: RuleBase, threads: int) -> LoadedCandidate:
    """Prepare a simpful system; it answers one row after another.

    Raises:
        LossError: If a rule has no proposition, or one row would take more than a
            second.
    """
    _refuse(rules, "simpful")
    terms, words = sampled_terms(rules, COARSE), names_of(rules)
    seconds = row_seconds(rules, terms)
    if seconds > _LONGEST_ROW_S:
        raise LossError(
            f"cannot run {rules.name} as simpful: it would take about "
            f"{seconds:.0f} s for one row"
        )
    from simpful import FuzzySet, FuzzySystem, LinguisticVariable

    is_product = rules.semantics.conjunction == "product"
    operators = ["AND_PRODUCT"] if is_product else None
    system = FuzzySystem(operators=operators, show_banner=False, verbose=False)
    sets: dict[str, list[Any]] = {}
    short: dict[str, str] = {}
    for (variable, term), (word, label) in words.items():
        one = terms[variable, term]
        points = np.stack([one.values, one.degrees], axis=1).tolist()
        if len(points) == 1:
            points = [*points, [math.nextafter(points[0][0], math.inf), points[0][1]]]
        sets.setdefault(variable, []).append(FuzzySet(points=points, term=label))
        short[variable] = word
    for variable, found in sets.items():
        system.add_linguistic_variable(short[variable], LinguisticVariable(found))
    texts = [
        f"IF {_joined([_sentence(c, words) for c in rule.when], 'AND')} "
        f"THEN (answer IS c{rules.classes.index(rule.then)})"
        for rule in rules.rules
    ]
    system.add_rules(texts)

    def fire(lines: dict[str, FloatArray]) -> FloatArray:
        states = {short[name]: line.tolist() for name, line in lines.items()}
        return np.array(system.get_firing_strengths(states), np.float64).T

    return _loaded(rules, list(sets), fire)


def _sentence(
    proposition: Proposition, words: dict[tuple[str, str], tuple[str, str]]
) -> str:
    """Return a proposition as simpful reads it, in one pair of parentheses or more."""
    pairs = [words[proposition.variable, term] for term in proposition.terms]
    either = _joined([f"({variable} IS {term})" for variable, term in pairs], "OR")
    # Its parser strips an outer pair from whatever begins with "(NOT": one pair more.
    return f"((NOT {either}))" if proposition.negated else either


def _joined(parts: Sequence[str], word: str) -> str:
    """Join propositions as a balanced tree: simpful walks it by recursion."""
    if len(parts) == 1:
        return parts[0]
    middle = len(parts) // 2
    left, right = _joined(parts[:middle], word), _joined(parts[middle:], word)
    return f"({left} {word} {right})"


def _refuse(rules: RuleBase, peer: str) -> None:
    """Raise LossError for what an engine cannot say."""
    is_product = rules.semantics.conjunction == "product"
    for number, rule in enumerate(rules.rules, 1):
        if not rule.when:
            raise LossError(
                f"cannot run {rules.name} as {peer}: rule {number} has no proposition"
            )
        several = [c for c in rule.when if c.negated and len(c.terms) > 1]
        if peer == "pyfuzzylite" and is_product and several:
            raise LossError(
                f"cannot run {rules.name} as {peer}: rule {number} negates several "
                "terms at once"
            )


def _loaded(rules: RuleBase, names: Sequence[str], fire: Fire) -> LoadedCandidate:
    """Return an engine that answers blocks of rows, so that strengths stay few."""
    axes = plan_axes(rules.variables)
    block = max(1, _BLOCK_NUMBERS // len(rules.rules))

    def strengths_of(values: FloatArray) -> FloatArray:
        lines = lines_of(axes, values)
        return fire({name: lines[axes.line[name]] for name in names})

    def answer(values: FloatArray) -> CandidateOutput:
        array = checked(values, rules.inputs)
        is_known = np.isfinite(lines_of(axes, array))
        missing = ~np.logical_and.reduce(is_known, axis=0)
        strengths = np.zeros((len(rules.rules), array.shape[1]))
        if not missing.all():
            known = np.ascontiguousarray(array[:, ~missing])
            strengths[:, ~missing] = strengths_of(known)
        rule, status = winners(strengths, missing)
        strengths[:, missing] = np.nan
        return found_of(Outcome(rule, status, strengths), rules)

    def call(values: FloatArray) -> Callable[[], object]:
        count = values.shape[1]
        parts = [values[:, i : i + block] for i in range(0, count, block)]
        nothing = [np.zeros(part.shape[1], np.bool_) for part in parts]

        def each() -> None:
            for part, none in zip(parts, nothing, strict=True):
                winners(strengths_of(part), none)

        return each

    return LoadedCandidate(answer, call)
