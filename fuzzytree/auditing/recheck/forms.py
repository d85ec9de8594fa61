"""What an answer of each code can say, and in which state: the forms of sentences.

A sentence is read only to hold it against the facts beside it. One of no form below is
not taken for wrong, for words may change; it is reported as not checked.
"""

from __future__ import annotations

import functools
import re
import string
from collections.abc import Mapping
from typing import NamedTuple

from fuzzytree.auditing.recheck.audit_records import Answer, Declined, Sampled
from fuzzytree.auditing.recheck.cases import Case
from fuzzytree.auditing.recheck.model_records import Proposition

TABLE = """
FT101 W -info | {1}
  {1} wins somewhere
FT101 W -info | {1}
  {1} fires
FT101 P +error | {1}
  {1} never <fires on the domain|wins: wherever it fires, a rule of another class is at
  least as strong|fires: no value of the domain makes its condition hold>
FT101 W +warning | {1}
  {1} decides by its place in the list alone: where it is strongest, a rule of another
  class further down is exactly as strong
FT101 P +warning | {1}
  {1} never wins: wherever it fires, a rule of another class is at least as strong;
  whether it decides by its place in the list is open
FT101 P +error | {subject}
  {subject} never fires: {...}
FT101 BD -info | {1}
  it is open whether {1} ever wins
FT101 BD -info | {1}
  it is open whether {1} ever fires
FT101 P -info | leaves
  {live} of {rules} leaves are reached
FT101 P +error | leaf {n1}
  leaf {n1} (rule {n1}) is never reached: {...}
FT101 D -info | {...}
  whether they ever {...} is not known for {_} <rule|rules>: {reason}
FT102 W -info | {1} | largest lead, at least
  {1} leads by {largest lead, at least:.4g} at least somewhere
FT102 B +warning | {1} | largest lead, at least; largest lead, at most
  {1} never leads by {lead:g}: at most by {largest lead, at most:.3g}
FT102 B -info | {1} | largest lead, at least; largest lead, at most
  no lead of {1} above {largest lead, at least:.3g} was found, and one above
  {largest lead, at most:.3g} is excluded
FT102 BD -info | {1}
  how far {1} leads is open, for it is open whether it wins
FT102 D -info | {...}
  how far they lead is not known for {_} <rule|rules>: {reason}
FT103 W -info | {1}
  {1} is somewhere stronger than every other rule
FT103 WBD -info | {1}
  {1} is nowhere stronger than all others, and where it ties with another class it may
  decide by its place
FT103 P +info | {1}
  {1} is superfluous: nowhere is it stronger than all other rules, and without it no
  decision changes[, but where strengths only touch]
FT103 BD -info | {1}
  it is open whether {1} is needed
FT104 P +warning | {1} | rules that subsume it
  {1} is subsumed by {2}: wherever it fires, {2} of the same {noun} is at least as
  strong
FT105 P +error | {1} | rules that mask it
  {1} is never answered: wherever it fires, {2} of class {then2} is <at least as strong
  and stands before it|stronger>
FT104 PD -info | pairs of rules | pairs; * too near to compare; rules that never fire
  no [other ]rule is {shown to be}subsumed, among {pairs:n pair} of one {noun}{why}
FT105 PD -info | pairs of rules | pairs; * too near to compare; rules that never fire
  no [other ]rule is {shown to be}masked, among {pairs:n pair} of two classes{why}
FT106 P +warning | {1} and {2} | largest distance; place of it
  {1} and {2} have [nearly ]the same antecedent and the same {noun} {then1}[; degrees
  differ by at most {largest distance:s}, at {...} = {place of it:s}]
FT106 P +error | {1} and {2} | largest distance; place of it
  {1} and {2} have [nearly ]the same antecedent and contradict each other: {then1} and
  {then2}[; degrees differ by at most {largest distance:s}, at {...} = {place of it:s}]
FT106 P +info | {1} and {2} | largest distance; place of it
  {1} and {2} have [nearly ]the same antecedent and different conclusions: {then1} and
  {then2}[; degrees differ by at most {largest distance:s}, at {...} = {place of it:s}]
FT106 PD -info | pairs of rules | pairs
  no [other ]two rules {have}nearly the same antecedent, among {pairs:n pair}{why}
FT107 W -info | {1}, {proposition}
  {1} needs {proposition}: without it {...} becomes {then1} at some input
FT107 P +info | {1}, {proposition}
  {1} decides the same without {proposition}
FT107 BD -info | {1}, {proposition}
  whether {1} needs {proposition} is open
FT107 P -info | {1}
  {1} never fires, so its propositions are not tested one by one
FT107 P -info | propositions | propositions
  {propositions:d} more <proposition matters: it decides|propositions matter: each
  decides> some input
FT201 W +info | {1} and {2} | highest common level; * at least; * at most
  {1} and {2} conflict: both reach [nearly ]{_} at one input, and say {then1} and
  {then2}
FT201 B -info | {1} and {2} | highest common level at most
  {1} and {2} may conflict, on {then1} and {then2}: no more than
  {highest common level at most:s} is reached by both
FT201 P -info | pairs of rules | pairs that never do; pairs not listed
  {level:s} is never reached together by {pairs that never do:n pair} of rules of
  different {nouns}[; {...}]
FT201 P +info | pairs of rules | pairs that never do; pairs not listed
  {pairs not listed:n more pair} of rules may reach {level:s}, not listed;
  {pairs that never do:n pair} never do[; {...}]
FT202 W +warning | {1} and {2}
  {1} and {2} are equally strong, and the strongest, on more than a surface: the order
  of the rules alone decides there
FT202 PBD -info | pairs of rules | pairs; * that tie; * listed; * left open
  of {pairs:d} pairs of rules of different classes, {pairs that tie:d} tie as the
  strongest on more than a surface
FT203 W +warning | leaf {n1}
  in leaf {n1} the tree answers {then1}, and somewhere there the raw rules answer {...}
FT203 BD -info | leaf {n1}
  whether the raw rules decide differently in leaf {n1} is left open
FT203 P -info | leaves
  in {_} of {rules} leaves the raw rules decide as the tree does
FT203 WB -info | rows | rows that differ already; rows evaluated; * in ranges; row
  of {rows of the audit:d} rows[ ({_} incomplete or outside the domain)]
  {rows that differ already:d} differ already; around {rows evaluated:d}[ of {_}] others
  the nearest disagreement is {distance of the witness, in ranges:p} of each input's
  range from row {row:d}
FT204 WB -info | rows | rows evaluated; * certified radius, in ranges; row
  of {rows of the audit:d} rows[ ({_} incomplete or outside the domain)]
  {rows evaluated:d} different ones [with the smallest margins ]were evaluated: each
  keeps its decision within at least {smallest certified radius, in ranges:p} of each
  input's range, half of them within {median certified radius, in ranges:p}[, {...}]
FT204 WB -info | row[ {_}] | * in ranges
  [the ]{subject} stays {...} within {certified radius, in ranges:p} of each input's
  range[, {...}]; where {...} it is {...}
FT204 D -info | row
  the nearest other decision is not sought
FT204 D -info | rows | rows evaluated
  the nearest other decision is not sought
FT205 W -info | {subject} | share of the domain
  {subject} decides {then1} {...}
FT301 P -info | cover
  some rule fires everywhere on the domain
FT301 BD -info | cover
  it is open whether some rule fires everywhere
FT301 D -info | cover
  whether an input is covered by no rule is not decided
FT301 P -info | cover of {epsilon:g} | strength where it is least, *
  some rule has a strength of at least {epsilon:g} everywhere
FT301 W +warning | cover of {epsilon:g} | strength where it is least, *
  no rule has a strength of {epsilon:g} {...}; where it is least, the strongest rule has
  {strength where it is least, at most:.3g}
FT301 BD -info | cover of {epsilon:g} | strength where it is least, *
  it is open whether some rule reaches {epsilon:g} everywhere
FT301 W +{gap} | gap {_} | *
  no rule fires {...}: the answer is {default}
FT301 D -info | more gaps
  there may be more gaps than the {_} that are listed
FT401 P -info | terms | lowest height
  {_} <term reaches|terms reach> a degree of {level:s} or more
FT401 P +warning | {term1} | height
  {term1} is hardly reached: its largest degree from {_} to {_} is {height:s}, at {_}
FT401 P +error | {term1} | height
  {term1} is empty: its degree is 0 from {_} to {_}
FT401 B +warning | {term1} | height at *
  {term1} is hardly reached: its largest degree from {_} to {_} lies between {_} and {_}
FT402 P -info | terms | smaller excesses and dips
  {_} <term has|terms have> no defect of shape of {_} or more
FT402 P +warning | {term1} | excess; place of the excess
  {term1} is clipped: its polynomial goes {excess:s} {...} between {_} and {_}
FT402 P +warning | {term1} | peaks; depth of the deepest dip; place of the deepest dip
  {term1} has {peaks:d} peaks: between {_} and {_} its degree falls to {_}, at
  {place of the deepest dip:s}
FT402 P +warning | {term1} | largest degree
  {term1} has no point of degree 1: its largest degree anywhere is {largest degree:s}
FT402 P +warning | {term1} | share of its area on the domain
  {term1} lies outside of the domain for the most part:
  {share of its area on the domain:s} of its area is from {_} to {_}
FT403 PB +info | {terms} | shared area by joined area; possibility; crossing*
  {terms} are hard to distinguish: they share {...} of their area[; {...}]
FT403 D -info | {terms}
  {terms} were not compared: {reason}
FT403 P -info | pairs of terms | pairs apart; * not listed; * without area
  {pairs apart:n pair} of terms share less than {overlap:s} of their
  area[; {pairs without area:n pair} have no area on the domain]
FT403 P +info | pairs of terms | pairs apart; * not listed; * without area
  {pairs apart:n pair} of terms share less than {overlap:s} of their
  area; {pairs not listed:n pair} besides those listed share
  more[; {pairs without area:n pair} have no area on the domain]
FT404 P +info | {subject}
  no rule uses {subject}
FT404 P -info | terms and variables | variables in use; terms in use
  rules use {variables in use:n variable} and {terms in use:n term}
FT501 C -info | the rule base | *
  [audited as ]{rules:n rule} with {propositions:n proposition}[, index of Nauck
  {index of Nauck:s}]
FT701 S {hit}info | <rows with a missing value|rows outside the domain>
  on {hits:d} of {rows:d} rows a value is <missing|outside the domain>
FT701 S {hit}info | <uncovered|weak|tied|close> rows
  on {hits:d} of {rows:d} rows {...}
FT701 S -info | <uncovered|weak|tied|close> points
  on {hits:d} of {rows:d} points {...}
FT701 S {idle}info | {1} | rows fired; rows won; rows won rightly
  {1} fires on {rows fired:d} of {_} rows[ and wins {rows won:d}[;
  {rows won rightly:d} of these have its class {then1}]]
FT701 D -info | rows
  what rows say about the rules is not known: {reason}
FT701 D -info | domain
  shares of the domain are not known: {reason}
FT701 D -info | {...}
  the number of {subject} is not known: {reason}
FTD D -info | {subject}
  {subject} is <left out|bounded {...}>: {reason}
"""
"""A form: its code, the first letters of its states, the severity of a
finding (+) or of none (-); the subject; the measures. Then the sentence.

`{_}` stands for any number and `{...}` for any words; all else in braces is a fact. A
format `s` shows four digits, `p` a share in percent, `n pair` a count with its noun.
`[...]` may be missing, `<a|b>` is one of the two, `*` in a measure any words.
"""


