"""What an audit says of itself, and everything about one answer that can be checked."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from statistics import NormalDist
from typing import Any

from fuzzytree.rechecking.case import Case
from fuzzytree.rechecking.claims import (
    BOUNDS,
    PROVABLE,
    Statement,
    no_more_gaps,
    statements,
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
    Witness,
    fraction,
)
from fuzzytree.rechecking.sentences import LIMITS, MESSAGES, sentence_of
from fuzzytree.rechecking.smt import Script
from fuzzytree.rechecking.solvers import ask
from fuzzytree.rechecking.witnesses import SHOWS, check_spans, check_witness
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

Questions = list[tuple[int, Answer, list[Statement]]]
"""The number of each answer that a solver must decide, and its claims."""


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
    settings = audit.settings
    for name in ("epsilon", "margin", "lead", "level", "overlap"):
        is_share = 0 < getattr(settings, name) <= 1
        expect(is_share, f"the setting {name} is not in (0, 1]")
    expect(1 <= settings.rows <= 10**7, "the setting rows is not in 1 to 10,000,000")
    expect(0 <= settings.seed < 2**32, "the setting seed is not in 0 to 2**32 - 1")
    expect(0 < settings.budget <= 1e9, "the budget is not in (0, 1e9] million steps")
    _domain(audit, case, report)
    ids = {answer.id for answer in audit.answers if answer.is_finding}
    findings = sorted(ids.intersection(audit.accepted))
    expect([*audit.accepted] == findings, "a finding is accepted that there is not")
    is_plain = model.numbers == [*range(1, len(model.numbers) + 1)]
    text = "the numbers of rules in the file are not those of the system"
    expect(audit.numbers == (() if is_plain else tuple(model.numbers)), text)
    expect(audit.rows > 0 or audit.data is None, "a table is named without rows")
    if not case.coded("FT901."):  # which stands in the place of a refuted answer
        report.wrong += _questions(audit, case)
    report.counts["facts about the audit"] += 12


def _domain(audit: Audit, case: Case, report: Report) -> None:
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
        word = (
            "" if variable.parts else stretch_word(variable, side, *case.ends(variable))
        )
        low, high = variable.low, variable.high
        if variable.is_whole and low is not None and high is not None:
            low, high = float(math.ceil(low)), float(math.floor(high))
        is_range = (side.low, side.high) == (low, high)
        is_range |= side.origin != "model" or bool(codes) or variable.is_clipped
        is_inside = low is None or low <= side.low
        is_inside &= high is None or side.high <= high
        is_inside |= not variable.is_clipped or bool(variable.parts)
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


def _questions(audit: Audit, case: Case) -> Iterator[str]:
    """Yield what lacks an answer, and is not listed as left out."""
    codes = [answer.code for answer in case.answers]
    if codes != sorted(codes):
        yield "the answers are not in the order of their codes"
    ends = [
        (answer.repeat, f" --select {answer.facts.get('code', answer.code)}")
        for answer in case.answers
    ]
    starts = {text.removesuffix(end) for text, end in ends}
    is_same = starts <= {""} or all(text.endswith(end) for text, end in ends)
    if not is_same or len(starts) > 1:
        yield "the commands that find it again differ"
    reasons = {text.split(" ")[0]: text for text in audit.unasked}
    if [text.split(" ")[0] for text in audit.unasked] != sorted(reasons):
        yield "the list of what was left out is not in order"
    is_cut = any(
        ": cut short: " in text or text.endswith(("is spent", "interrupted"))
        for text in audit.unasked
    )
    if audit.is_complete == is_cut:
        yield "is_complete is not what was left out says"
    for code in sorted({name.partition(".")[0] for name in MESSAGES} - FREE_CODES):
        if code not in codes and code not in reasons:
            yield f"{code} is neither answered nor listed as left out"
    for code, text in reasons.items():
        is_left = text.endswith(("left out by the user", "that it applies to"))
        if code in codes and (is_left or ": not run: " in text):
            yield f"{code} is answered, and listed as left out"
    for code, items in _items(case).items():
        answers = case.coded(f"{code}.")
        is_open = code in reasons or any(
            "declined" in o.message or "not-listed" in o.message
            for o in case.coded(code)
        )
        is_open |= len(case.numbers) == 1 or (code == "FT102" and "FT101" in reasons)
        if (
            not is_open
            and answers
            and items != {o.rules[0] for o in answers if o.rules}
        ):
            yield f"{code} has not one answer for each rule"
    silent = sorted(o.subject for o in case.coded("FT101.") if not o.rules)
    is_system = case.model.form == "system"
    if is_system and silent != sorted(case.model.silent) and "FT101" not in reasons:
        yield "other rules never fire, as their text says"
    lengths = [len(rule.when) for rule in case.rules.rules]
    answers = [o for o in case.coded("FT107.") if o.rules or o.measures]
    count = sum(
        o.measures[0].value
        if o.measures
        else lengths[o.rules[0] - 1]
        if "silent" in o.message
        else 1
        for o in answers
    )
    if case.coded("FT107.") and "FT107" not in reasons and count != sum(lengths):
        yield "FT107 has not one answer for each proposition"
    for code, rest in _rest(case).items():
        answers = case.coded(f"{code}.")
        is_closed = any(not o.rules for o in answers) or not (rest and answers)
        if not is_closed and code not in reasons:
            yield f"{code} says nothing of all that it does not list"
    messages = [answer.message for answer in case.coded("FT301.")]
    if messages == ["FT301.fires"] and "FT301" not in reasons:
        yield "FT301 says nothing of how strong the strongest rule is"


def _items(case: Case) -> dict[str, set[int]]:
    """Return the rules that codes have an answer each for."""
    every = {*case.numbers}
    dead = {o.rules[0] for o in case.coded("FT101.") if o.is_finding and o.rules}
    if case.model.form == "tree":
        return {"FT101": dead, "FT103": every, "FT205": every - dead}
    if case.model.form == "system":
        return {"FT101": every}
    return {"FT101": every, "FT102": every - dead, "FT103": every}


def _rest(case: Case) -> dict[str, Any]:
    """Return the pairs of rules of codes that list some, and end with the rest."""
    alike, apart = (case.pairs(alike=is_alike) for is_alike in (True, False))
    listed = {answer.rules for answer in case.coded("FT201.")}
    rest: dict[str, Any] = {
        "FT104": [pair for pair in alike if {*pair} <= case.live()],
        "FT106": case.pairs(),
        "FT201": case.conflicts() - listed,
    }
    if case.model.form != "system":
        rest["FT105"] = [pair for pair in apart if {*pair} <= case.live()]
        rest["FT202"] = apart
    return rest


def check_gaps(audit: Audit, case: Case) -> tuple[Answer, list[Statement]] | None:
    """Return the claim that there are no more gaps than the listed ones."""
    gaps = case.coded("FT301.gap")
    is_open = any(text.startswith("FT301 ") for text in audit.unasked)
    is_open |= bool(case.coded("FT301.more"))
    if not gaps or is_open or any(not gap.region for gap in gaps):
        return None
    return gaps[-1], [no_more_gaps(case, gaps)]


# --- one answer


def check_answer(
    case: Case, report: Report, answer: Answer, number: int
) -> list[Statement]:
    """Check everything about an answer, and return what a solver must decide."""
    with report.answer(number, answer):
        check_message(answer)
        _words(case, answer)
        report.counts["sentences written again"] += 1
        _names(case, report, answer)
        check_spans(case, answer.region)
        claims = _state(case, report, answer)
        if isinstance(answer.state, Proved) and not claims:
            report.confirm(number, "recheck")
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


def _words(case: Case, answer: Answer) -> None:
    """Check the subject of an answer, and its facts."""
    is_share = answer.code == "FT701" and answer.message != "FT701.rule"
    if is_share and isinstance(answer.state, Sampled):
        is_hit = answer.state.hits > 0 and not answer.subject.endswith("points")
        require(answer.is_finding is is_hit, "it is a finding, or none")
    subjects = _subjects(case, answer)
    require(answer.subject in subjects, f"it is of {subjects[0]}")
    others = answer.message in ("FT104.others", "FT105.others", "FT106.others")
    listed = sum(o.is_finding for o in case.coded(answer.code)) if others else 0
    require(
        not others or bool(listed) == ("listed" in answer.facts),
        "whether others are listed",
    )
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
        gaps = [gap.id for gap in case.coded("FT301.gap")]
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
    noun = "conclusion" if case.model.form == "system" else "class"
    facts: dict[str, Any] = {
        **{n: getattr(settings, n) for n in ("epsilon", "margin", "lead", "overlap")},
        "nouns": "conclusions" if noun == "conclusion" else "classes",
    }
    if code not in ("FT601", "FT602", "FT701"):  # whose noun is of rows
        facts["noun"] = noun
    if code != "FT201" or not answer.rules:
        facts["level"] = settings.level
    thens = [case.then(n) for n in answer.rules]
    if code in ("FT104", "FT105"):
        for n in answer.rules[1:2]:
            facts |= {"then": case.then(n), "by": case.name(n)}
    elif code != "FT103":
        facts |= dict(zip(("then", "other"), thens, strict=False))
    if code == "FT203":
        facts.pop("other", None)
    if code == "FT301":
        facts["then"] = case.model.uncovered
    if code == "FT107" and answer.rules:
        facts["rule"] = case.name(answer.rules[0])
    return facts


def _names(case: Case, report: Report, answer: Answer) -> None:
    """Check the rules, terms, measures, units and places that an answer names."""
    model = case.model
    is_there = all(n in case.numbers for n in answer.rules)
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
            report.counts["exact measures"] += 1
    if case.file is None:
        require(not answer.places, "a place in no file")
        return
    own = [model.numbers[n - 1] for n in answer.rules]
    if not own and answer.subject in model.absent:
        own = [model.absent[answer.subject]]
    places = [model.places[n - 1] for n in own]
    places += [model.term_places[label.variable, label.term] for label in answer.terms]
    entries = [(place.line, place.column) for place in answer.places]
    is_there = entries in ([*dict.fromkeys(places)], [])
    require(is_there, "its rules and terms stand elsewhere")
    is_file = all(place.file == case.file.name for place in answer.places)
    require(is_file, "a place that is not in the audited file")


def _state(case: Case, report: Report, answer: Answer) -> list[Statement]:
    """Check a state, and return what a solver must decide."""
    state, name = answer.state, answer.message
    kind = type(state).__name__.upper()
    if isinstance(state, Proved | Computed):
        require(bool(state.how), f"it is {kind}, without how")
        if isinstance(state, Proved):
            return statements(case, answer)
        report.counts["answers COMPUTED, not decided again"] += 1
        return []
    if isinstance(state, Declined):
        is_reason = state.code in {f"FTD0{n}" for n in range(1, 9)}
        require(is_reason and bool(state.reason), "declined, and not for a reason")
        require(not answer.is_finding, "what is declined is no finding")
        report.counts["answers DECLINED"] += 1
        return []
    is_free = name not in PROVABLE or name.endswith((".others", ".leaves"))
    is_free |= isinstance(state, Bracket) and answer.code == "FT403"
    require(is_free, f"it must be PROVED, and is {kind}")
    if isinstance(state, Sampled):
        check_sample(state)
    bounds = [*BOUNDS[name](case, answer)] if name in BOUNDS else []
    if isinstance(state, Witness):
        check_witness(case, report, answer, state)
        report.counts["answers with a WITNESS, evaluated again"] += 1
        return bounds
    require(name not in SHOWS, "it needs a witness")
    require(state.low <= state.high, "the ends of the bracket are swapped")
    if isinstance(state, Bracket) and (state.point or state.claims):
        case.check_point(report, state.point, state.claims)
    if not bounds:
        raise UndecidedError("a bracket is not computed again here")
    return bounds


def check_sample(state: Sampled) -> None:
    """Check that an interval is Wilson's; the sample itself is not drawn again.

    Raises:
        UndecidedError: If it is.
    """
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
    """Ask a solver for all claims, and note which answers it confirms.

    Raises:
        CannotRunError: If the solver fails.
    """
    every = [claim for *_, claims in questions for claim in claims]
    if not every and not solver:
        return
    results = ask(script.text(), every, solver)
    replies = iter(results.answers)
    for number, answer, claims in questions:
        pairs = [(claim, next(replies)) for claim in claims]
        if pairs and not results.solver:
            report.unconfirmed += isinstance(answer.state, Proved)
        elif pairs:
            with report.answer(number, answer):
                _judge(pairs, is_exact=script.is_exact)
                is_bound = not isinstance(answer.state, Proved)
                report.confirm(number, results.solver, is_bound=is_bound)


def _judge(results: list[tuple[Statement, str]], *, is_exact: bool) -> None:
    """Compare what a solver answers with what proves each claim.

    Raises:
        DoesNotHoldError: If it refutes one.
        UndecidedError: If it leaves one open, or refutes only bounds of it.
    """
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
