"""What an audit says of itself, and everything about one answer that can be checked."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from statistics import NormalDist
from typing import Any, Literal

from fuzzytree.rechecking.case import Case
from fuzzytree.rechecking.claims import (
    PROVABLE,
    Statement,
    bound_statements,
    conflicting_pairs,
    no_more_gaps,
    size,
    statements,
)
from fuzzytree.rechecking.outcomes import (
    Report,
    UndecidedError,
    require,
)
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
from fuzzytree.rechecking.witnesses import SHOWS, check_spans, check_witness
from fuzzytree.rechecking.words import stretch_word

NOT_ASKED = ("FT801", "FT802", "FT901")
"""Codes that no audit must answer or list."""


UNCHECKED = (
    "the version, the hash of the model's content, the table, how many rows and how "
    "long, how proofs were made, who confirmed them, why something is open or left "
    "out, ids, the commands"
)
"""What of an audit is read and compared with nothing."""


def digest_of(facts: Mapping[str, Any]) -> str:
    """Return the SHA-256 of an audit's canonical JSON, with an empty digest."""
    whole = dict(facts) | {"digest": ""}
    text = json.dumps(whole, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


# --- the audit as a whole


def check_files(
    case: Case, report: Report, facts: Mapping[str, Any], model: bytes, name: str
) -> None:
    """Check the digest of an audit's facts, and the SHA-256 of the model's file."""
    digest = digest_of(facts)
    report.expect(facts["digest"] == digest, f"the digest is {digest}")
    check_source(report, case.file, model, name)


def check_source(report: Report, file: Source | None, model: bytes, name: str) -> None:
    """Check the SHA-256 of a model's file."""
    sha = hashlib.sha256(model).hexdigest()
    text = f"the SHA-256 of {name} is {sha}, and not that of the audited file"
    report.expect(file is None or file.sha256 == sha, text)


def check_head(audit: Audit, case: Case, report: Report) -> None:
    """Check what stands before the answers, and what they are as a whole."""
    model, expect = case.model, report.expect
    expect(audit.form == model.form, f"the form of the model is {model.form!r}")
    expect(audit.model == model.name, f"the model's name is {model.name!r}")
    decides: Literal["strongest", "all"] = (
        "all" if model.form == "system" else "strongest"
    )
    norm = "product" if model.is_product else "minimum"
    policy = Policy(norm, decides, model.uncovered, model.missing)
    expect(audit.policy == policy, "the policy is not the model's")
    expect(audit.limits == LIMITS, "the panel of limits is not the fixed one")
    settings = audit.settings
    for name in ("epsilon", "margin", "lead", "level", "overlap"):
        is_share = 0 < getattr(settings, name) <= 1
        expect(is_share, f"the setting {name} is not in (0, 1]")
    expect(1 <= settings.rows <= 10**7, "the setting rows is not in 1 to 10,000,000")
    expect(0 <= settings.seed < 2**32, "the setting seed is not in 0 to 2**32 - 1")
    expect(0 < settings.budget_s <= 1e9, "the budget is not in (0, 1e9] seconds")
    _domain(audit, case, report)
    ids = {one.id for one in audit.answers if one.is_finding}
    known = sorted(ids.intersection(audit.accepted))
    expect([*audit.accepted] == known, "a finding is accepted that there is not")
    is_plain = model.numbers == [*range(1, len(model.numbers) + 1)]
    text = "the numbers of rules in the file are not those of the system"
    expect(audit.numbers == (() if is_plain else tuple(model.numbers)), text)
    expect(audit.rows > 0 or audit.data is None, "a table is named without rows")
    if not case.coded("FT901."):  # which stands in the place of a refuted answer
        _questions(audit, case, report)
    report.counts["facts about the audit"] += 12


def _domain(audit: Audit, case: Case, report: Report) -> None:
    expect, variables = report.expect, case.model.variables
    order = [name for name in variables if name in case.sides]
    is_plain = [side.variable for side in audit.domain.sides] == order
    expect(is_plain, "the domain's sides are not those of variables, in order")
    for name, side in case.sides.items():
        text = f"the side of {name!r}"
        expect(side.low <= side.high, f"{text} has swapped ends")
        one = variables.get(name)
        codes = () if one is None else tuple(map(float, range(len(one.categories))))
        is_part = {*side.values} <= {*codes} and bool(side.values) == bool(codes)
        ends = (side.values[0], side.values[-1]) if side.values else None
        is_part &= ends in (None, (side.low, side.high))
        expect(is_part, f"{text} has other values than the codes of its categories")
        stand_in = None if one is None else one.missing
        if side.origin not in ("data", "limits"):
            expect(side.values == codes, f"{text} leaves categories out")
            expect(side.missing == stand_in, f"{text} has another stand-in")
        expect(side.missing in (None, stand_in), f"{text} has a stand-in of its own")
        if one is not None:
            word = stretch_word(one, side, *case.ends(one)) if not one.parts else ""
            expect(side.word == word, f"{text} is {word!r} in words")
        is_whole = one is not None and one.is_whole
        expect(side.is_whole == is_whole, f"{text} has other numbers than the model's")
        is_range = side.origin == "model" and not codes
        if one is not None and is_range and not one.is_clipped:
            low, high = one.low, one.high
            if is_whole and low is not None and high is not None:
                low, high = float(math.ceil(low)), float(math.floor(high))
            is_range = (side.low, side.high) == (low, high)
            expect(is_range, f"{text} is not the model's range")
        if one is not None and one.is_clipped and not one.parts:
            is_in = (one.low is None or one.low <= side.low) and (
                one.high is None or side.high <= one.high
            )
            expect(is_in, f"{text} goes beyond the range that values are moved into")
    for name, one in variables.items():
        text = f"the domain has no side {name!r}"
        require(bool(one.parts) or name in case.sides, text)


def _questions(audit: Audit, case: Case, report: Report) -> None:
    """Check that every code has all its answers or is listed as left out."""
    expect = report.expect
    codes = [one.code for one in audit.answers]
    expect(codes == sorted(codes), "the answers are not in the order of their codes")
    ends = [
        (one.repeat, f" --select {one.facts.get('code', one.code)}")
        for one in audit.answers
    ]
    starts = {text.removesuffix(end) for text, end in ends}
    is_one = starts <= {""} or all(text.endswith(end) for text, end in ends)
    expect(is_one and len(starts) < 2, "the commands that find it again differ")
    left = [text.split(" ")[0] for text in audit.unasked]
    expect(left == sorted({*left}), "the list of what was left out is not in order")
    is_cut = any(
        ": cut short: " in text or text.endswith(("is spent", "interrupted"))
        for text in audit.unasked
    )
    text = "is_complete is not what was left out says"
    expect(audit.is_complete == (not is_cut), text)
    known = {name.partition(".")[0] for name in MESSAGES} - {"FTD", *NOT_ASKED}
    for code in sorted(known):
        is_stated = code in codes or code in left
        expect(is_stated, f"{code} is neither answered nor listed as left out")
    for code, text in zip(left, audit.unasked, strict=True):
        is_left = text.endswith(("left out by the user", "that it applies to"))
        is_both = code in codes and (is_left or ": not run: " in text)
        expect(not is_both, f"{code} is answered, and listed as left out")
    every, is_tree = {*case.numbers}, case.model.form == "tree"
    dead = {
        one.rules[0] for one in case.coded("FT101.") if one.is_finding and one.rules
    }
    is_system = case.model.form == "system"
    wanted = {"FT101": every, "FT102": every - dead, "FT103": every}
    if is_tree:
        wanted = {"FT101": dead, "FT103": every, "FT205": every - dead}
    if is_system:
        wanted = {"FT101": every}
        silent = sorted(one.subject for one in case.coded("FT101.") if not one.rules)
        is_all = silent == sorted(case.model.silent) or "FT101" in left
        expect(is_all, "other rules never fire, as their text says")
    for code, numbers in wanted.items():
        result = {one.rules[0] for one in case.coded(f"{code}.") if one.rules}
        is_open = code in left or any(
            "declined" in o.message or "not-listed" in o.message
            for o in case.coded(code)
        )
        is_open |= len(every) == 1 or (code == "FT102" and "FT101" in left)
        text = f"{code} has not one answer for each rule"
        expect(is_open or result == numbers or not case.coded(code), text)
    lengths = [len(rule.when) for rule in case.rules.rules]
    of = case.coded("FT107.")
    count = sum(
        o.measures[0].value
        if o.measures
        else lengths[o.rules[0] - 1]
        if "silent" in o.message
        else 1
        for o in of
        if o.rules or o.measures
    )
    is_all = "FT107" in left or not of or count == sum(lengths)
    expect(is_all, "FT107 has not one answer for each proposition")
    report.wrong += _closings(audit, case)


def _closings(audit: Audit, case: Case) -> Iterator[str]:
    """Yield which codes lack the answer that is about all that is not listed."""
    left = [text.split(" ")[0] for text in audit.unasked]
    pairs, fires = conflicting_pairs(case), case.above[0]
    alike, apart = (case.pairs(alike=is_alike) for is_alike in (True, False))
    needed = {
        "FT104": [pair for pair in alike if {*pair} <= fires],
        "FT105": [pair for pair in apart if {*pair} <= fires],
        "FT106": case.pairs(),
        "FT201": pairs - {one.rules for one in case.coded("FT201.")},
        "FT202": apart,
    }
    if case.model.form == "system":
        del needed["FT105"], needed["FT202"]
    for code, rest in needed.items():
        of = case.coded(f"{code}.")
        is_closed = any(not one.rules for one in of) or not (rest and of)
        if not is_closed and code not in left:
            yield f"{code} says nothing of all that it does not list"
    known = [one.message for one in case.coded("FT301.")]
    if known == ["FT301.fires"] and "FT301" not in left:
        yield "FT301 says nothing of how strong the strongest rule is"


def check_gaps(audit: Audit, case: Case) -> tuple[Answer, list[Statement]] | None:
    """Return the claim that there are no more gaps than the listed ones."""
    gaps = case.coded("FT301.gap")
    is_open = any(text.startswith("FT301 ") for text in audit.unasked)
    is_open |= bool(case.coded("FT301.more"))
    if not gaps or is_open or any(not one.region for one in gaps):
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
        result = _state(case, report, answer)
        if isinstance(answer.state, Proved) and not result:
            report.counts["answers PROVED, read and evaluated again"] += 1
            report.confirmed[number - 1] = "recheck"
        return result
    return []


def check_message(answer: Answer) -> None:
    """Check the message of an answer, its severity and its sentence."""
    require(answer.message in MESSAGES, "no answer has this message")
    code, grade = answer.message.partition(".")[0], MESSAGES[answer.message].grade
    if code == "FTD":
        code = answer.state.code if isinstance(answer.state, Declined) else ""
    require(answer.code == code, "its message is of another code")
    is_note = grade == "note" or (grade.endswith("?") and not answer.is_finding)
    wanted = (not is_note, "info" if is_note else grade.rstrip("?"))
    require(
        (answer.is_finding, answer.severity) == wanted, f"it is a finding of {grade}"
    )
    require(answer.sentence == sentence_of(answer), "its sentence says something else")


def _words(case: Case, answer: Answer) -> None:
    """Check the subject of an answer, and its facts."""
    is_share = answer.code == "FT701" and answer.message != "FT701.rule"
    if is_share and isinstance(answer.state, Sampled):
        is_hit = answer.state.hits > 0 and not answer.subject.endswith("points")
        require(answer.is_finding is is_hit, "it is a finding, or none")
    wanted_subject = MESSAGES[answer.message].subject or answer.subject
    if answer.code == "FT107" and "proposition" in answer.facts:
        wanted_subject = "{rule}, {proposition!r}".format(**answer.facts)
    if answer.message in ("FT301.weak", "FT301.reaches"):
        wanted_subject = f"cover of {case.settings.epsilon:g}"
    if answer.message.startswith("FT301.gap"):
        gaps = [one.id for one in case.coded("FT301.gap")]
        wanted_subject = f"gap {gaps.index(answer.id) + 1}"
    require(answer.subject == wanted_subject, f"it is of {wanted_subject}")
    known = _known_facts(case, answer)
    for name, fact in answer.facts.items():
        is_known = name in known
        require(
            not is_known or known[name] == fact, f"{name}: it is {known.get(name)!r}"
        )


def _known_facts(case: Case, answer: Answer) -> dict[str, Any]:
    """Return what the facts of an answer must be, by their names."""
    settings, model = case.settings, case.model
    is_system = model.form == "system"
    known: dict[str, Any] = {
        **{
            name: getattr(settings, name)
            for name in ("epsilon", "margin", "lead", "overlap")
        },
        "noun": "conclusion" if is_system else "class",
        "nouns": "conclusions" if is_system else "classes",
    }
    if answer.code not in ("FT201",) or not answer.rules:
        known["level"] = settings.level
    if answer.code in ("FT601", "FT602", "FT701"):
        del known["noun"]  # of rows
    thens = [case.then(n) for n in answer.rules]
    if thens and answer.code not in ("FT105", "FT104"):
        known |= dict(zip(("then", "other"), thens, strict=False))
    if len(thens) > 1 and answer.code in ("FT104", "FT105"):
        known |= {"then": thens[1], "by": case.name(answer.rules[1])}
    if answer.message == "FT103.superfluous":
        later = [n for n in case.rivals(answer.rules[0]) if n > answer.rules[0]]
        known["later"] = len(later)
        require(
            bool(later) == ("later" in answer.facts),
            "whether later rules are of another class",
        )
    if answer.message in ("FT104.others", "FT105.others", "FT106.others"):
        listed = len([o for o in case.coded(answer.code) if o.is_finding])
        known["listed"] = listed
        require(bool(listed) == ("listed" in answer.facts), "whether others are listed")
    if answer.code == "FT203":
        known.pop("other", None)
    if answer.code == "FT301":
        known["then"] = model.uncovered
    if answer.code == "FT107" and answer.rules:
        known["rule"] = case.name(answer.rules[0])
    if len(answer.rules) == 2 and answer.code in ("FT106", "FT201", "FT202"):
        subject = " and ".join(map(case.name, answer.rules))
        require(answer.subject == subject, f"it is of {subject}")
    elif (
        answer.rules
        and answer.code in ("FT101", "FT102", "FT103", "FT104", "FT105")
        and model.form != "tree"
    ):
        own = case.name(answer.rules[0])
        ways = own.partition(" of ")[2] if own.startswith("way ") else own
        require(answer.subject in (own, ways), f"it is of {own}")
    return known


def _names(case: Case, report: Report, answer: Answer) -> None:
    """Check the rules, terms, measures, units and places that an answer names."""
    count, model = len(case.numbers), case.model
    require(
        all(1 <= n <= count for n in answer.rules), "it is of a rule that there is not"
    )
    raw = model.raw.variables.values() if model.raw else ()
    variables = [*model.variables.values(), *case.rules.variables.values(), *raw]
    terms = {(v.name, term) for v in variables for term in v.curves}
    require(
        {tuple(one) for one in answer.terms} <= terms,
        "it is of a term that there is not",
    )
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
    wanted = [model.places[n - 1] for n in own]
    wanted += [model.term_places[label.variable, label.term] for label in answer.terms]
    entries = [(place.line, place.column) for place in answer.places]
    is_there = entries in ([*dict.fromkeys(wanted)], [])
    require(is_there, "its rules and terms stand elsewhere")
    is_file = all(place.file == case.file.name for place in answer.places)
    require(is_file, "a place that is not in the audited file")


def _state(case: Case, report: Report, answer: Answer) -> list[Statement]:
    """Check a state, and return what a solver must decide."""
    state = answer.state
    name, kind = answer.message, type(state).__name__.upper()
    if isinstance(state, Proved):
        require(bool(state.how), f"it is {kind}, without how")
        return statements(case, answer)
    if isinstance(state, Computed):
        require(bool(state.how), f"it is {kind}, without how")
        if answer.code == "FT501":
            size(case, answer)
        report.counts["answers COMPUTED, not decided again"] += 1
        return []
    if isinstance(state, Declined):
        known = {f"FTD0{n}" for n in range(1, 9)}
        is_reason = state.code in known and bool(state.reason)
        require(is_reason, "declined, and not for a reason")
        require(not answer.is_finding, "what is declined is no finding")
        report.counts["answers DECLINED"] += 1
        return []
    is_free = name not in PROVABLE or name.endswith((".others", ".leaves"))
    is_free |= isinstance(state, Bracket) and answer.code == "FT403"
    require(is_free, f"it must be PROVED, and is {kind}")
    if isinstance(state, Witness):
        check_witness(case, report, answer, state)
        report.counts["answers with a WITNESS, evaluated again"] += 1
        return bound_statements(case, answer)
    if isinstance(state, Bracket):
        require(name not in SHOWS, "it needs a witness")
        require(state.low <= state.high, "the ends of the bracket are swapped")
        if state.point or state.claims:
            case.check_point(report, state.point, state.claims)
        result = bound_statements(case, answer)
        if not result:
            raise UndecidedError("a bracket is not computed again here")
        return result
    check_sample(state)
    raise UndecidedError("a sample is not drawn again here")


def judge(results: Iterable[tuple[Statement, str]], *, is_exact: bool) -> None:
    """Compare what a solver answers with what proves each claim.

    Raises:
        DoesNotHoldError: If it refutes one.
        UndecidedError: If it leaves one open, or refutes only bounds of it.
    """
    why = ""
    for one, result in results:
        is_sure = result == "unsat" or (result == "sat" and is_exact)
        if is_sure and result == one.expected:
            continue
        require(not (is_sure and one.is_sure), f"not so: {one.text}")
        text = "it may be so only where strengths are equal"
        if result == "unknown":
            text = "beyond the budget of the solver"
        elif not is_sure:
            text = "curves that are no lines, and too near to each other"
        why = why or text
    if why:
        raise UndecidedError(why)


def check_sample(state: Sampled) -> None:
    """Check that an interval is Wilson's."""
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