class Form(NamedTuple):
    """A form of a sentence."""

    code: str
    states: str
    grade: str
    subject: str
    measures: str
    sentence: str


@functools.cache
def forms() -> tuple[Form, ...]:
    """Return every form."""
    result: list[Form] = []
    for entry in re.split(r"\n(?=FT)", TABLE.strip()):
        head, *lines = entry.split("\n")
        start, subject, *measures = head.split(" | ")
        names = re.escape("; ".join(measures)).replace(r";\ ", "|").replace(r"\*", ".*")
        sentence = " ".join(line.strip() for line in lines)
        code, states, grade = start.split(" ")
        result.append(Form(code, states, grade, subject, names, sentence))
    return tuple(result)


_ANY = {"_": r"[-+0-9.e,]+", "...": r".*"}
_SOME = {
    "have": "(are shown to )?have ",
    "shown to be": "(shown to be )?",
    "why": "(: .+)?",
}
_SIGNS = {"[": "(?:", "]": ")?", "<": "(?:", ">": ")", "|": "|"}
Facts = Mapping[str, float | str]


def _shown(value: float | str, spec: str) -> str:
    """Return a fact as a sentence shows it."""
    if isinstance(value, str):
        return value
    if spec == "s":
        return f"{value:.4g}"
    if spec == "p":
        return f"{100.0 * value:.3g} %"
    if spec[:2] == "n ":
        return f"{value:.0f} {spec[2:]}{'s' * (value != 1)}"
    return f"{value:.0f}" if spec == "d" else format(value, spec)


