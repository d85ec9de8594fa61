"""Questions about terms: whether they are reached, used and distinguished; how many."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType
from typing import Final, NamedTuple

from msgspec.structs import replace

from fuzzytree.auditing.decide import measures
from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.axes import function_lines
from fuzzytree.auditing.decide.domain import span
from fuzzytree.auditing.decide.lines import Between, Lines, combine, constant, lines_of
from fuzzytree.auditing.decide.measures import Bounds
from fuzzytree.auditing.decide.states import (
    Bracket,
    Computed,
    Declined,
    Proved,
    Span,
    State,
    counted,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure, TermName
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model import (
    LR,
    MembershipFunction,
    Points,
    RuleBase,
    Shape,
    Term,
    Variable,
    depth,
    questions,
)
from fuzzytree.numerics import exact_degree, outwards
from fuzzytree.rechecking import side_values

_NEAR: Final = Fraction(1, 10**9)  # bounds of a height that are shown as one number
_INEXACT: Final = "curves are known between functions of lines"
_MOST_BITS: Final = 4_000  # of a fraction that is written out beside its double


class VariableRange(NamedTuple):
    """A variable with its terms and its values on the domain.

    `curves` are the functions of terms without an exact shape; `values` those of rows,
    one by one, and empty of numbers. Where it `is_open` the least value is left out.
    """

    variable: Variable
    low: Fraction
    high: Fraction
    curves: Mapping[str, MembershipFunction] = MappingProxyType({})
    is_open: bool = False
    values: Sequence[Fraction] = ()

    @property
    def terms(self) -> list[Term]:
        """The terms with an exact shape."""
        return [term for term in self.variable.terms if term.name not in self.curves]

    def lines(self, shape: Shape) -> Between:
        """Return a curve as lines; of single values each is level for a length of 1.

        Where the least value is left out the limit stands for it.
        """
        if self.values:
            degrees = tuple(exact_degree(shape, x) for x in self.values)
            x = tuple(map(Fraction, range(len(degrees) + 1)))
            lines = Lines(x, (*degrees, degrees[-1]), degrees, degrees)
            return Between(lines, lines)
        both = lines_of(shape, self.low, self.high)
        if not self.is_open:
            return both
        lower, upper = (of._replace(at=of.after[:1] + of.at[1:]) for of in both)
        return Between(lower, lower if both.is_exact else upper)


def ranges(subject: Subject) -> tuple[VariableRange, ...]:
    """Return the range of each variable that has terms; none if the domain is empty.

    Terms without an exact shape, of a system, come with their function.
    """
    result: list[VariableRange] = []
    for variable in subject.rules.variables:
        name, side = variable.name, subject.domain.side(variable.name)
        low, high = span(variable, subject.domain)
        if low > high:
            return ()
        curves = {label: f for (of, label), f in subject.curves.items() if of == name}
        inexact = {label for of, label in subject.inexact if of == name} - {*curves}
        terms = [term for term in variable.terms if term.name not in inexact]
        if terms:
            variable = replace(variable, terms=tuple(terms))
            is_open = side is not None and side.is_open and low == side.low < high
            row = variable, low, high, curves, is_open, side_values(side)
            result.append(VariableRange(*row))
    return tuple(result)


def measure(name: str, value: Bounds) -> Measure:
    """Return a number between bounds as a measure: their middle."""
    is_short = value.low.denominator.bit_length() <= _MOST_BITS
    exact = str(value.low) if value.low == value.high and is_short else None
    return Measure(name, float((value.low + value.high) / 2), exact)


# --- FT401: is the term reached?


def height_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether terms are reached."""
    level = Fraction(subject.settings.level)
    clean, lowest = 0, ONE
    for of in ranges(subject):
        for term in of.variable.terms:
            subject.budget.check()
            curve = of.curves.get(term.name)
            lines = of.lines(term.shape)
            if curve is not None:
                lines = function_lines(curve, of.low, of.high)
            (low, high), at = measures.height(lines)
            if low >= level:
                clean, lowest = clean + 1, min(lowest, low)
            elif high and (curve is not None or high >= level or high - low > _NEAR):
                message = "FT401.low-curve" if high < level else "FT401.open"
                what = f"the largest degree of {_title(of, [term])}"
                ends = outwards(low)[0], outwards(high)[1]
                least = Measure("height at least", ends[0])
                most = Measure("height at most", ends[1])
                state: State = Bracket(what, *ends, _INEXACT)
                yield _about(message, of, [term], state, least, most)
            else:
                message = "FT401.low" if high else "FT401.empty"
                state = Proved("its degree was evaluated wherever it may be largest")
                place = {"at": float(of.values[int(at)] if of.values else at)}
                height = measure("height", Bounds(low, high))
                yield _about(message, of, [term], state, height, facts=place)
    if clean:
        proof = Proved(f"the height of {clean} terms was found")
        least = measure("lowest height", Bounds(lowest, lowest))
        facts = {"count": clean, "level": float(level)}
        yield audit_answer("FT401.reached", "terms", proof, least, facts=facts)


