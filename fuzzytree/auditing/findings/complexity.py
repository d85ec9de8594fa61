"""How large a rule base is: counts, and the index of Nauck with an exact integral."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.lines import combined, constant
from fuzzytree.auditing.decide.measures import Bounds, integral
from fuzzytree.auditing.decide.states import Computed
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.terms import VariableRange, measure, ranges, used_terms
from fuzzytree.model import depth


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Count rules, propositions and terms, and compute the index of Nauck."""
    lengths = [len(rule.when) for rule in subject.rules.rules]
    used = set(used_terms(subject.rules))
    measures = [
        Measure("rules", len(lengths)),
        Measure("propositions", sum(lengths)),
        Measure("most propositions of a rule", max(lengths)),
        Measure("propositions per rule", sum(lengths) / len(lengths)),
        Measure("distinct terms in use", len(used)),
        Measure("variables in use", len({variable for variable, _ in used})),
    ]
    if subject.tree is not None:
        measures.append(Measure("depth of the tree", depth(subject.tree)))
    measures += [measure(f"{name} of Nauck", value) for name, value in nauck(subject)]
    # Of a view ways count, and rules left out do not.
    is_view = subject.system is not None and subject.policy.decision == "all"
    message = "FT501.size-of-view" if is_view else "FT501.size"
    how = Computed("counted, and integrated in fractions")
    yield audit_answer(message, "the rule base", how, measures=tuple(measures))


def nauck(subject: Subject) -> list[tuple[str, Bounds]]:
    """Return the three factors of the index of Nauck on the domain, and their product.

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
        None of them if no rule uses a variable, a range is a point, or a term has no
        exact shape.
    """
    terms = set(used_terms(subject.rules))
    names = {variable for variable, _ in terms}
    used = [of for of in ranges(subject) if of.variable.name in names]
    is_known = terms.isdisjoint(subject.inexact)
    if not used or not is_known or any(of.low == of.high for of in used):
        return []
    lengths = [len({c.variable for c in rule.when}) for rule in subject.rules.rules]
    size = Fraction(len(subject.rules.classes), sum(lengths))
    each = [coverage(of) for of in used]
    low, high = (sum(ends, ZERO) / len(used) for ends in zip(*each, strict=True))
    shares = (Fraction(1, max(len(of.terms) - 1, 1)) for of in used)
    partition = sum(shares, ZERO) / len(used)
    return [
        ("complexity", Bounds(size, size)),
        ("coverage", Bounds(low, high)),
        ("partition", Bounds(partition, partition)),
        ("index", Bounds(size * low * partition, size * high * partition)),
    ]


def coverage(of: VariableRange) -> Bounds:
    """Return the mean of h(x) over a range, as `nauck` defines it.

    Example:
        >>> from fuzzytree.model.rulebase import Points, Term, Variable
        >>> down, up = (Points((0.0, 1.0), ends) for ends in ((1.0, 0.0), (0.0, 1.0)))
        >>> both = Variable("x", (Term("low", down), Term("high", up)))
        >>> coverage(VariableRange(both, ZERO, ONE)).low
        Fraction(1, 1)
    """
    curves = [of.lines(term.shape) for term in of.terms]
    low, high = curves[0].lower.x[0], curves[0].lower.x[-1]
    level, totals = constant(ONE, low, high), list[Fraction]()
    for side in (0, 1):
        lines = combined([one[side] for one in curves], lambda both: both[0] + both[1])
        below = integral(combined([lines, level], min))
        above = integral(lines) - below  # of two terms or more
        totals.append(below - above / max(len(curves) - 1, 1))
    # Where degrees are enclosed, h differs by no more than their sum does.
    slack = sum((integral(c.upper) - integral(c.lower) for c in curves), ZERO) / 2
    total, width = sum(totals, ZERO) / 2, high - low
    return Bounds(max(total - slack, ZERO) / width, min((total + slack) / width, ONE))
