"""What an audit says of itself: files, settings, domain, completeness, ids."""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Mapping
from typing import Any, Literal

from fuzzytree.auditing.recheck.audit_records import Answer, Policy
from fuzzytree.auditing.recheck.cases import Case
from fuzzytree.auditing.recheck.model_records import (
    LR,
    And,
    Band,
    Curve,
    Is,
    Model,
    Not,
    Or,
    Points,
    Rule,
    Rules,
    Shape,
    System,
    Term,
    Tree,
)
from fuzzytree.auditing.recheck.outcomes import Report, UndecidedError

LIMITS = (
    "that the rules are right: an audit finds what a rule base says, not whether it is "
    "true of the world",
    "anything outside the domain: every answer holds on the stated ranges and nowhere "
    "else",
    "that all of the domain can happen: inputs are combined in every way, also in "
    "those that no row will ever have",
    "more about a sampled share than its interval says, and that only with the stated "
    "confidence",
    "what a bracket leaves open: the number lies between the two ends, and nothing "
    "more is known",
    "anything about what was declined or not run; both are listed",
    "that strengths which only touch are reported: ties and gaps without an interior "
    "are left out",
    "what rounding changes: answers are about real numbers at the doubles of the "
    "model, and a runtime may differ where strengths nearly tie",
    "that other files, runtimes or devices answer alike: only what was compared is "
    "compared",
    "that the given rows are right, or stand for those to come",
    "who made this audit: the digest shows an edit, and is no signature",
)
"""What every audit says that it does not establish, word for word."""

SEVERITIES = {
    **dict.fromkeys(("FT105", "FT601", "FT602"), "error"),
    **dict.fromkeys(("FT102", "FT104", "FT202", "FT203", "FT402"), "warning"),
    **dict.fromkeys(("FT103", "FT107", "FT201", "FT204", "FT205", "FT403"), "info"),
    **dict.fromkeys(("FT404", "FT501", "FT701"), "info"),
    **dict.fromkeys([f"FTD0{n}" for n in range(1, 9)], "info"),
    "FT101": "error warning",  # it decides by its place alone
    "FT301": "warning info",  # the model answers a class where no rule fires
    "FT106": "warning error info",  # of another class: a contradiction, or a note
    "FT401": "warning error",  # never reached at all
}
"""Every code, and the severities that a finding of it can have."""


# --- fingerprints

_TAGS: dict[type, str] = {
    kind: kind.__name__.lower() for kind in (Band, LR, Points, Is, And, Or, Not)
}


def fingerprint(model: Model | System) -> str:
    """Return the SHA-256 of a model's content, written as compact JSON."""
    return hashlib.sha256(compact(model).encode()).hexdigest()