def _title(of: VariableRange, terms: Sequence[Term]) -> str:
    """Return how sentences name a term, or two."""
    noun = "terms" if len(terms) > 1 else "term"
    names = " and ".join(repr(term.name) for term in terms)
    return f"{noun} {names} of {of.variable.name!r}"


def _about(
    message: str,
    of: VariableRange,
    terms: Sequence[Term],
    state: State,
    *numbers: Measure,
    facts: Mapping[str, str | float] = MappingProxyType({}),
    ends: tuple[Fraction, Fraction] | None = None,
) -> AuditAnswer:
    """Return an answer about terms on their range, or from one end to another."""
    name = of.variable.name
    low, high = map(float, ends or (of.low, of.high))
    return audit_answer(
        message,
        _title(of, terms),
        state,
        *numbers,
        terms=tuple(TermName(name, term.name) for term in terms),
        facts={"low": low, "high": high, **facts},
        region=(Span(name, low, high),) if ends else (),
    )


# --- FT404: is it used?


def use_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether terms are used."""
    system, variables = subject.system, subject.rules.variables
    propositions = [*terms_in_use(subject.rules)]
    if system is not None and subject.policy.decision == "all":
        variables = system.variables  # the view may lack rules and terms
        every = (p for rule in system.rules for p in questions(rule.when))
        propositions = [(p.variable, p.term or "") for p in every]
    used, needed = set(propositions), {variable for variable, _ in propositions}
    for variable in subject.rules.variables:
        if variable.name in needed:
            needed.update(part.input for part in variable.parts)
    proof = Proved(f"{counted(len(propositions), 'proposition')} of all rules read")
    for variable in variables:
        if variable.name not in needed:
            own = tuple(TermName(variable.name, term.name) for term in variable.terms)
            title = f"variable {variable.name!r}"
            yield audit_answer("FT404.unused", title, proof, terms=own)
    names = [(v.name, term.name) for v in variables for term in v.terms]
    for name in names:
        if name[0] in needed and name not in used:
            title, own = f"term {name[1]!r} of {name[0]!r}", (TermName(*name),)
            yield audit_answer("FT404.unused", title, proof, terms=own)
    yield audit_answer(
        "FT404.used",
        "terms and variables",
        proof,
        Measure("variables in use", sum(v.name in needed for v in variables)),
        Measure("terms in use", sum(name in used for name in names)),
    )


def terms_in_use(rules: RuleBase) -> Iterator[tuple[str, str]]:
    """Yield the variables and terms that rules use, as often as they do."""
    for rule in rules.rules:
        for proposition in rule.when:
            yield from ((proposition.variable, term) for term in proposition.terms)


# --- FT402: is it well shaped?

SHALLOW: Final = Fraction(1, 100)
"""Excesses and dips of degrees below this are counted and not listed."""

_SAMPLES: Final = 256  # of the polynomial of a side


def shape_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether terms are well shaped."""
    sound = shallow = 0
    is_curved = False
    for of in ranges(subject):
        for term in of.terms:
            subject.budget.check()
            every = [*_defects(of, term)]
            defects = [defect for defect in every if defect is not None]
            shallow += len(every) - len(defects)
            sound += not defects
            is_curved |= isinstance(term.shape, LR)
            yield from defects
    if sound or shallow:
        how = "values and polynomials were evaluated in fractions, along all lines"
        state = Computed(how) if is_curved else Proved(how)
        small = Measure("smaller excesses and dips", shallow)
        facts = {"count": sound}
        yield audit_answer("FT402.sound", "terms", state, small, facts=facts)


def _defects(of: VariableRange, term: Term) -> Iterator[AuditAnswer | None]:
    """Yield the defects of a term's shape, None for each too small one."""
    shape, share = term.shape, None
    if not of.values:
        if isinstance(shape, LR):
            yield from _excesses(of, term, shape)
        yield from _dips(of, term)
        share = share_inside(shape, of)
    if isinstance(shape, Points) and max(shape.degrees) < 1.0:
        most = Fraction(max(shape.degrees))
        how = Proved("the largest degree of its points")
        largest = measure("largest degree", Bounds(most, most))
        yield _about("FT402.subnormal", of, [term], how, largest)
    if share is not None and 0 < share.high < Fraction(1, 2):
        how = Proved("its area was integrated in fractions, on the domain and in all")
        inside = measure("share of its area on the domain", share)
        yield _about("FT402.outside", of, [term], how, inside)