def _matches(text: str, form: str, facts: Facts | None) -> bool:
    """Return whether a text has a form: with the facts, or with any in their places."""
    result = ""
    for literal, name, spec, _ in string.Formatter().parse(form):
        result += "".join(_SIGNS.get(sign, re.escape(sign)) for sign in literal)
        if name is not None and (name in _ANY or facts is None):
            result += (_ANY | _SOME).get(name, ".+")
        elif name is not None and facts is not None:  # without it, it must be missing
            known = name in facts
            result += re.escape(_shown(facts[name], spec or "")) if known else "(?!)"
    return re.fullmatch(result, text, re.DOTALL) is not None


def proposition_text(proposition: Proposition) -> str:
    """Return a proposition as sentences show it."""
    verb = "is not" if proposition.negated else "is"
    return f"{proposition.variable} {verb} {' or '.join(proposition.terms)}"


def _facts(case: Case, answer: Answer) -> Facts:
    """Return what a sentence about an answer can show."""
    state, count, is_view = answer.state, len(case.numbers), case.view is not None
    dead = sum(one.is_finding for one in case.coded("FT101") if one.rules)
    uncovered = case.rules.semantics.uncovered
    default = "no class" if uncovered is None else repr(uncovered)
    result: dict[str, float | str] = {
        **case.audit.settings._asdict(),
        "subject": answer.subject,
        "rows of the audit": case.audit.rows,
        "rules": count,
        "live": count - dead,
        "noun": "conclusion" if is_view else "class",
        "nouns": "conclusions" if is_view else "classes",
        "default": "what the outputs have by default" if is_view else default,
        "gap": "warning" if uncovered is None else "info",
        **{"shown to be": "", "have": "have ", "why": ""},
    }
    for place, number in enumerate(answer.rules[:2], 1):
        result |= {str(place): case.name(number), f"n{place}": number}
        result[f"then{place}"] = repr(case.then(number))
    for place, label in enumerate(answer.terms[:2], 1):
        result[f"term{place}"] = f"term {label.term!r} of {label.variable!r}"
    if len(answer.terms) == 2:
        one, other = answer.terms
        result["terms"] = f"terms {one.term!r} and {other.term!r} of {one.variable!r}"
    for number in answer.rules[:1]:
        for text in map(proposition_text, propositions_of(case, answer)):
            if answer.subject == f"{case.name(number)}, {text!r}":
                result["proposition"] = repr(text)
    result |= {measure.name: measure.value for measure in answer.measures}
    if isinstance(state, Declined):
        result |= {"reason": state.reason, "why": f": {state.reason}"}
        result |= {"shown to be": "shown to be ", "have": "are shown to have "}
    if isinstance(state, Sampled):
        result |= {"hits": state.hits, "rows": state.rows}
        won = result.get("rows won", result.get("rows fired"))
        result |= {"hit": "+" if state.hits else "-", "idle": "-" if won else "+"}
    return result


def propositions_of(case: Case, answer: Answer) -> list[Proposition]:
    """Return the propositions of a rule that have the terms of an answer."""
    when = case.rules.rules[answer.rules[0] - 1].when
    of = {c: tuple((c.variable, term) for term in c.terms) for c in when}
    return [proposition for proposition, labels in of.items() if labels == answer.terms]


def matches_facts(case: Case, answer: Answer) -> bool | None:
    """Return whether a sentence says what stands beside it; None if nobody can tell."""
    facts, text = _facts(case, answer), answer.sentence
    grade = f"{'+' if answer.is_finding else '-'}{answer.severity}"
    known = [
        form
        for form in forms()
        if form.code in (answer.code, answer.code[:3])
        and _matches(text, form.sentence, None)
    ]
    if not known:
        return None
    return any(
        type(answer.state).__name__[0] in form.states
        and _matches(text, form.sentence, facts)
        and _matches(grade, form.grade, facts)
        and _matches(answer.subject, form.subject, facts)
        and all(re.fullmatch(form.measures, one.name) for one in answer.measures)
        for form in known
    )
