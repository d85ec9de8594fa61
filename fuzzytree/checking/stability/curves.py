"""N7: can the fitted curves be evaluated well, and are they membership functions?"""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.checking.stability.results import Criterion, CurveFault, judged
from fuzzytree.model.contracts import Model
from fuzzytree.model.rulebase import RuleBase, Shape, Term
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.numerics.conditioning import Conduct, conduct

LARGEST_SIZE = 64.0
"""Roundings of 1 that an evaluation may cost for each of its steps: six bits."""

LARGEST_OVERSHOOT = 0.05
"""By how much a polynomial may leave [0, 1] before it is clipped."""

LARGEST_RISE = 0.05
"""By how much a clipped degree may rise on its way out."""

_TOLD = 1e-9  # overshoot and rises below are nobody's concern


def curves(model: Model) -> tuple[Criterion, tuple[CurveFault, ...]]:
    """Judge the curve of every term of a model, by proof and not by samples (N7).

    A curve fails beyond `LARGEST_SIZE`, `LARGEST_OVERSHOOT` or `LARGEST_RISE`; below
    them, what it does is told.

    Returns:
        The criterion, and what is to be known about curves, worst first.
    """
    cases = 0
    found: list[CurveFault] = []
    for form, variable, term in _terms(model):
        for side in conduct(term.shape):
            cases += 1
            fault = _fault(form, variable, term, side)
            if fault is not None:
                found.append(fault)
    found.sort(key=lambda f: (not f.fails, -max(f.overshoot, f.rise), -f.condition))
    faults = [_sentence(one) for one in found if one.fails]
    told = len(found) - len(faults)
    facts = [f"{told} of {cases} sides bulge or rise within the limits"] if told else []
    criterion = judged(
        "N7",
        cases,
        faults,
        worst=max((max(one.overshoot, one.rise) for one in found), default=0.0),
        facts=facts,
        advice=(
            "learn with fewer points on a set (points=2), which gives curves of a "
            "lower degree, or rewrite the named curves"
        ),
        skipped=() if cases else ("no term of the model has a fitted curve",),
    )
    return criterion, tuple(found)


def _terms(model: Model) -> Iterator[tuple[str, str, Term]]:
    """Yield each term of a model once, with its form and its variable."""
    is_raw = isinstance(model, RuleBase) and model.kind == "raw"
    form = "raw" if is_raw else "rules" if isinstance(model, RuleBase) else "relative"
    seen: set[tuple[str, Shape]] = set()
    groups = [(form, v.name, v.terms) for v in model.variables]
    if isinstance(model, FuzzyTree):
        groups += [("raw", group.variable, group.terms) for group in model.sets]
    for kind, variable, terms in groups:
        for term in terms:
            if (variable, term.shape) not in seen:
                seen.add((variable, term.shape))
                yield kind, variable, term


def _fault(form: str, variable: str, term: Term, side: Conduct) -> CurveFault | None:
    overshoot = max(side.above.high, side.below.high)
    rise = side.rises[0].height if side.rises else 0.0
    size = side.size.high
    if size <= LARGEST_SIZE and max(overshoot, rise) <= _TOLD:
        return None
    limits = (
        # A rise of the lower end of a bracket above the limit is a proof.
        (side.size.low > LARGEST_SIZE, "lower its degree, or use double"),
        (
            max(side.above.low, side.below.low) > LARGEST_OVERSHOOT,
            "fit it with fewer points",
        ),
        (rise > LARGEST_RISE, "fit it with fewer points, or make it monotone"),
    )
    wrong = [advice for is_beyond, advice in limits if is_beyond]
    return CurveFault(
        variable,
        f"{term.name} ({side.side})",
        form,
        size,
        overshoot,
        rise,
        (side.rises[0].start, side.rises[0].end) if side.rises else None,
        bool(wrong),
        wrong[0] if wrong else "within the limits",
    )


def _sentence(fault: CurveFault) -> str:
    parts: list[str] = []
    if fault.condition > LARGEST_SIZE:
        parts.append(
            f"a step of evaluating costs up to {fault.condition:.3g} roundings"
        )
    if fault.overshoot > LARGEST_OVERSHOOT:
        parts.append(f"the polynomial leaves [0, 1] by {fault.overshoot:.3g}")
    if fault.rise > LARGEST_RISE and fault.where is not None:
        start, end = fault.where
        parts.append(f"the degree rises by {fault.rise:.3g} from {start:g} to {end:g}")
    return f"{fault.form}: {fault.variable} {fault.term}: {'; '.join(parts)}"
