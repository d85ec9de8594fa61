"""One answer of an audit: everything about it that can be checked."""

from __future__ import annotations

import math
from fractions import Fraction
from statistics import NormalDist

from fuzzytree.auditing.recheck.audit_records import (
    Answer,
    Bracket,
    Computed,
    Measure,
    Proved,
    Sampled,
    Witness,
    fraction,
)
from fuzzytree.auditing.recheck.cases import (
    NEAR,
    Case,
    check_point,
    check_spans,
    corners,
    holds,
)
from fuzzytree.auditing.recheck.deciding import PROOFS, SHOWS, WHY, highest, lead
from fuzzytree.auditing.recheck.forms import matches_facts
from fuzzytree.auditing.recheck.head import SEVERITIES
from fuzzytree.auditing.recheck.meaning import value_of
from fuzzytree.auditing.recheck.outcomes import (
    DoesNotHoldError,
    Report,
    UndecidedError,
    require,
)
from fuzzytree.auditing.recheck.sentences import sentence_of


def check_answer(case: Case, report: Report, answer: Answer, where: str) -> None:
    """Check everything about an answer; `where` is what messages call it."""
    allowed = SEVERITIES.get(answer.code, "").split(" ")
    if not allowed[0]:
        report.wrong.append(f"{where}: no question of an audit has this code")
        return
    is_allowed = answer.severity in allowed
    is_allowed |= not answer.is_finding and answer.severity == "info"
    report.expect(is_allowed, f"{where}: its severity is {' or '.join(allowed)}")
    _names(case, report, answer, where)
    try:
        check_spans(case, answer.region)
        _state(case, report, answer)
    except DoesNotHoldError as error:
        report.wrong.append(f"{where}: {error}")
    except (LookupError, ArithmeticError, ValueError, StopIteration):
        report.wrong.append(f"{where}: it names what there is not")
    except UndecidedError as error:
        state = type(answer.state).__name__.upper()
        report.undecided[state, str(error)].append(answer.code)


def _names(case: Case, report: Report, answer: Answer, where: str) -> None:
    """Check what an answer names: rules, terms, measures, units, places."""
    expect = report.expect
    try:
        is_stated = matches_facts(case, answer)
    except IndexError:
        is_stated = False  # a rule that there is not
    if is_stated is None:
        text = "sentences of a form that is not known here"
        report.undecided["SENTENCE", text].append(answer.code)
    try:
        is_stated = is_stated is not False and sentence_of(answer) == answer.sentence
    except (ArithmeticError, LookupError, TypeError, ValueError):
        is_stated = False  # not the facts of its message
    expect(is_stated, f"{where}: its sentence says other than its facts")
    report.counts["sentences compared with facts"] += bool(is_stated)
    count = len(case.rules.rules)
    for number in answer.rules:
        expect(1 <= number <= count, f"{where}: there is no rule {number}")
    variables = [v for one in case.representations.values() for v in one.variables]
    terms = {(v.name, t.name) for v in variables for t in v.terms}
    for label in answer.terms:
        expect(tuple(label) in terms, f"{where}: there is no {label.term!r}")
    units = {"", *(v.unit for v in case.variables.values())}
    for measure in answer.measures:
        expect(measure.unit in units, f"{where}: no unit {measure.unit:.60}")
        if measure.exact is not None:
            text = f"{measure.name}: {measure.exact:.60} is not {measure.value!r}"
            expect(_is_exact(measure, measure.exact), f"{where}: {text}")
            report.counts["exact measures"] += 1
    is_fact = answer.code in ("FT205", "FT501") or answer.code.startswith("FTD")
    expect(not (is_fact and answer.is_finding), f"{where}: it can be no finding")
    for place in answer.places:
        is_file = case.audit.file is not None and place.file == case.audit.file.name
        expect(is_file, f"{where}: a place that is not in the audited file")
    entries = [(place.line, place.column) for place in answer.places]
    try:
        is_there = not case.has_places or entries == case.placed(answer)
    except LookupError:
        is_there = not entries
    expect(is_there, f"{where}: its rules and terms stand elsewhere")


def _is_exact(measure: Measure, exact: str) -> bool:
    try:
        return float(fraction(exact)) == measure.value
    except DoesNotHoldError:
        return False