def _excesses(of: VariableRange, term: Term, shape: LR) -> Iterator[AuditAnswer | None]:
    """Yield where the polynomials of a set leave [0, 1] before they are clipped."""
    mean = Fraction(shape.mean)
    state = Computed("the polynomial was evaluated in fractions")
    for side, sign in ((shape.left, -1), (shape.right, 1)):
        spread = sign * Fraction(side.spread)
        low, high = sorted((mean, mean + spread))
        low, high = max(low, of.low), min(high, of.high)
        step = (high - low) / _SAMPLES
        x = [low + n * step for n in range(_SAMPLES + 1)] if step > 0 else []
        degrees = [_polynomial(side.curve, (at - mean) / spread) for at in x]
        above, below = [v - 1 for v in degrees], [-v for v in degrees]
        for message, excesses in (("FT402.above", above), ("FT402.below", below)):
            over = [(v, -at) for v, at in zip(excesses, x, strict=True)]
            places = [-at for excess, at in over if excess > 0]
            if places:
                most, at = max(over)
                numbers = (
                    Measure("excess", float(most)),
                    Measure("place of the excess", float(-at), unit=of.variable.unit),
                )
                ends = max(places[0] - step, low), min(places[-1] + step, high)
                answer = _about(message, of, [term], state, *numbers, ends=ends)
                yield answer if most >= SHALLOW else None


def _polynomial(curve: Sequence[float], t: Fraction) -> Fraction:
    """Return the degree of a side up to its spread, as if it were not clipped."""
    total = ZERO
    for coefficient in reversed(curve):
        total = total * (2 * t - 1) + Fraction(coefficient)
    return 1 - t * total


def _dips(of: VariableRange, term: Term) -> Iterator[AuditAnswer | None]:
    lines = of.lines(term.shape)
    deep = measures.dips(lines, SHALLOW)
    smaller = measures.dips(lines, Fraction(1, 10**12))
    yield from [None] * (len(smaller) - len(deep))
    if not deep:
        return
    depths = [min(a, c) - b for (_, a), (_, b), (_, c) in deep]
    (left, _), (valley, bottom), (right, _) = deep[depths.index(max(depths))]
    how = Proved("its curve was evaluated at the ends of all its lines")
    numbers = (
        Measure("peaks", len(deep) + 1),
        Measure("depth of the deepest dip", float(max(depths))),
        Measure("place of the deepest dip", float(valley), unit=of.variable.unit),
    )
    facts, ends = {"bottom": float(bottom)}, (left, right)
    yield _about("FT402.peaks", of, [term], how, *numbers, facts=facts, ends=ends)


def share_inside(shape: Shape, of: VariableRange) -> Bounds | None:
    """Return the share of a curve's area that lies on a range; None of no area."""
    knots = [Fraction(knot) for knot in shape.knots()]
    if len(set(knots)) < 2 or of.low == of.high:
        return None
    first, last = min(knots), max(knots)
    if any(exact_degree(shape, beyond) for beyond in (first - 1, last + 1)):
        return None
    part, (low, high) = Bounds(ZERO, ZERO), measures.area(lines_of(shape, first, last))
    if first < of.high and of.low < last:
        ends = max(first, of.low), min(last, of.high)
        part = measures.area(lines_of(shape, *ends))
    return Bounds(part.low / high, min(part.high / low, ONE)) if low > 0 else None


# --- FT403: is it distinguished from others?

MOST_SHOWN: Final = 20  # the most pairs of terms that are listed one by one
_MOST_KNOTS: Final = 4_000  # of two curves whose overlap is computed