def digest_of(facts: Mapping[str, Any]) -> str:
    """Return the SHA-256 of an audit's canonical JSON, with an empty digest."""
    whole = dict(facts) | {"digest": ""}
    text = json.dumps(whole, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def compact(value: Any) -> str:
    """Return records, tuples and scalars as JSON without blanks."""
    if isinstance(value, float):
        return _digits(value)
    if not isinstance(value, tuple | list):
        return json.dumps(value, ensure_ascii=False)
    names: tuple[str, ...] = getattr(value, "_fields", ())
    if not names:
        return f"[{','.join(map(compact, value))}]"
    settings: list[tuple[str, Any]] = [*zip(names, value, strict=True)]
    settings = [pair for pair in settings if pair != ("label_type", None)]
    tag = _TAGS.get(type(value))
    if isinstance(value, Curve):
        tag, settings = value.kind, [*value.facts]
    pairs = [f'"type":"{tag}"'] if tag else []
    pairs += [f'"{n.rstrip("_")}":{compact(v)}' for n, v in settings]
    return f"{{{','.join(pairs)}}}"


def _digits(value: float) -> str:
    """Return the shortest digits: in full from 1e-5 up to 1e16, else with exponent."""
    sign = "-" if math.copysign(1.0, value) < 0 else ""
    mantissa, _, power = f"{abs(value)!r}".partition("e")
    if not power:
        return f"{sign}{mantissa}"
    mantissa = mantissa.removesuffix(".0")
    if int(power) == -5:
        return f"{sign}0.0000{mantissa.replace('.', '')}"
    return f"{sign}{mantissa}e{int(power)}"


def said(rule: Rule, shapes: Mapping[tuple[str, str], Shape]) -> list[Any]:
    """Return what a rule says and with which curves, in an order of its own."""
    propositions = sorted(rule.when, key=str)
    texts = [
        f"{c.variable} is {'not ' * c.negated}{' or '.join(c.terms)}"
        for c in propositions
    ]
    curves = [
        [c.variable, c.negated, sorted(compact(shapes[c.variable, t]) for t in c.terms)]
        for c in propositions
    ]
    said = f"IF {' AND '.join(texts)} THEN" if texts else "ALWAYS"
    return [f"{said} {rule.then}", sorted(curves, key=str)]


# --- the checks


def check_files(
    case: Case, report: Report, facts: Mapping[str, Any], model: bytes, name: str
) -> None:
    """Check the digest of an audit's facts, and the SHA-256 of the model's file."""
    digest = digest_of(facts)
    report.expect(case.audit.digest == digest, f"the digest is {digest}")
    sha = hashlib.sha256(model).hexdigest()
    if case.audit.file is not None:
        text = f"the SHA-256 of {name} is {sha}, and not that of the audited file"
        report.expect(case.audit.file.sha256 == sha, text)


def check_head(case: Case, report: Report) -> None:
    """Check what stands before the answers, and what they are as a whole."""
    audit, model, expect = case.audit, case.model, report.expect
    form = "tree" if isinstance(model, Tree) else "rules"
    if isinstance(model, Rules) and model.kind:
        form = f"{model.kind} rules"
    form = form if case.view is None else "system"
    expect(audit.form == form, f"the form of the model is {form!r}")
    expect(audit.model == model.name, f"the model's name is {model.name!r}")
    _content(case, report)
    meant = model.semantics
    decides: Literal["strongest", "all"] = "all" if case.view else "strongest"
    policy = Policy(meant.conjunction, decides, meant.uncovered, meant.missing)
    expect(audit.policy == policy, "the policy is not the model's")
    expect(audit.limits == LIMITS, "the panel of limits is not the fixed one")
    _settings(case, report)
    _domain(case, report)
    ids = [one.id for one in audit.answers if one.is_finding]
    known = sorted(set(ids).intersection(audit.accepted))
    expect(list(audit.accepted) == known, "a finding is accepted that there is not")
    numbers = tuple(one.number + 1 for one in case.view.owners) if case.view else ()
    is_plain = numbers == tuple(range(1, len(numbers) + 1))
    text = "the numbers of rules in the file are not those of the system"
    expect(audit.numbers == (() if is_plain else numbers), text)
    expect(audit.rows > 0 or audit.data is None, "a table is named without rows")
    report.counts["facts about the audit"] += 12
    _questions(case, report)
    _complete(case, report)
    _ids(case, report)


def _content(case: Case, report: Report) -> None:
    """Check the hash of what the model holds, if all of it is known here."""
    whole = case.model if case.view is None else case.view.system
    labels: list[Term] = []
    if isinstance(whole, System):
        labels += [label for one in whole.inputs for label in one.terms]
        labels += [label for one in whole.outputs for label in one.terms]
    curves = [one.function for one in labels if isinstance(one.function, Curve)]
    if any(curve.kind == "formula" for curve in curves):
        report.undecided["FACT", "the hash of a system with formulas"].append("head")
        return
    print_ = fingerprint(whole)
    is_one = case.audit.fingerprint == print_
    report.expect(is_one, f"the model's fingerprint is {print_}")


def _settings(case: Case, report: Report) -> None:
    settings, expect = case.audit.settings, report.expect
    for name in ("epsilon", "margin", "lead", "level", "overlap"):
        is_share = 0 < getattr(settings, name) <= 1
        expect(is_share, f"the setting {name} is not in (0, 1]")
    expect(1 <= settings.rows <= 10**7, "the setting rows is not in 1 to 10,000,000")
    expect(0 <= settings.seed < 2**32, "the setting seed is not in 0 to 2**32 - 1")
    expect(0 < settings.budget_s <= 1e9, "the budget is not in (0, 1e9] seconds")


def _domain(case: Case, report: Report) -> None:
    expect = report.expect
    order = [name for name in case.variables if name in case.sides]
    is_plain = [side.variable for side in case.audit.domain.sides] == order
    expect(is_plain, "the domain's sides are not those of variables, in order")
    for name, side in case.sides.items():
        text = f"the side of {name!r}"
        expect(name in case.variables, f"{text} is of no variable")
        expect(side.low <= side.high, f"{text} has swapped ends")
        expect(not side.is_open, f"{text} is open, as no audit's is")
        variable = case.variables.get(name)
        if variable is not None and side.origin == "model":
            is_range = (side.low, side.high) == (variable.low, variable.high)
            expect(is_range, f"{text} is not the model's range")
        moved = case.view.inputs.get(name) if case.view else None
        if moved is not None and moved.clips and not moved.parts:
            low, high = moved.low, moved.high
            is_in = (low is None or low <= side.low) and (
                high is None or side.high <= high
            )
            expect(is_in, f"{text} goes beyond the range that values are moved into")
    for name, variable in case.variables.items():
        expect(bool(variable.parts) or name in case.sides, f"{name!r} has no side")


def _questions(case: Case, report: Report) -> None:
    """Check that every code has answers or is listed as left out."""
    audit, expect = case.audit, report.expect
    codes = [one.code for one in audit.answers]
    is_sorted = codes == sorted(codes)
    expect(is_sorted, "the answers are not in the order of their codes")
    ends = [(one.repeat, f" --select {one.code}") for one in audit.answers]
    starts = {text.removesuffix(end) for text, end in ends}
    is_one = starts <= {""} or all(text.endswith(end) for text, end in ends)
    expect(is_one and len(starts) < 2, "the commands that find it again differ")
    entries = [text.split(" ")[0] for text in audit.unasked]
    expect(
        entries == sorted(set(entries)), "the list of what was left out is not in order"
    )
    is_cut = any(
        ": cut short: " in text or text.endswith(("is spent", "interrupted"))
        for text in audit.unasked
    )
    text = "is_complete is not what was left out says"
    expect(audit.is_complete == (not is_cut), text)
    for code in SEVERITIES:
        is_stated = code.startswith("FTD") or code in codes or code in entries
        expect(is_stated, f"{code} is neither answered nor listed as left out")
    for code, text in zip(entries, audit.unasked, strict=True):
        is_left = text.endswith(("left out by the user", "that it applies to"))
        is_both = code in codes and (is_left or ": not run: " in text)
        expect(not is_both, f"{code} is answered, and listed as left out")


def _complete(case: Case, report: Report) -> None:
    """Check that each rule and proposition has an answer, if the code was not cut."""
    entries = {text.split(" ")[0] for text in case.audit.unasked}
    by = {code: case.coded(code) for code in SEVERITIES}
    every = {*case.numbers}
    dead = {one.rules[0] for one in by["FT101"] if one.is_finding and one.rules}
    wanted = {"FT101": every, "FT102": every - dead, "FT103": every}
    if isinstance(case.model, Tree):
        wanted["FT101"] = dead
        wanted["FT205"] = every - dead
        rules_with_entries = {one.rules[0] for one in by["FT102"] if one.rules}
        wanted["FT102"] = {
            n for n in every if n in rules_with_entries or _wins(case, n)
        }
    if len(every) == 1:
        del wanted["FT103"]
    if case.view is not None:
        silent_entries = sorted(one.subject for one in by["FT101"] if not one.rules)
        is_all = silent_entries == sorted(case.view.silent) or not by["FT101"]
        report.expect(is_all, "other rules never fire, as their text says")
        wanted = {"FT101": every}
    for code, numbers in wanted.items():
        result = {one.rules[0] for one in by[code] if one.rules}
        if code == "FT102" and "FT101" in entries:
            continue  # the rules that it is about are not known
        if code not in entries and by[code] and result != numbers:
            report.wrong.append(f"{code} has not one answer for each rule")
    propositions = sum(len(rule.when) for rule in case.rules.rules)
    proposition_answers = sum(_propositions(case, one) for one in by["FT107"])
    is_all = (
        "FT107" in entries or not by["FT107"] or proposition_answers == propositions
    )
    report.expect(is_all, "FT107 has not one answer for each proposition")


def _wins(case: Case, number: int) -> bool:
    """Return whether a rule is known to beat those of other classes somewhere."""
    try:
        mine = case.bits_of(number)
        return case.is_free and case.beats(mine, case.rivals(number))
    except UndecidedError:
        return False


def _propositions(case: Case, answer: Answer) -> float:
    """Return of how many propositions an answer is: one, some more, all of a rule."""
    if not answer.rules:
        return sum(one.value for one in answer.measures)
    is_one = answer.terms or answer.rules[0] not in case.numbers
    return 1 if is_one else len(case.rules.rules[answer.rules[0] - 1].when)


def _ids(case: Case, report: Report) -> None:
    """Check each id: its code and a hash of what the rules and terms say."""
    representations = [c for c in case.representations.values() if isinstance(c, Rules)]
    shapes: dict[tuple[str, str], Shape] = {}
    for one in representations:  # the rules' own terms come last
        shapes |= {(v.name, t.name): t.function for v in one.variables for t in v.terms}
    counts = Counter[str]()
    for number, answer in enumerate(case.audit.answers, 1):
        if any(k not in case.numbers for k in answer.rules):
            continue
        if case.view is not None and (answer.rules or answer.terms):
            text = "ids of findings in systems are not worked out here"
            report.undecided["ID", text].append(answer.code)
            continue
        known = [said(case.rules.rules[k - 1], shapes) for k in answer.rules]
        known += [[*label, shapes.get((label[0], label[1]))] for label in answer.terms]
        other = [] if known else [answer.subject, answer.region]
        content = compact([answer.code, known, other]).encode()
        name = f"{answer.code}-{hashlib.sha256(content).hexdigest()[:8]}"
        counts[name] += 1
        name += f"-{counts[name]}" if counts[name] > 1 else ""
        report.expect(answer.id == name, f"the id of answer {number} is {name}")
