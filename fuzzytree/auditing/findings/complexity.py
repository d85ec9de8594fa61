"""How large a rule base is: counts, and the index of Nauck with an exact integral."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from fuzzytree.auditing.engine.measures import (
    Bounds,
    CurveAxis,
    local_polynomial,
    separate_axis,
)
from fuzzytree.auditing.engine.pieces import ONE, ZERO
from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    difference,
    integral,
    roots,
    value_at,
)
from fuzzytree.auditing.engine.states import Computed
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.terms import VariableRange, measure, ranges, used_terms
from fuzzytree.model import FuzzyTree


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Count rules, propositions and terms, and compute the index of Nauck."""
    rules = subject.rules
    propositions, used = (
        [len(rule.when) for rule in rules.rules],
        set(used_terms(rules)),
    )
    measures = [
        Measure("rules", len(propositions)),
        Measure("propositions", sum(propositions)),
        Measure("most propositions of a rule", max(propositions)),
        Measure("propositions per rule", sum(propositions) / len(propositions)),
        Measure("distinct terms in use", len(used)),
        Measure("variables in use", len({variable for variable, _ in used})),
    ]
    if subject.tree is not None:
        measures.append(Measure("depth of the tree", depth(subject.tree)))
    index = nauck(subject)
    if index is not None:
        names = ("complexity", "coverage", "partition")
        measures += [
            measure(f"{name} of Nauck", value)
            for name, value in zip(names, index, strict=True)
        ]
        size, covered, partition = index
        product = Bounds(
            size.low * covered.low * partition.low,
            size.high * covered.high * partition.high,
        )
        measures.append(measure("index of Nauck", product))
    # Of a view ways count, and rules left out do not.
    is_view = subject.system is not None and subject.policy.decision == "all"
    message = "FT501.size-of-view" if is_view else "FT501.size"
    how = Computed("counted, and integrated in fractions")
    yield audit_answer(message, "the rule base", how, measures=tuple(measures))


def depth(tree: FuzzyTree) -> int:
    """Return how many nodes the longest path of a tree has."""
    # Nodes stand before those below them.
    depths = [1] * len(tree.nodes)
    for number, node in enumerate(tree.nodes):
        for branch in node.branches:
            if branch.node is not None:
                depths[branch.node - 1] = depths[number] + 1
    return max(depths, default=0)


def nauck(subject: Subject) -> tuple[Bounds, Bounds, Bounds] | None:
    """Return the three factors of the index of Nauck on the domain.

    D. D. Nauck, "Measuring interpretability in rule-based classification systems",
    FUZZ-IEEE 2003, pages 196 to 201. With m classes, n_k variables in rule k, and p_i
    terms of variable i, of those that rules use:

    - complexity: m / (n_1 + n_2 + ...);
    - coverage: the mean over the variables of the mean over the range of h_i(x), where
      h is the sum s of the degrees of all p_i terms if s <= 1, and otherwise
      (p_i - s) / (p_i - 1);
    - partition: the mean over the variables of 1 / (p_i - 1), and 1 for one term.

    Integrals are taken exactly, not on a grid.

    Returns:
        None if no rule uses a variable, a range is a point, or a term has no exact
        shape.
    """
    terms = set(used_terms(subject.rules))
    if subject.bounds and not terms.isdisjoint(subject.bounds.terms):
        return None
    names = {variable for variable, _ in terms}
    used = [of for of in ranges(subject) if of.variable.name in names]
    lengths = [len({c.variable for c in rule.when}) for rule in subject.rules.rules]
    if not used or any(of.low == of.high for of in used):
        return None
    size = Fraction(len(subject.rules.classes), sum(lengths))
    coverages: list[Bounds] = []
    for of in used:
        subject.clock.check()
        coverages.append(coverage(of))
    counts = [len(of.variable.terms) for of in used]
    shares = [Fraction(1, max(count - 1, 1)) for count in counts]
    partition = sum(shares, ZERO) / len(shares)
    return (
        Bounds(size, size),
        Bounds(
            sum((one.low for one in coverages), ZERO) / len(coverages),
            sum((one.high for one in coverages), ZERO) / len(coverages),
        ),
        Bounds(partition, partition),
    )


def coverage(of: VariableRange) -> Bounds:
    """Return the mean of h(x) over a range, as `nauck` defines it.

    Example:
        >>> from fuzzytree.model.rulebase import Points, Term, Variable
        >>> down, up = (Points((0.0, 1.0), ends) for ends in ((1.0, 0.0), (0.0, 1.0)))
        >>> both = Variable("x", (Term("low", down), Term("high", up)))
        >>> coverage(VariableRange(both, Fraction(0), Fraction(1), False)).exact
        '1'
    """
    terms = of.variable.terms
    axis = separate_axis([term.shape for term in terms], of.low, of.high)
    total, slack = ZERO, sum((b - a for a, b in axis.cells.zones), ZERO)
    for low, high in axis.cells.between:
        summed = _sum(axis, (low + high) / 2)
        over = difference(summed, (ONE,))
        places = [*roots(over, low, high)]
        slack += sum((root.high - root.low for root in places), ZERO)
        starts = [low, *(root.high for root in places)]
        ends = [*(root.low for root in places), high]
        for a, b in zip(starts, ends, strict=True):
            part = summed
            if value_at(over, (a + b) / 2) > 0:
                # More than 1 is summed up only by two terms or more.
                count = len(terms)
                part = tuple(
                    c / (1 - count) for c in difference(summed, (Fraction(count),))
                )
            total += integral(part, a, b)
    width = of.high - of.low
    return Bounds(total / width, min((total + slack) / width, ONE))


def _sum(axis: CurveAxis, at: Fraction) -> Polynomial:
    total: Polynomial = (ZERO,)
    for element in axis.elements:
        negative = tuple(-c for c in local_polynomial(element, at))
        total = difference(total, negative)
    return total
