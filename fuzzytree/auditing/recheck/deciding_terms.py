"""Terms, and what rules ask of them: FT401, FT403, FT404, FT501."""

from __future__ import annotations

from fractions import Fraction

from fuzzytree.auditing.recheck.audit_records import Answer, Declined, Label
from fuzzytree.auditing.recheck.cases import Case, counted
from fuzzytree.auditing.recheck.cells import FINE
from fuzzytree.auditing.recheck.model_records import Rules, Tree
from fuzzytree.auditing.recheck.outcomes import UndecidedError, require


def heights(case: Case, answer: Answer) -> None:
    """Compare the terms that do not reach the level with what is told."""
    level = case.audit.settings.level
    low = {label: height for label, height in case.heights.items() if height < level}
    told = [one.terms[0] for one in case.coded("FT401") if one.terms]
    told = [label for label in told if label in case.heights]
    require(told == list(low), "other terms are too low")
    if any(label not in case.heights for label in answer.terms):
        raise UndecidedError("the height of a curve that is no polynomial")
    for label in answer.terms:
        is_empty = answer.severity == "error"
        require(is_empty == (not low[label]), f"{label.term!r} is empty, or is not")
        value = next((m.value for m in answer.measures if m.name == "height"), -1.0)
        require(abs(value - low[label]) <= 2.0**-30, f"the height of {label.term!r}")


def overlaps(case: Case, answer: Answer) -> None:
    """Compare the shared areas of pairs of terms with what is told of them."""
    limit = Fraction(case.audit.settings.overlap)
    known = {labels: share for labels, share in case.shares.items() if share}
    near = {labels: share for labels, share in known.items() if share[1] >= limit}
    if any(low < limit for low, _ in near.values()):
        raise UndecidedError("a shared area is too near to the limit to tell")
    told = [one for one in case.coded("FT403") if one.terms]
    told = [one for one in told if not isinstance(one.state, Declined)]
    require({a.terms for a in told} <= near.keys(), "two terms are easy to tell apart")
    if not answer.terms:
        require(answer.is_finding == (len(near) > len(told)), "a finding that is none")
        counts = {
            "pairs not told one by one": len(near) - len(told),
            "pairs apart": len(known) - len(near),
            "pairs without area": len(case.shares) - len(known),
        }
        counted(answer, counts, len(counts))
        return
    low, high = near[answer.terms]
    value = Fraction(next(m.value for m in answer.measures if "shared" in m.name))
    require(low - FINE <= value <= high + FINE, "the share is another one")


def unused(case: Case, answer: Answer) -> None:
    """Compare the terms and variables that no rule asks with what is told."""
    every, asked = case.terms, _asked(case.rules)
    if case.view is not None:  # the system itself is read, rules left out or not
        every = [
            Label(v.name, label.name)
            for v in case.view.system.inputs
            for label in v.labels
        ]
        asked = case.view.questions()
    needed = {variable for variable, _ in asked}
    names = [v.name for v in case.rules.variables]
    for variable in case.rules.variables:
        if variable.name in needed:
            needed |= {part.input for part in variable.parts}
    idle = [f"variable {name!r}" for name in names if name not in needed]
    idle += [
        f"term {term!r} of {name!r}"
        for name, term in every
        if name in needed and (name, term) not in asked
    ]
    needed, asked = needed.intersection(names), asked.intersection(every)
    told = [one.subject for one in case.coded("FT404") if one.is_finding]
    require(told == idle, "other terms or variables are unused")
    counts = {"variables in use": len(needed), "terms in use": len(asked)}
    counted(answer, counts, 0 if answer.is_finding else 2)


def complexity(case: Case, answer: Answer) -> None:
    """Count rules, clauses, terms and variables."""
    lengths, asked = [len(r.when) for r in case.rules.rules], _asked(case.rules)
    counts: dict[str, float] = {
        "rules": len(lengths),
        "clauses": sum(lengths),
        "most clauses of a rule": max(lengths),
        "clauses per rule": sum(lengths) / len(lengths),
        "distinct terms in use": len(asked),
        "variables in use": len({variable for variable, _ in asked}),
    }
    if isinstance(case.model, Tree):
        counts["depth of the tree"] = max(map(len, case.paths.values()))
    counted(answer, counts, len(counts))
    text = "its counts are right; the index of Nauck is not worked out here"
    raise UndecidedError(text)


def _asked(rules: Rules) -> set[tuple[str, str]]:
    """Return the variable and term of everything that a rule asks."""
    clauses = [clause for rule in rules.rules for clause in rule.when]
    return {(clause.variable, term) for clause in clauses for term in clause.terms}
