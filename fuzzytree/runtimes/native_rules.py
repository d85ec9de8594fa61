"""Firing all rules of a rule base on many rows, in numpy.

Rows come features first and go through in chunks. Each distinct edge and slope is
computed once (`degrees.py`), each distinct proposition once, and rules that begin with
the same propositions share the strength of what they have in common.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.model import Dtype, Outcome, Proposition, RuleBase, Run, Shape, shapes_of
from fuzzytree.runtimes.degrees import (
    NUMBERS,
    Atom,
    AtomBlock,
    NumberTypes,
    atoms_of,
    plan_blocks,
)
from fuzzytree.runtimes.rows import (
    Axes,
    axis_lines,
    checked,
    missing_rows,
    plan_axes,
    winners,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray, IntArray

    Reals = npt.NDArray[np.floating[Any]]

_SMALLEST_CHUNK, _LARGEST_CHUNK = 256, 1 << 14
_WORKING_SET = 1 << 19  # numbers: what a chunk's degrees and strengths may take
_WIDE = 8  # terms of a proposition from which each proposition is reduced by itself


@dataclass(frozen=True, slots=True)
class PrefixLevel:
    """Prefixes of one length: the shorter prefix and the last proposition of each."""

    parents: IntArray
    propositions: IntArray


@dataclass(frozen=True, slots=True)
class Prefixes:
    """The beginnings of all rules, each once, shorter ones first.

    Attributes:
        levels: The prefixes of one proposition, of two, ...; number 0 is the empty one.
        rules: The number of the prefix that is the whole of each rule.
    """

    levels: tuple[PrefixLevel, ...]
    rules: IntArray

    @property
    def count(self) -> int:
        """The number of prefixes, the empty one included."""
        return 1 + sum(len(level.parents) for level in self.levels)


@dataclass(frozen=True, slots=True)
class JoinedTerms:
    """Propositions of equally many terms: the line of each term, by position."""

    terms: IntArray
    first: int


@dataclass(frozen=True, slots=True)
class Degrees:
    """How to compute the degrees of all propositions, a line each.

    Lines 0 to `terms` are terms, two-sided ones first; then propositions that join
    several terms; then propositions that are negated.
    """

    blocks: tuple[AtomBlock, ...]
    atoms: int
    left: IntArray
    right: IntArray
    choices: tuple[JoinedTerms, ...]
    negated: IntArray
    line: dict[Proposition, int]
    count: int
    numbers: NumberTypes


@dataclass(frozen=True, slots=True)
class RulePlan:
    """A rule base, ready to be fired."""

    axes: Axes
    degrees: Degrees
    prefixes: Prefixes
    is_product: bool
    rows: int


def fire(rules: RuleBase, dtype: Dtype = "float64") -> Run:
    """Return a function that fires every rule on every row.

    Returns:
        A function from values of shape (inputs, rows) to an outcome with strengths.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(0))
        >>> fire(rules)(np.zeros((len(rules.inputs), 2))).strengths.shape
        (7, 2)
    """
    return fire_plan(plan_rules(rules, dtype), rules.inputs)


def fire_plan(
    plan: RulePlan, inputs: tuple[str, ...], *, with_strengths: bool = True
) -> Run:
    """Return a function that fires the rules of a plan, without strengths if need be.

    `inputs` are the names of the model's inputs.
    """
    rules = len(plan.prefixes.rules) if with_strengths else 0

    def run(values: FloatArray) -> Outcome:
        array = checked(values, inputs)
        count = array.shape[1]
        strengths = np.empty((rules, count), np.float64)
        result = np.empty((2, count), np.int64)
        with np.errstate(all="ignore"):
            for start in range(0, count, plan.rows):
                part = slice(start, start + plan.rows)
                lines = axis_lines(plan.axes, array[:, part])
                missing = missing_rows(lines)
                fired = strengths_of(plan, lines)
                if missing is None:
                    missing = np.zeros(fired.shape[1], np.bool_)
                else:
                    fired[:, missing] = 0
                result[:, part] = winners(fired, missing)
                strengths[:, part] = fired[:rules]
                strengths[:, part][:, missing] = np.nan
        return Outcome(result[0], result[1], strengths if with_strengths else None)

    return run


def firing_cost(plan: RulePlan) -> float:
    """Return about how many nanoseconds firing takes for each of many rows.

    The weights were fitted to trees and grids of 2 to 1,000 rules.
    """
    joined = sum(choice.terms.size for choice in plan.degrees.choices)
    lines = plan.degrees.count + joined + plan.prefixes.count
    return 7.0 * plan.degrees.atoms + 1.2 * lines + 5.0 * len(plan.prefixes.rules)


def plan_rules(rules: RuleBase, dtype: Dtype = "float64") -> RulePlan:
    """Return what firing a rule base needs, computed once."""
    numbers = NUMBERS[dtype]
    axes = plan_axes(rules.variables, numbers.axis)
    propositions = list(
        dict.fromkeys(proposition for rule in rules.rules for proposition in rule.when)
    )
    size = len(propositions) + len(rules.rules)
    rows = min(max(_WORKING_SET // size, _SMALLEST_CHUNK), _LARGEST_CHUNK)
    shapes = shapes_of(rules.variables)
    degrees = plan_degrees(shapes, propositions, axes.line, numbers, rows)
    return RulePlan(
        axes,
        degrees,
        _plan_prefixes(rules, degrees.line),
        rules.semantics.conjunction == "product",
        rows,
    )


def plan_degrees(
    shapes: Mapping[tuple[str, str], Shape],
    propositions: Sequence[Proposition],
    at_line: Mapping[str, int],
    numbers: NumberTypes,
    rows: int,
) -> Degrees:
    """Return how to compute the degrees of some propositions.

    Args:
        shapes: Of each term, by variable and name.
        propositions: What is computed, a line each.
        at_line: The line of each variable's values.
        numbers: In which types.
        rows: How many rows go through together.
    """
    keys = dict.fromkeys((c.variable, term) for c in propositions for term in c.terms)
    atoms = {key: atoms_of(at_line[key[0]], shapes[key]) for key in keys}
    wanted = dict.fromkeys(atom for key in keys for atom in atoms[key])
    ordered, blocks = plan_blocks(list(wanted), numbers, rows)
    place: dict[Atom, int] = {atom: i for i, atom in enumerate(ordered)}
    sides = {
        key: [place[atom] for atom in atoms[key]] or [len(ordered)] for key in keys
    }
    terms = sorted(keys, key=lambda key: -len(sides[key]))
    at = {key: line for line, key in enumerate(terms)}
    line, choices = _plan_choices(propositions, at)
    count = len(terms) + sum(len(choice.terms) for choice in choices)
    negated = [proposition for proposition in propositions if proposition.negated]
    below = [line[Proposition(c.variable, c.terms)] for c in negated]
    line |= {
        proposition: count + position for position, proposition in enumerate(negated)
    }
    return Degrees(
        blocks,
        len(ordered),
        np.array([sides[key][0] for key in terms], np.int64),
        np.array([sides[key][1] for key in terms if len(sides[key]) == 2], np.int64),
        choices,
        np.array(below, np.int64),
        line,
        count + len(negated),
        numbers,
    )


def _plan_choices(
    propositions: Sequence[Proposition], at: dict[tuple[str, str], int]
) -> tuple[dict[Proposition, int], tuple[JoinedTerms, ...]]:
    """Return the line of each proposition before negation, and how terms join."""
    plain = dict.fromkeys(Proposition(c.variable, c.terms) for c in propositions)
    line = {c: at[c.variable, c.terms[0]] for c in plain if len(c.terms) == 1}
    joined: dict[int, list[Proposition]] = {}
    for proposition in plain:
        if proposition not in line:
            joined.setdefault(len(proposition.terms), []).append(proposition)
    choices: list[JoinedTerms] = []
    first = len(at)
    for group in joined.values():
        lines = [[at[c.variable, term] for term in c.terms] for c in group]
        choices.append(JoinedTerms(np.array(lines, np.int64), first))
        line |= {
            proposition: first + position for position, proposition in enumerate(group)
        }
        first += len(group)
    return line, tuple(choices)


def _plan_prefixes(rules: RuleBase, line: dict[Proposition, int]) -> Prefixes:
    """Return the distinct beginnings of the rules, level by level."""
    current: list[tuple[Proposition, ...]] = [rule.when for rule in rules.rules]
    number = [0] * len(current)
    levels: list[PrefixLevel] = []
    used = 1
    for depth in range(max(map(len, current))):
        known: dict[tuple[int, int], int] = {}
        for rule, when in enumerate(current):
            if depth < len(when):
                key = (number[rule], line[when[depth]])
                number[rule] = known.setdefault(key, used + len(known))
        used += len(known)
        pairs = np.array(list(known), np.int64)
        levels.append(PrefixLevel(pairs[:, 0].copy(), pairs[:, 1].copy()))
    return Prefixes(tuple(levels), np.array(number, np.int64))


def strengths_of(plan: RulePlan, lines: Reals) -> Reals:
    """Return the strength of every rule, of shape (rules, rows)."""
    degrees = proposition_degrees(plan.degrees, lines)
    prefixes = plan.prefixes
    strengths = np.empty((prefixes.count, lines.shape[1]), degrees.dtype)
    strengths[0] = 1
    combine = np.multiply if plan.is_product else np.minimum
    start = 1
    for depth, level in enumerate(prefixes.levels):
        part = strengths[start : start + len(level.parents)]
        degrees.take(level.propositions, axis=0, out=part, mode="clip")
        if depth:
            before = strengths[:start].take(level.parents, axis=0)
            combine(before, part, out=part)
        start += len(part)
    return strengths.take(prefixes.rules, axis=0)


def proposition_degrees(degrees: Degrees, lines: Reals) -> Reals:
    """Return the degree of every proposition, a line each (see `Degrees`)."""
    rows = lines.shape[1]
    atoms = _atom_degrees(degrees, lines)
    result = np.empty((degrees.count, rows), degrees.numbers.degree)
    terms, both = len(degrees.left), len(degrees.right)
    atoms.take(degrees.left, axis=0, out=result[:terms], mode="clip")
    if both:
        np.minimum(result[:both], atoms.take(degrees.right, axis=0), out=result[:both])
    for choice in degrees.choices:
        out = result[choice.first : choice.first + len(choice.terms)]
        _join(result[:terms], choice.terms, out)
    if len(degrees.negated):
        start = degrees.count - len(degrees.negated)
        plain = result[:start].take(degrees.negated, axis=0)
        np.subtract(np.ones((), result.dtype), plain, out=result[start:])
    return result


def _atom_degrees(degrees: Degrees, lines: Reals) -> Reals:
    """Return the degree of every edge and slope, and a last line of ones."""
    rows = lines.shape[1]
    atoms = np.empty((degrees.atoms + 1, rows), degrees.numbers.degree)
    atoms[-1] = 1
    start = 0
    for block in degrees.blocks:
        out = atoms[start : start + len(block.lines)]
        block.run(lines.take(block.lines, axis=0), out, np.empty_like(out))
        start += len(out)
    return atoms


def _join(terms: Reals, lines: IntArray, out: Reals) -> None:
    """Put the largest degree of each proposition's terms into its line."""
    if lines.shape[1] >= _WIDE:
        for proposition, line in zip(lines, out, strict=True):
            np.maximum.reduce(terms.take(proposition, axis=0), axis=0, out=line)
        return
    terms.take(lines[:, 0], axis=0, out=out, mode="clip")
    for position in range(1, lines.shape[1]):
        np.maximum(out, terms.take(lines[:, position], axis=0), out=out)
