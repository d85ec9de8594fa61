"""How large a rule base is: counts, and the index of Nauck with an exact integral."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.lines import combined, constant
from fuzzytree.auditing.decide.measures import Bounds, integral
from fuzzytree.auditing.engine.states import Computed
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.terms import VariableRange, measure, ranges, used_terms
from fuzzytree.model import depth


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
        >>> coverage(VariableRange(both, Fraction(0), Fraction(1), False)).low
        Fraction(1, 1)
    """
    curves = [of.lines(term.shape) for term in of.variable.terms]
    low, high = curves[0].lower.x[0], curves[0].lower.x[-1]
    count = len(curves)
    level = constant(ONE, low, high)
    totals: list[Fraction] = []
    for side in (0, 1):
        summed = combined([one[side] for one in curves], lambda both: both[0] + both[1])
        total = integral(combined([summed, level], min))
        if count > 1:  # what is above 1 is taken off; two terms or more are needed
            over = integral(combined([summed, level], max)) - (high - low)
            total -= over / (count - 1)
        totals.append(total)
    # Where degrees are enclosed, h differs by no more than their sum does.
    slack = sum((integral(c.upper) - integral(c.lower) for c in curves), ZERO) / 2
    total = sum(totals, ZERO) / 2
    width = high - low
    return Bounds(max(total - slack, ZERO) / width, min((total + slack) / width, ONE))
