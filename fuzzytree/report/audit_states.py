"""How an answer is known, in words."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import msgspec

from fuzzytree.auditing import (
    CODES,
    Audit,
    AuditAnswer,
    Bracket,
    Claim,
    Computed,
    Declined,
    Proved,
    Sampled,
    Severity,
    State,
    VerbResult,
    Witness,
)
from fuzzytree.report.text import counted, number

_SOME = 4  # inputs of a witness that a table has room for

STATES: dict[str, str] = {
    "PROVED": "holds on all of the domain",
    "COMPUTED": "was worked out or compared, and not decided again",
    "WITNESS": "happens: a point is shown",
    "BRACKET": "lies between two bounds",
    "SAMPLED": "was counted in rows",
    "DECLINED": "was not decided",
}
"""Every state, with what it means."""

SEVERITIES: dict[Severity, str] = {
    "error": "error",
    "warning": "warning",
    "info": "note",
}
"""What a reader calls each severity, the gravest first."""


def state_word(state: State) -> str:
    """Return the name of a state.

    Example:
        >>> state_word(Proved("all of it"))
        'PROVED'
    """
    return str(type(state).__struct_config__.tag)


def state_note(state: State) -> str:
    """Return how an answer is known in a line: what a table has room for."""
    match state:
        case Witness(point=point):
            shown = ", ".join(
                f"{one.input} = {one.word or one.decimal}" for one in point[:_SOME]
            )
            more = len(point) - _SOME
            return f"at {shown}{f' and {more} more' if more > 0 else ''}"
        case Bracket(of=of, low=low, high=high):
            return f"{of}: {number(low)} to {number(high)}"
        case _:
            return state_text(state, has_title=True)


def sampled_text(state: Sampled) -> str:
    """Return a counted share in words.

    Example:
        >>> sampled_text(Sampled("rows that tie", 1, 50, 0.0035, 0.105, 0.95, "drawn"))
        'rows that tie: 1 of 50 rows, 2 % (95 % sure: 0.35 to 10.5 %); drawn'
    """
    share = f"{percent(state.hits / state.rows)} %" if state.rows else "no rows"
    sure = f"{percent(state.confidence)} % sure"
    ends = f"{percent(state.low)} to {percent(state.high)} %"
    return (
        f"{state.of}: {state.hits} of {counted(state.rows, 'row')}, {share} "
        f"({sure}: {ends}); {state.how}"
    )


def percent(share: float) -> str:
    """Return a share in percent, three digits."""
    return f"{100.0 * share:.3g}"


def claims_text(claims: Sequence[Claim]) -> str:
    """Return claims in words."""
    return "; ".join(map(claim_text, claims))


def claim_text(claim: Claim) -> str:
    """Return a claim in words.

    Example:
        >>> claim_text(Claim("beats", rules=(3,), rivals=(1, 2)))
        'rule 3 is stronger than rules 1, 2'
        >>> claim_text(Claim("decides", of="tree", label="firm"))
        "the tree decides for 'firm'"
    """
    mine, theirs = _rules(claim.rules), _rules(claim.rivals)
    is_, level = "is" if len(claim.rules) == 1 else "are", _level(claim.level)
    of = "" if claim.of == "rules" else f" of the {claim.of}"
    match claim.kind:
        case "strength":
            return f"{mine}{of} fires with strength {level}"
        case "beats":
            after = f" than {theirs}" if claim.rivals else " than any other"
            return f"{mine}{of} {is_} stronger{after}"
        case "ties":
            above = f", and stronger than {theirs}" if claim.rivals else ""
            return f"{mine}{of} are equally strong{above}"
        case "below":
            if claim.level == "0":
                return f"{mine}{of} {'does' if is_ == 'is' else 'do'} not fire"
            return f"{mine}{of} {is_} below {level}"
        case "reaches":
            verb = "fires" if is_ == "is" else "fire"
            return f"{mine}{of} {verb} with strength {level} or more"
        case "decides":
            named = "no class" if claim.label is None else repr(claim.label)
            verb = "decide" if claim.of in ("rules", "raw rules") else "decides"
            return f"the {claim.of} {verb} for {named}"
        case "degree":
            return f"{claim.variable!r} is {claim.term!r} to the degree {level}"
        case "covered":
            return f"some rule{of} fires"


def _rules(numbers: Sequence[int]) -> str:
    if not numbers:
        return "no rule"
    shown = ", ".join(map(str, numbers[:12]))
    more = len(numbers) - 12
    shown += f" and {more} more" if more > 0 else ""
    return f"rule {shown}" if len(numbers) == 1 else f"rules {shown}"


def _level(level: str | None) -> str:
    """Return a number `p/q` as a decimal; "about" says that it is rounded."""
    if level is None:
        return "?"
    try:
        exact = Fraction(level)
        shown = number(float(exact))
        return shown if Fraction(shown) == exact else f"about {shown}"
    except (ValueError, ZeroDivisionError, OverflowError):
        return level


def gravest_first(findings: Sequence[AuditAnswer]) -> list[AuditAnswer]:
    """Return findings by severity, then by code, else in their order."""
    order = [*SEVERITIES]
    return sorted(findings, key=lambda one: (order.index(one.severity), one.code))


def known_as(answers: Sequence[AuditAnswer]) -> dict[str, int]:
    """Return how many answers have each state, in the order of `STATES`."""
    counts = dict.fromkeys(STATES, 0)
    for answer in answers:
        counts[state_word(answer.state)] += 1
    return counts


def as_in_file(audit: Audit) -> Audit:
    """Return an audit whose claims call rules by their numbers in the file."""
    if not audit.numbers:
        return audit
    answers = [
        msgspec.structs.replace(
            one,
            state=msgspec.structs.replace(
                one.state,
                claims=tuple(
                    _claim_in_file(claim, audit.numbers) for claim in one.state.claims
                ),
            ),
        )
        if isinstance(one.state, Witness | Bracket)
        else one
        for one in audit.answers
    ]
    return msgspec.structs.replace(audit, answers=tuple(answers))


def _claim_in_file(claim: Claim, numbers: Sequence[int]) -> Claim:
    """Return a claim by the numbers in the file; two ways of one rule are one."""
    rules, rivals = (
        tuple(dict.fromkeys(numbers[n - 1] for n in numbered))
        for numbered in (claim.rules, claim.rivals)
    )
    return msgspec.structs.replace(claim, rules=rules, rivals=rivals)


def state_text(state: State, *, has_title: bool = False) -> str:
    """Return how an answer is known, in words; with a title, that of its code, too.

    Example:
        >>> state_text(Bracket("the largest lead", 0.1, 0.2, "the budget is spent"))
        'the largest lead lies between 0.1 and 0.2; the budget is spent'
    """
    match state:
        case Proved(how=how) | Computed(how=how):
            return how
        case Witness(claims=claims):
            return claims_text(claims) or "it happens here"
        case Bracket(of=of, low=low, high=high, why=why):
            return f"{of} lies between {number(low)} and {number(high)}; {why}"
        case Sampled():
            return sampled_text(state)
        case Declined(code=code, reason=reason):
            title = CODES[code].title if code in CODES else "declined"
            after = f", {title.removeprefix('declined: ')}" if has_title else ""
            return f"{code}{after}: {reason}"


def result_text(result: VerbResult) -> str:
    """Return what another verb found, in words.

    Example:
        >>> from fuzzytree.auditing.findings.records import SourceFile
        >>> result_text(VerbResult("stability", SourceFile("s.json", ""), 10, 1))
        '1 of 10 criteria fails'
    """
    what, wrong = ("comparisons and bounds", "disagree")
    if result.verb == "stability":
        what, wrong = ("criteria", "fail")
    if not result.wrong:
        return f"none of {result.parts} {what} {wrong}s"
    verb = f"{wrong}s" if result.wrong == 1 else wrong
    return f"{result.wrong} of {result.parts} {what} {verb}"