def overlap_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer which terms share so much area that they are hard to distinguish."""
    limit = Fraction(subject.settings.overlap)
    overlaps: list[tuple[Fraction, AuditAnswer]] = []
    apart = points = 0
    for of in ranges(subject):
        terms = of.terms
        curves = [of.lines(term.shape) for term in terms]
        most = measures.most_overlap(curves)
        for a, b in itertools.combinations(range(len(terms)), 2):
            if most[a, b] < limit:
                apart += 1
                continue
            subject.budget.check()
            pair = terms[a], terms[b]
            if sum(len(term.shape.knots()) for term in pair) > _MOST_KNOTS:
                why = f"their curves have more than {_MOST_KNOTS} pieces"
                state = Declined("FTD05", why)
                yield _about("FT403.declined", of, pair, state)
                continue
            shared = measures.overlap(curves[a], curves[b])
            if shared is None:
                points += 1
            elif shared.jaccard.high < limit:
                apart += 1
            else:
                answer = _overlap(of, pair, shared, limit)
                overlaps.append((-shared.jaccard.low, answer))
    overlaps.sort(key=lambda pair: pair[0])
    yield from (answer for _, answer in overlaps[:MOST_SHOWN])
    more = max(len(overlaps) - MOST_SHOWN, 0)
    counts = {"more": more, "points": points}
    facts = {"overlap": float(limit)} | {name: n for name, n in counts.items() if n}
    if overlaps or apart or points:
        how = "areas were bounded on cells, and integrated in fractions where near"
        yield audit_answer(
            "FT403.unlisted" if more else "FT403.others",
            "pairs of terms",
            Proved(how),
            Measure("pairs apart", apart),
            Measure("pairs not listed", more),
            Measure("pairs without area", points),
            facts=facts,
        )


def _overlap(
    of: VariableRange,
    pair: tuple[Term, Term],
    shared: measures.Overlap,
    limit: Fraction,
) -> AuditAnswer:
    message, facts = "FT403.similar", dict[str, str]()
    if shared.is_within and shared.is_around:
        message = "FT403.equal"
    elif shared.is_within or shared.is_around:
        inner, outer = pair if shared.is_within else pair[::-1]
        message, facts = "FT403.within", {"inner": inner.name, "outer": outer.name}
    state: State = Proved("the areas were integrated in fractions, line by line")
    low, high = shared.jaccard
    if low < limit:
        what = f"the share of their area that {_title(of, pair)} have in common"
        state = Bracket(what, float(low), float(high), _INEXACT)
    numbers = [
        measure("shared area by joined area", shared.jaccard),
        measure("possibility", shared.possibility),
    ]
    if shared.crossing and not of.values:
        degree, at = shared.crossing
        numbers.append(measure("crossing height", Bounds(degree, degree)))
        numbers.append(Measure("crossing", float(at), unit=of.variable.unit))
    return _about(message, of, pair, state, *numbers, facts=facts)


# --- FT501: how large is the rule base?


def size_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Count rules, propositions and terms, and compute the index of Nauck."""
    lengths = [len(rule.when) for rule in subject.rules.rules]
    used = set(terms_in_use(subject.rules))
    numbers = [
        Measure("rules", len(lengths)),
        Measure("propositions", sum(lengths)),
        Measure("most propositions of a rule", max(lengths)),
        Measure("propositions per rule", sum(lengths) / len(lengths)),
        Measure("distinct terms in use", len(used)),
        Measure("variables in use", len({variable for variable, _ in used})),
    ]
    if subject.tree is not None:
        numbers.append(Measure("depth of the tree", depth(subject.tree)))
    numbers += [measure(f"{name} of Nauck", value) for name, value in nauck(subject)]
    # Of a view ways count, and rules left out do not.
    is_view = subject.system is not None and subject.policy.decision == "all"
    message = "FT501.size-of-view" if is_view else "FT501.size"
    how = Computed("counted, and integrated in fractions")
    yield audit_answer(message, "the rule base", how, *numbers)


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

    Integrals are taken exactly, not on a grid. Nothing is returned if no rule uses a
    variable, a range is a point, or a term has no exact shape.
    """
    terms = set(terms_in_use(subject.rules))
    names = {variable for variable, _ in terms}
    used = [of for of in ranges(subject) if of.variable.name in names]
    is_known = terms.isdisjoint(subject.inexact)
    if not used or not is_known or any(of.low == of.high for of in used):
        return []
    lengths = [len({c.variable for c in rule.when}) for rule in subject.rules.rules]
    size = Fraction(len(subject.rules.classes), sum(lengths))
    bounds = [coverage(of) for of in used]
    low, high = (sum(ends, ZERO) / len(used) for ends in zip(*bounds, strict=True))
    shares = (Fraction(1, max(len(of.terms) - 1, 1)) for of in used)
    partition = sum(shares, ZERO) / len(used)
    return [
        ("complexity", Bounds(size, size)),
        ("coverage", Bounds(low, high)),
        ("partition", Bounds(partition, partition)),
        ("index", Bounds(size * low * partition, size * high * partition)),
    ]


def coverage(of: VariableRange) -> Bounds:
    """Return the mean of h(x) over a range, as `nauck` defines it."""
    curves = [of.lines(term.shape) for term in of.terms]
    low, high = curves[0].lower.x[0], curves[0].lower.x[-1]
    level, totals = constant(ONE, low, high), list[Fraction]()
    for side in (0, 1):
        lines = combine([curve[side] for curve in curves], _total)
        below = measures.integral(combine([lines, level], min))
        above = measures.integral(lines) - below  # of two terms or more
        totals.append(below - above / max(len(curves) - 1, 1))
    # Where degrees are enclosed, h differs by no more than their sum does.
    areas = map(measures.area, curves)
    slack = sum((area.high - area.low for area in areas), ZERO) / 2
    total, width = sum(totals, ZERO) / 2, high - low
    return Bounds(max(total - slack, ZERO) / width, min((total + slack) / width, ONE))


def _total(degrees: tuple[Fraction, Fraction]) -> Fraction:
    return degrees[0] + degrees[1]