def _state(case: Case, report: Report, answer: Answer) -> None:
    state = answer.state
    if isinstance(state, Proved):
        require(bool(state.how), "it is proved, without how")
        if answer.code not in PROOFS:
            why = WHY.get(answer.code, "there is no second way for it here")
            raise UndecidedError(why)
        PROOFS[answer.code](case, answer)
        report.counts["answers PROVED, decided again"] += 1
    elif isinstance(state, Witness):
        _witness(case, report, answer, state)
        report.counts["answers with a WITNESS, evaluated again"] += 1
    elif isinstance(state, Bracket):
        _bracket(case, report, answer, state)
        report.counts["answers BRACKET, decided again"] += 1
    elif isinstance(state, Sampled):
        _sample(state)
        raise UndecidedError("a sample is not drawn again here")
    elif isinstance(state, Computed):
        require(bool(state.how), "it is computed, without how")
        report.counts["answers COMPUTED, not decided again"] += 1
    else:
        is_reason = state.code.startswith("FTD") and state.code in SEVERITIES
        require(is_reason and bool(state.reason), "declined, and not for a reason")
        report.counts["answers DECLINED"] += 1


def _bracket(case: Case, report: Report, answer: Answer, state: Bracket) -> None:
    require(state.low <= state.high, "the ends of the bracket are swapped")
    is_far = answer.code == "FT102" and state.high < case.audit.settings.lead
    may_be = is_far or answer.code in ("FT401", "FT403", "FT203", "FT204", "FT601")
    require(may_be or not answer.is_finding, "what is open is no finding")
    entries = {measure.name: measure.value for measure in answer.measures}
    is_min = case.rules.semantics.conjunction == "minimum"
    is_same = answer.code == "FT102" or (answer.code == "FT201" and is_min)
    for name, end in entries.items() if is_same else ():
        wanted = state.high if name.endswith("at most") else state.low
        is_one = math.isclose(end, wanted, abs_tol=float(NEAR))
        require(is_one, f"the {name} is not the bracket's end")
    if state.point or state.claims:
        point = check_point(case, report, state.point, state.claims)
        if answer.code == "FT102" and len(answer.rules) == 1:
            is_reached = lead(case, answer.rules[0], point) >= Fraction(state.low)
            require(is_reached, "the rule does not lead by so much there")
    if answer.code != "FT201" or state.low:
        raise UndecidedError("a bracket is not computed again here")
    highest(case, answer)


def _witness(case: Case, report: Report, answer: Answer, state: Witness) -> None:
    point = check_point(case, report, state.point, state.claims)
    is_same = answer.region in ((), state.region)
    require(is_same, "the answer's region is not that of its witness")
    require(bool(state.claims), "a witness of which nothing is claimed")
    check_spans(case, state.region)
    for span in state.region:
        x = value_of(case.variables[span.variable], point)
        is_above = span.low is None or span.low <= x
        is_in = is_above and (span.high is None or x <= span.high)
        require(is_in, f"the witness lies outside its region in {span.variable!r}")
    passing = {"strength", "degree", "reaches"}
    lasting = [claim for claim in state.claims if claim.kind not in passing]
    if answer.code == "FT201":  # of the pair, and not of the weaker of the two
        lasting = [claim for claim in state.claims if claim.rules == answer.rules]
    for other in corners(case, state.region, point):
        for claim in lasting:
            is_so = holds(case, claim, other)
            require(is_so, f"{claim.kind} fails within the region")
        report.counts["points of regions"] += 1
    if answer.code in SHOWS:
        SHOWS[answer.code](case, answer, state)


def _sample(state: Sampled) -> None:
    require(0 <= state.hits <= state.rows and state.rows > 0, "no share of rows")
    share = state.hits / state.rows
    low, high = wilson(state.hits, state.rows, state.confidence)
    require(state.low <= share <= state.high, "the share is not in its interval")
    is_near = math.isclose(low, state.low, abs_tol=1e-9)
    is_near &= math.isclose(high, state.high, abs_tol=1e-9)
    require(is_near, f"Wilson's interval is {low!r} to {high!r}")


def wilson(hits: int, rows: int, confidence: float) -> tuple[float, float]:
    """Return Wilson's interval of a share.

    Raises:
        DoesNotHoldError: If the confidence is none.

    Example:
        >>> low, high = wilson(5, 10, 0.95)
        >>> round(low, 3), round(high, 3)
        (0.237, 0.763)
    """
    require(0.0 < confidence < 1.0, "a confidence outside (0, 1)")
    z = NormalDist().inv_cdf((1.0 + confidence) / 2.0)
    share, bottom = hits / rows, 1.0 + z * z / rows
    middle = (share + z * z / (2 * rows)) / bottom
    spread = share * (1 - share) / rows + z * z / (4 * rows * rows)
    half = z * math.sqrt(spread) / bottom
    return max(middle - half, 0.0), min(middle + half, 1.0)
