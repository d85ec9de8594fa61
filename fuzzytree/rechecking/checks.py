"""What an audit says of itself, and everything about one answer that can be checked."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Iterator, Mapping
from fractions import Fraction
from statistics import NormalDist
from typing import Any

from fuzzytree.rechecking.case import Case
from fuzzytree.rechecking.claims import (
    BRACKETS,
    PROOFS,
    WITNESSES,
    Check,
    Statement,
    leave_open,
    no_gap,
)
from fuzzytree.rechecking.outcomes import Report, UndecidedError, require
from fuzzytree.rechecking.records import (
    Answer,
    Audit,
    Bracket,
    Computed,
    Declined,
    Policy,
    Proved,
    Sampled,
    Source,
    Span,
    Witness,
    fraction,
)
from fuzzytree.rechecking.sentences import LIMITS, MESSAGES, sentence_of
from fuzzytree.rechecking.smt import Script
from fuzzytree.rechecking.solvers import ask
from fuzzytree.rechecking.words import stretch_word

FREE_CODES = {"FT801", "FT802", "FT901", "FTD"}
"""Codes that no audit must answer or list."""

UNCHECKED = (
    "the version, the hash of the model's content, the table, how many rows and how "
    "long, how proofs were made, who confirmed them, why something is open or left "
    "out, ids, the commands, the counts of FT501, the numbers of FT402 and FT403, the "
    "range of FT401, measures and regions that no sentence shows"
)
"""What of an audit is read and compared with nothing."""

Questions = list[tuple[int, list[Statement]]]
"""The position of each answer that a solver must decide, and its claims."""


def digest_of(facts: Mapping[str, Any]) -> str:
    """Return the SHA-256 of an audit's canonical JSON, with an empty digest."""
    whole = dict(facts) | {"digest": ""}
    text = json.dumps(whole, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def check_source(report: Report, file: Source | None, model: bytes, name: str) -> None:
    """Check the SHA-256 of a model's file."""
    sha = hashlib.sha256(model).hexdigest()
    text = f"the SHA-256 of {name} is {sha}, and not that of the audited file"
    report.expect(file is None or file.sha256 == sha, text)


# --- the audit as a whole


def check_head(audit: Audit, case: Case, report: Report) -> None:
    """Check what stands before the answers, and what they are as a whole."""
    model, expect = case.model, report.expect
    expect(audit.form == model.form, f"the form of the model is {model.form!r}")
    expect(audit.model == model.name, f"the model's name is {model.name!r}")
    policy = Policy(
        "product" if model.is_product else "minimum",
        "all" if model.form == "system" else "strongest",
        model.uncovered,
        model.missing,
    )
    expect(audit.policy == policy, "the policy is not the model's")
    expect(audit.limits == LIMITS, "the panel of limits is not the fixed one")
    for name in ("epsilon", "margin", "lead", "level", "overlap"):
        is_share = 0 < getattr(audit.settings, name) <= 1
        expect(is_share, f"the setting {name} is not in (0, 1]")
    _check_domain(audit, case, report)
    ids = {answer.id for answer in audit.answers if answer.is_finding}
    is_finding = [*audit.accepted] == sorted(ids.intersection(audit.accepted))
    expect(is_finding, "a finding is accepted that there is not")
    numbers = tuple(rule.number for rule in case.rules.rules)
    numbers = () if numbers == (*case.numbers,) else numbers
    text = "the numbers of rules in the file are not those of the system"
    expect(audit.numbers == numbers, text)
    expect(audit.rows > 0 or audit.data is None, "a table is named without rows")
    if not case.answers_of("FT901."):  # which stands in the place of a refuted answer
        report.wrong += _omissions(audit, case)


def _check_domain(audit: Audit, case: Case, report: Report) -> None:
    variables = case.model.variables
    order = [name for name in variables if name in case.sides]
    is_plain = [side.variable for side in audit.domain.sides] == order
    report.expect(is_plain, "the domain's sides are not those of variables, in order")
    for name, variable in variables.items():
        text = f"the domain has no side {name!r}"
        require(bool(variable.parts) or name in case.sides, text)
    for name, side in case.sides.items():
        variable = variables[name]
        codes = tuple(map(float, range(len(variable.categories))))
        is_part = {*side.values} <= {*codes} and bool(side.values) == bool(codes)
        is_part &= side.values[:1] + side.values[-1:] in ((), (side.low, side.high))
        is_chosen = side.origin in ("data", "limits")
        word = ""
        if not variable.parts:
            word = stretch_word(variable, side, *case.ends(variable))
        low, high = variable.low, variable.high
        is_inside = low is None or low <= side.low
        is_inside &= high is None or side.high <= high
        is_inside |= not variable.is_clipped or bool(variable.parts)
        if variable.is_whole and low is not None and high is not None:
            low, high = math.ceil(low), math.floor(high)
        is_range = (side.low, side.high) == (low, high)
        is_range |= side.origin != "model" or bool(codes) or variable.is_clipped
        stand_ins = (variable.missing, None) if is_chosen else (variable.missing,)
        for is_so, what in (
            (side.low <= side.high, "has swapped ends"),
            (is_part, "has other values than the codes of its categories"),
            (is_chosen or side.values == codes, "leaves categories out"),
            (side.missing in stand_ins, "has another stand-in"),
            (side.word == word, f"is {word!r} in words"),
            (side.is_whole == variable.is_whole, "has other numbers than the model's"),
            (is_range, "is not the model's range"),
            (is_inside, "goes beyond the range that values are moved into"),
        ):
            report.expect(is_so, f"the side of {name!r} {what}")


def _omissions(audit: Audit, case: Case) -> Iterator[str]:
    """Yield what lacks an answer, and is not listed as left out."""
    codes = [answer.code for answer in case.answers]
    if codes != sorted(codes):
        yield "the answers are not in the order of their codes"
    left_out = {text.split(" ")[0] for text in audit.unasked}
    ends = ("is spent", "interrupted")
    cut = [o for o in audit.unasked if ": cut short: " in o or o.endswith(ends)]
    if audit.is_complete == bool(cut):
        yield "is_complete is not what was left out says"
    every = {name.partition(".")[0] for name in MESSAGES} - FREE_CODES
    for code in sorted(every - {*codes} - left_out):
        yield f"{code} is neither answered nor listed as left out"
    for code, items in _rules_by_code(case).items():
        answers = case.answers_of(f"{code}.")
        messages = [o.message for o in case.answers_of(code)]
        is_open = any("declined" in o or "not-listed" in o for o in messages)
        is_open |= code in left_out or (code == "FT102" and "FT101" in left_out)
        is_open |= len(case.numbers) == 1 or not answers
        if not is_open and items != {o.rules[0] for o in answers if o.rules}:
            yield f"{code} has not one answer for each rule"
    silent = sorted(o.subject for o in case.answers_of("FT101.") if not o.rules)
    is_silent = case.model.form != "system" or silent == sorted(case.model.silent)
    if not is_silent and "FT101" not in left_out:
        yield "other rules never fire, as their text says"
    answers = case.answers_of("FT107.")
    total = sum(len(rule.when) for rule in case.rules.rules)
    is_whole = sum(_propositions(case, o) for o in answers) == total
    if answers and "FT107" not in left_out and not is_whole:
        yield "FT107 has not one answer for each proposition"
    for code, rest in _pairs_by_code(case).items():
        answers = case.answers_of(f"{code}.")
        is_closed = any(not o.rules for o in answers) or not (rest and answers)
        if not is_closed and code not in left_out:
            yield f"{code} says nothing of all that it does not list"
    messages = [answer.message for answer in case.answers_of("FT301.")]
    if messages == ["FT301.fires"] and "FT301" not in left_out:
        yield "FT301 says nothing of how strong the strongest rule is"


def _propositions(case: Case, answer: Answer) -> float:
    """Return of how many propositions an answer is."""
    if answer.measures:
        return answer.measures[0].value
    is_silent = answer.message == "FT107.silent"
    return len(case.rule(answer.rules[0]).when) if is_silent else len(answer.rules)


def _rules_by_code(case: Case) -> dict[str, set[int]]:
    """Return the rules that codes have an answer each for."""
    every = {*case.numbers}
    answers = case.answers_of("FT101.")
    dead = {o.rules[0] for o in answers if o.is_finding and o.rules}
    if case.model.form == "tree":
        return {"FT101": dead, "FT103": every, "FT205": every - dead}
    if case.model.form == "system":
        return {"FT101": every}
    return {"FT101": every, "FT102": every - dead, "FT103": every}


def _pairs_by_code(case: Case) -> dict[str, Collection[tuple[int, int]]]:
    """Return the pairs of rules of codes that list some, and end with the rest."""
    listed = {answer.rules for answer in case.answers_of("FT201.")}
    rest: dict[str, Collection[tuple[int, int]]] = {
        "FT104": case.live_pairs(alike=True),
        "FT106": case.pairs(),
        "FT201": case.conflicts() - listed,
    }
    if case.model.form != "system":
        rest["FT105"] = case.live_pairs(alike=False)
        rest["FT202"] = case.pairs(alike=False)
    return rest


def check_gaps(audit: Audit, case: Case) -> Questions:
    """Return the claim that there are no more gaps than the listed ones."""
    gaps = case.answers_of("FT301.gap")
    is_open = any(text.startswith("FT301 ") for text in audit.unasked)
    is_open |= bool(case.answers_of("FT301.more"))
    if not gaps or is_open or any(not gap.region for gap in gaps):
        return []
    return [(case.answers.index(gaps[-1]), [no_gap(case, gaps)])]


# --- one answer


def check_answer(case: Case, report: Report, place: int) -> list[Statement]:
    """Check everything about an answer, and return what a solver must decide."""
    with report.answer(place) as answer:
        check_message(answer)
        _check_words(case, answer)
        _check_names(case, answer)
        _check_spans(case, answer.region)
        claims = _check_state(case, report, answer)
        if isinstance(answer.state, Proved) and not claims:
            report.confirm(place, "recheck")
        return claims
    return []


def check_message(answer: Answer) -> None:
    """Check the message of an answer, its severity and its sentence."""
    require(answer.message in MESSAGES, "no answer has this message")
    code, grade = answer.message.partition(".")[0], MESSAGES[answer.message].grade
    if code == "FTD":
        code = answer.state.code if isinstance(answer.state, Declined) else ""
    require(answer.code == code, "its message is of another code")
    is_note = grade == "note" or (grade.endswith("?") and not answer.is_finding)
    grades = (not is_note, "info" if is_note else grade.rstrip("?"))
    is_so = (answer.is_finding, answer.severity) == grades
    require(is_so, f"it is a finding of {grade}")
    require(answer.sentence == sentence_of(answer), "its sentence says something else")


def _check_words(case: Case, answer: Answer) -> None:
    """Check the subject of an answer, and its facts."""
    is_share = answer.code == "FT701" and answer.message != "FT701.rule"
    if is_share and isinstance(answer.state, Sampled):
        is_hit = answer.state.hits > 0 and not answer.subject.endswith("points")
        require(answer.is_finding is is_hit, "it is a finding, or none")
    subjects = _subjects(case, answer)
    require(answer.subject in subjects, f"it is of {subjects[0]}")
    others = answer.message in ("FT104.others", "FT105.others", "FT106.others")
    listed = sum(o.is_finding for o in case.answers_of(answer.code)) if others else 0
    is_so = not others or bool(listed) == ("listed" in answer.facts)
    require(is_so, "whether others are listed")
    facts = _facts(case, answer) | {"listed": listed}
    for name, fact in answer.facts.items():
        is_so = name not in facts or facts[name] == fact
        require(is_so, f"{name}: it is {facts.get(name)!r}")


def _subjects(case: Case, answer: Answer) -> list[str]:
    """Return what an answer can be of."""
    names = [case.name(n) for n in answer.rules]
    if answer.code == "FT107" and "proposition" in answer.facts:
        return [f"{names[0]}, {answer.facts['proposition']!r}"]
    if answer.message in ("FT301.weak", "FT301.reaches"):
        return [f"cover of {case.settings.epsilon:g}"]
    if answer.message.startswith("FT301.gap"):
        gaps = [gap.id for gap in case.answers_of("FT301.gap")]
        return [f"gap {gaps.index(answer.id) + 1}"]
    if len(names) == 2 and answer.code in ("FT106", "FT201", "FT202"):
        return [" and ".join(names)]
    is_of_rule = "FT101" <= answer.code <= "FT105" and case.model.form != "tree"
    if names and is_of_rule:
        is_way = names[0].startswith("way ")
        return [names[0], names[0].partition(" of ")[2] if is_way else names[0]]
    return [MESSAGES[answer.message].subject or answer.subject]


def _facts(case: Case, answer: Answer) -> dict[str, Any]:
    """Return what the facts of an answer must be, by their names."""
    settings, code = case.settings, answer.code
    is_system = case.model.form == "system"
    facts: dict[str, Any] = {
        **{n: getattr(settings, n) for n in ("epsilon", "margin", "lead", "overlap")},
        "nouns": "conclusions" if is_system else "classes",
    }
    if code not in ("FT601", "FT602", "FT701"):  # whose noun is of rows
        facts["noun"] = "conclusion" if is_system else "class"
    if code != "FT201" or not answer.rules:
        facts["level"] = settings.level
    if code in ("FT104", "FT105"):
        for n in answer.rules[1:2]:
            facts |= {"then": case.then(n), "by": case.name(n)}
    elif code != "FT103":
        thens = map(case.then, answer.rules)
        facts |= dict(zip(("then", "other"), thens, strict=False))
    if code == "FT203":
        facts.pop("other", None)
    if code == "FT301":
        facts["then"] = case.model.uncovered
    if code == "FT107" and answer.rules:
        facts["rule"] = case.name(answer.rules[0])
    return facts


def _check_names(case: Case, answer: Answer) -> None:
    """Check the rules, terms, measures, units and places that an answer names."""
    model = case.model
    is_there = {*answer.rules} <= {*case.numbers}
    require(is_there, "it is of a rule that there is not")
    raw = model.raw.variables.values() if model.raw else ()
    variables = [*model.variables.values(), *case.rules.variables.values(), *raw]
    terms = {(v.name, term) for v in variables for term in v.curves}
    is_there = {tuple(label) for label in answer.terms} <= terms
    require(is_there, "it is of a term that there is not")
    units = {"", *(v.unit for v in variables)}
    for measure in answer.measures:
        require(measure.unit in units, f"no unit {measure.unit:.60}")
        if measure.exact is not None:
            text = f"{measure.name}: {measure.exact:.60} is not {measure.value!r}"
            require(float(fraction(measure.exact)) == measure.value, text)
    if case.file is None:
        require(not answer.places, "a place in no file")
        return
    own = [case.rule(n).number for n in answer.rules]
    if not own and answer.subject in model.absent:
        own = [model.absent[answer.subject]]
    places = [model.places[n - 1] for n in own]
    places += [model.term_places[label.variable, label.term] for label in answer.terms]
    entries = [(place.line, place.column) for place in answer.places]
    is_there = entries in ([*dict.fromkeys(places)], [])
    require(is_there, "its rules and terms stand elsewhere")
    is_file = all(place.file == case.file.name for place in answer.places)
    require(is_file, "a place that is not in the audited file")


def _check_spans(case: Case, region: tuple[Span, ...]) -> None:
    """Refuse a region of unknown variables, with swapped ends or in other words."""
    for span in region:
        variable = case.model.variables.get(span.variable)
        require(variable is not None, f"no variable {span.variable!r}")
        is_ordered = span.low is None or span.high is None or span.low <= span.high
        require(is_ordered, f"the region's ends in {span.variable!r} are swapped")
        word = ""
        if variable is not None and not variable.parts:
            low, high = case.ends(variable)
            low = low if span.low is None else Fraction(span.low)
            high = high if span.high is None else Fraction(span.high)
            word = stretch_word(variable, case.sides.get(span.variable), low, high)
        require(span.word == word, f"{span.variable!r} is {word!r}, not {span.word!r}")


def _check_state(case: Case, report: Report, answer: Answer) -> list[Statement]:
    """Check a state, and return what a solver must decide."""
    state, name = answer.state, answer.message
    kind = type(state).__name__.upper()
    if isinstance(state, Proved):
        require(bool(state.how), "it is PROVED, without how")
        return _claims(case, answer, PROOFS.get(name, leave_open))
    if isinstance(state, Declined):
        is_reason = state.code in {f"FTD0{n}" for n in range(1, 9)}
        require(is_reason and bool(state.reason), "declined, and not for a reason")
        require(not answer.is_finding, "what is declined is no finding")
        report.counts["answers DECLINED"] += 1
        return []
    is_free = name not in PROOFS or name.endswith((".others", ".leaves"))
    is_free |= isinstance(state, Bracket) and answer.code == "FT403"
    is_free |= isinstance(state, Computed) and answer.code == "FT402"
    require(is_free, f"it must be PROVED, and is {kind}")
    if isinstance(state, Witness):
        _check_witness(case, answer, state)
        check = WITNESSES.get(name) or BRACKETS.get(name)
        claims = _claims(case, answer, check) if check else []
        report.counts["answers with a WITNESS, evaluated again"] += 1
        return claims
    require(name not in WITNESSES, "it needs a witness")
    if isinstance(state, Computed):
        require(bool(state.how), "it is COMPUTED, without how")
        report.counts["answers COMPUTED, not decided again"] += 1
        return []
    if isinstance(state, Sampled):
        check_sample(state)
    require(state.low <= state.high, "the ends of the bracket are swapped")
    if isinstance(state, Bracket) and (state.point or state.claims):
        case.check_point(state.point, state.claims)
    if name not in BRACKETS:
        raise UndecidedError("a bracket is not computed again here")
    return _claims(case, answer, BRACKETS[name])


def _claims(case: Case, answer: Answer, check: Check) -> list[Statement]:
    return [*(check(case, answer) or ())]


def _check_witness(case: Case, answer: Answer, state: Witness) -> None:
    """Check the claims of a witness at its point, and its region."""
    point = case.check_point(state.point, state.claims)
    is_same = answer.region in ((), state.region)
    require(is_same, "the answer's region is not that of its witness")
    require(bool(state.claims), "a witness of which nothing is claimed")
    levels = [claim for claim in state.claims if claim.kind == "strength"]
    if levels and answer.rules:  # of the first rule of the answer that is so strong
        same = (levels[0]._replace(rules=(n,)) for n in answer.rules)
        first = next((claim for claim in same if case.holds(claim, point)), None)
        require(levels[0] == first, "the strength of another rule is claimed")
    _check_spans(case, state.region)
    for span in state.region:
        x = case.model.variables[span.variable].at(point)
        is_in = span.low is None or span.low <= x
        is_in &= span.high is None or x <= span.high
        require(is_in, f"the witness lies outside its region in {span.variable!r}")


def check_sample(state: Sampled) -> None:
    """Check that an interval is Wilson's; the sample itself is not drawn again."""
    require(0 <= state.hits <= state.rows and state.rows > 0, "no share of rows")
    require(0.0 < state.confidence < 1.0, "a confidence outside (0, 1)")
    z = NormalDist().inv_cdf((1.0 + state.confidence) / 2.0)
    share, bottom = state.hits / state.rows, 1.0 + z * z / state.rows
    middle = (share + z * z / (2 * state.rows)) / bottom
    spread = share * (1 - share) / state.rows + z * z / (4 * state.rows**2)
    half = z * math.sqrt(spread) / bottom
    low, high = max(middle - half, 0.0), min(middle + half, 1.0)
    is_near = math.isclose(low, state.low, abs_tol=1e-9)
    is_near &= math.isclose(high, state.high, abs_tol=1e-9)
    require(is_near, f"Wilson's interval is {low!r} to {high!r}")
    raise UndecidedError("a sample is not drawn again here")


# --- solvers


def decide(script: Script, report: Report, questions: Questions, solver: str) -> None:
    """Ask a solver for all claims, and note which answers it confirms."""
    every = [claims for _, claims in questions]
    if not any(every) and not solver:
        return
    results = ask(script.text(), every, solver)
    replies = iter(results.answers)
    for place, claims in questions:
        pairs = [(claim, next(replies)) for claim in claims]
        is_proof = isinstance(report.answers[place].state, Proved)
        if pairs and not results.solver:
            report.unconfirmed += is_proof
        elif pairs:
            with report.answer(place):
                _judge(pairs, is_exact=script.is_exact)
                report.confirm(place, results.solver, is_bound=not is_proof)


def _judge(results: list[tuple[Statement, str]], *, is_exact: bool) -> None:
    """Compare what a solver answers with what proves each claim."""
    reasons: list[str] = []
    for claim, result in results:
        is_certain = result == "unsat" or (result == "sat" and is_exact)
        if is_certain and result == claim.expected:
            continue
        require(not (is_certain and claim.is_sure), f"not so: {claim.text}")
        if result == "unknown":
            reasons.append("beyond the budget of the solver")
        elif is_certain:
            reasons.append("it may be so only where strengths are equal, or 0")
        else:
            reasons.append("curves that are no lines, and too near to each other")
    if reasons:
        raise UndecidedError(reasons[0])
