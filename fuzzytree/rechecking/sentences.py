"""What an answer of an audit can say: its messages, and their sentences.

A message has a name that begins with its code, a grade, and a template. The grade is
the severity of a finding, or `note` for what is none; with a `?` behind it the answer
says which of the two it is.

In a template `{name}` stands for a fact, and `{name:how}` for a fact shown in a certain
way; see `shown`. A part in `[...]` is left out if one of its facts is not known; `?`
asks for a fact and shows nothing.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

Scalar = str | int | float | None
Fact = Scalar | Sequence[Sequence[Scalar]]
"""A text, a number, None for no class, or rows of these."""


class Message(NamedTuple):
    """What an answer can say."""

    grade: str
    template: str


TABLE = """
FT101.wins note
  {subject} wins somewhere
FT101.fires note
  {subject} fires
FT101.never-wins error
  {subject} never wins: wherever it fires, a rule of another class is at least as strong
FT101.may-decide-by-place warning
  {subject} never wins: wherever it fires, a rule of another class is at least as
  strong; whether it decides by its place in the list is open
FT101.decides-by-place warning
  {subject} decides by its place in the list alone: where it is strongest, a rule of
  another class further down is exactly as strong
FT101.never-fires error
  {subject} never fires: no value of the domain makes its condition hold
FT101.weight-0 error
  {subject} never fires: its weight is 0
FT101.never-true error
  {subject} never fires: its condition is never true
FT101.open note
  it is open whether {subject} ever wins
FT101.fires-open note
  it is open whether {subject} ever fires
FT101.left-open note
  whether they ever win is not known for {count:n rule}: {reason}
FT101.leaves note
  {live:d} of {leaves:d} leaves are reached
FT101.leaves-declined note
  the regions of the leaves are not looked at
FT101.leaf-excluded error
  {subject} (rule {leaf:d}) is never reached: the nodes for {variable:q} on its path
  exclude each other
FT101.leaf-outside error
  {subject} (rule {leaf:d}) is never reached: its path needs {variable:q} {values}, and
  the domain is {low:.6g} to {high:.6g}
FT101.leaf-unmet error
  {subject} (rule {leaf:d}) is never reached: no input of the domain meets what its path
  needs of {variables}
FT102.leads note
  {subject} leads by {largest lead, at least:.4g} at least somewhere
FT102.marginal warning
  {subject} never leads by {lead:g}: at most by {largest lead, at most:.3g}
FT102.between note
  no lead of {subject} above {largest lead, at least:.3g} was found, and one above
  {largest lead, at most:.3g} is excluded
FT102.open note
  how far {subject} leads is open, for it is open whether it wins
FT102.left-open note
  how far they lead is not known for {count:n rule}: {reason}
FT103.alone note
  {subject} is somewhere stronger than every other rule
FT103.by-place note
  {subject} is nowhere stronger than all others, and where it ties with another class it
  may decide by its place
FT103.superfluous info
  {subject} is superfluous: nowhere is it stronger than all other rules, and without it
  no decision changes[{later:?}, apart from exact ties]
FT103.open note
  it is open whether {subject} is needed
FT103.left-open note
  whether they are needed is not known for {count:n rule}: {reason}
FT104.subsumed warning
  {subject} is subsumed by {by}: wherever it fires, {by} of the same {noun} is at least
  as strong
FT104.others note
  no [{listed:?}other ]rule is [{reason:?}shown to be ]subsumed, among {pairs:n pair} of
  one {noun}[: {reason}]
FT105.masked error
  {subject} is never answered: wherever it fires, {by} of class {then:q} is at least as
  strong and stands before it
FT105.weaker error
  {subject} is never answered: wherever it fires, {by} of class {then:q} is stronger
FT105.others note
  no [{listed:?}other ]rule is [{reason:?}shown to be ]masked, among {pairs:n pair} of
  two classes[: {reason}]
FT106.same warning
  {subject} have [{place of it:?}nearly ]the same antecedent and the same {noun}
  {then:q}[; degrees differ by at most {largest distance:s}, at {variable:q} = {place of
  it:s}]
FT106.contradiction error
  {subject} have [{place of it:?}nearly ]the same antecedent and contradict each other:
  {then:q} and {other:q}[; degrees differ by at most {largest distance:s}, at
  {variable:q} = {place of it:s}]
FT106.different info
  {subject} have [{place of it:?}nearly ]the same antecedent and different conclusions:
  {then:q} and {other:q}[; degrees differ by at most {largest distance:s}, at
  {variable:q} = {place of it:s}]
FT106.others note
  no [{listed:?}other ]two rules [{reason:?}are shown to ]have nearly the same
  antecedent, among {pairs:n pair}[: {reason}]
FT107.needed note
  {rule} needs {proposition:q}: without it {before:q} becomes {then:q} at some input
FT107.irrelevant info
  {rule} decides the same without {proposition:q}
FT107.open note
  whether {rule} needs {proposition:q} is open
FT107.silent note
  {subject} never fires, so its propositions are not tested one by one
FT107.more note
  {propositions:n more proposition matters: it decides|more propositions matter: each
  decides} some input
FT107.left-open note
  whether they are needed is not known for {count:n proposition}: {reason}
FT201.conflict info
  {subject} conflict: both reach [{falls short:?}nearly ]{level:s} at one input, and say
  {then:q} and {other:q}
FT201.may note
  {subject} may conflict, on {then:q} and {other:q}: no more than {highest common level
  at most:s} is reached by both
FT201.never note
  {level:s} is never reached together by {pairs that never do:n pair} of rules of
  different {nouns}
FT201.unlisted info
  {pairs not listed:n more pair} of rules may reach {level:s}, not listed; {pairs that
  never do:n pair} never do
FT202.tie warning
  {subject} are equally strong, and the strongest, on more than a surface: the order of
  the rules alone decides there
FT202.others note
  of {pairs:d} pairs of rules of different classes, {pairs that tie:d} tie as the
  strongest on more than a surface[; {untested:n pair} were not tested]
FT203.leaves-declined note
  the regions of the leaves are not looked at
FT203.differs warning
  in {subject} the tree answers {then:q}, and somewhere there the raw rules answer
  {other:q}
FT203.open note
  whether the raw rules decide differently in {subject} is left open
FT203.leaves note
  in {alike:d} of {leaves:d} leaves the raw rules decide as the tree does
FT203.not-sought note
  of {total:d} rows[ ({incomplete:d} incomplete or outside the domain)] {rows that
  differ already:d} differ already; the nearest disagreement to others is not sought
FT203.none-known note
  of {total:d} rows[ ({incomplete:d} incomplete or outside the domain)] {rows that
  differ already:d} differ already; no disagreement is known around {rows evaluated:d}[
  of {others:d}] others
FT203.nearest note
  of {total:d} rows[ ({incomplete:d} incomplete or outside the domain)] {rows that
  differ already:d} differ already; around {rows evaluated:d}[ of {others:d}] others the
  nearest disagreement is {distance of the witness, in ranges:p} of each input's range
  from row {row:d}
FT203.more-rows note
  {count:n more row is|more rows are} not evaluated
FT204.not-sought note
  the nearest other decision is not sought
FT204.decided note
  the row is decided as {then:q} by {by}
FT204.alike note
  no row of the domain has another class than {name}, {then:q}[{aside:?}, apart from
  exact ties]
FT204.none-known note
  no decision other than {then:q} is known around {name}
FT204.nearest note
  {name} is {then:q}; where {moved:at} it becomes {other:q}, and it stays {then:q} while
  no input changes by more than {certified radius, in ranges:p} of its range[{aside:?},
  apart from exact ties]
FT204.nearest-of-many note
  {name} is {then:q}; where {moved:d} inputs change by up to {distance of the witness,
  in ranges:p} of their ranges it becomes {other:q}, and it stays {then:q} while none
  changes by more than {certified radius, in ranges:p}[{aside:?}, apart from exact ties]
FT204.rows note
  of {total:d} rows[ ({incomplete:d} incomplete or outside the domain)] {rows
  evaluated:d} different ones [{different:?}with the smallest margins ]were evaluated:
  each keeps its decision within at least {smallest certified radius, in ranges:p} of
  each input's range, half of them within {median certified radius, in
  ranges:p}[{aside:?}, apart from exact ties]
FT204.more-rows note
  {count:n more row is|more rows are} not evaluated
FT205.leaves-declined note
  the regions of the leaves are not looked at
FT205.not-listed note
  the regions of the leaves are not listed
FT205.region note
  {subject} decides {then:q} {ends:above}
FT301.not-decided note
  whether an input is covered by no rule is not decided
FT301.fires note
  some rule fires everywhere on the domain
FT301.open note
  it is open whether some rule fires everywhere
FT301.reaches note
  some rule has a strength of at least {epsilon:g} everywhere
FT301.reaches-open note
  it is open whether some rule reaches {epsilon:g} everywhere
FT301.weak warning
  no rule has a strength of {epsilon:g} {region:within}; where it is least, the
  strongest rule has {strength where it is least, at most:.3g}
FT301.gap warning
  no rule fires {region:within}: the answer is no class
FT301.gap-with-class info
  no rule fires {region:within}: the answer is {then:q}
FT301.gap-of-system warning
  no rule fires {region:within}: the answer is what the outputs have by default
FT301.more note
  there may be more gaps than the {count:d} that are listed
FT401.reached note
  {count:n term reaches|terms reach} a degree of {level:s} or more
FT401.low warning
  {subject} is hardly reached: its largest degree from {low:s} to {high:s} is
  {height:s}, at {at:s}
FT401.empty error
  {subject} is empty: its degree is 0 from {low:s} to {high:s}
FT401.low-curve warning
  {subject} is hardly reached: its largest degree from {low:s} to {high:s} lies between
  {height at least:s} and {height at most:s}
FT401.open note
  {subject} may hardly be reached: its largest degree from {low:s} to {high:s} lies
  between {height at least:s} and {height at most:s}
FT402.sound note
  {count:n term has|terms have} no defect of shape of 0.01 or more
FT402.above warning
  {subject} is clipped: its polynomial goes {excess:s} above 1 between {low:s} and
  {high:s}
FT402.below warning
  {subject} is clipped: its polynomial goes {excess:s} below 0 between {low:s} and
  {high:s}
FT402.peaks warning
  {subject} has {peaks:d} peaks: between {low:s} and {high:s} its degree falls to
  {bottom:s}, at {place of the deepest dip:s}
FT402.subnormal warning
  {subject} has no point of degree 1: its largest degree anywhere is {largest degree:s}
FT402.outside warning
  {subject} lies outside of the domain for the most part: {share of its area on the
  domain:s} of its area is from {low:s} to {high:s}
FT403.equal info
  {subject} are hard to distinguish: they share {shared area by joined area:s} of their
  area; they are equal
FT403.within info
  {subject} are hard to distinguish: they share {shared area by joined area:s} of their
  area; {inner:q} is nowhere above {outer:q}
FT403.similar info
  {subject} are hard to distinguish: they share {shared area by joined area:s} of their
  area[; they cross at {crossing:s} with degree {crossing height:s}]
FT403.declined note
  {subject} were not compared: {reason}
FT403.others note
  {pairs apart:n pair} of terms share less than {overlap:s} of their area[; {more:n
  pair} besides those listed share more][; {points:n pair} have no area on the domain]
FT403.unlisted info
  {pairs apart:n pair} of terms share less than {overlap:s} of their area[; {more:n
  pair} besides those listed share more][; {points:n pair} have no area on the domain]
FT404.unused info
  no rule uses {subject}
FT404.used note
  rules use {variables in use:n variable} and {terms in use:n term}
FT501.size note
  {rules:n rule} with {propositions:n proposition}[, index of Nauck {index
  of Nauck:s}]
FT501.size-of-view note
  audited as {rules:n rule} with {propositions:n proposition}[, index of Nauck {index
  of Nauck:s}]
FT601.alike note
  {count:n representation gives|representations give} the same answers on up to {rows:d}
  rows
FT601.alike-by-calls note
  {count:n representation gives|representations give} the same answers in other calls
FT601.equal note
  {count:n representation is|representations are} equal on every input
FT601.disagrees error
  {subject} disagrees with {against} in {rows that differ:d} of {rows:d} {noun}[:
  {detail}]
FT601.not-compared note
  {subject} is not compared: {reason}
FT601.exceeds error
  {subject} errs by more than its certified bound: {detail}
FT601.certified note
  {subject}: {bound}
FT601.band note
  {representation}: the class is open on {hits:d} of {rows:d} {noun}
FT602.alike note
  {subject}: {count:d} representations give the same answers to {probes:d} generated
  rows
FT602.none note
  {subject}: no generated row shows it
FT602.differs error
  {convention}: {representation} differs in {count:d} of {probes:d} generated rows:
  {detail}
FT701.missing info?
  on {hits:d} of {rows:d} rows a value is missing
FT701.outside info?
  on {hits:d} of {rows:d} rows a value is outside the domain
FT701.uncovered info?
  on {hits:d} of {rows:d} {noun} no rule fires
FT701.weak info?
  on {hits:d} of {rows:d} {noun} no rule reaches {epsilon:g}
FT701.tied info?
  on {hits:d} of {rows:d} {noun} rules of two classes tie
FT701.close info?
  on {hits:d} of {rows:d} {noun} the two strongest classes are at most {margin:g} apart
FT701.rule info?
  {subject} fires on {rows fired:d} of {known:d} rows[ and wins {rows won:d}][; {rows
  won rightly:d} of these have its class {then:q}]
FT701.rule-open note
  on how many rows {subject} fires is not decided: {reason}
FT701.not-known note
  the number of {subject} is not known: {reason}
FT701.needs-rows note
  what rows say about the rules is not known: {reason}
FT701.no-points note
  shares of the domain are not known: {reason}
FT801.alike note
  both models decide alike{where}
FT801.margin note
  no decision was seen to differ, and where both margins are larger than {margin:.3g}
  none does
FT801.rows error?
  {hits:d} of [{total:?}the first ]{rows:d}[ of {total:d}] rows of {table} are
  classified differently
FT801.domain info?
  {hits:d} of {rows:d} points drawn from the domain are classified differently
FT801.not-compared note
  {points} were not compared: {reason}
FT801.differs error
  [{row}: ]the old model answers {old}, the new one {new}
FT801.more info
  {count:n more pair of classes is|more pairs of classes are} answered one for the other
FT801.numbers-alike note
  both systems compute alike{where}
FT801.output-alike note
  both systems compute {subject:q} alike{where}
FT801.outputs error?
  an output differs on {hits:d} of {rows:d} {from}[{rounding:?}, but for rounding]
FT801.output-differs error
  {subject:q} is {now}, and was {was}, {how}
FT801.bound note
  {output:q} differs by at most {most:.6g} where both answer a number
FT801.no-bound note
  how far {output:q} can differ at most is not known: {reason}
FT901.refuted error
  {subject}: the proof of {code} is refuted: {detail}
FTD.left-out note
  {subject} is left out: {reason}
FTD.bounded note
  {subject} is bounded by two lines[ {apart:.2g} apart] at most: {reason}
"""
"""For each message its name and grade, and then the template."""


def _messages() -> Iterator[tuple[str, Message]]:
    for entry in re.split(r"\n(?=FT)", TABLE.strip()):
        head, *lines = entry.split("\n")
        name, _, grade = head.partition(" ")
        yield name, Message(grade, " ".join(line.strip() for line in lines))


MESSAGES: Mapping[str, Message] = dict(_messages())
"""Every message by its name. Of `FTD` the code is that of the answer's state."""

_MOST_SIDES = 3  # of a region in a sentence
_PART = re.compile(r"\[([^\[\]]*)\]")
_FIELD = re.compile(r"\{([^{}:]+)(?::([^{}]*))?\}")


def sentence_of(answer: Any) -> str:
    """Return the sentence of an answer: what its message says of its facts.

    The answer is an audit's own record, or what the re-checker read of it: these share
    no class, but the names of fields. What the subject, the state, the region or a
    measure holds is no fact besides.

    Raises:
        KeyError: As `rendered`.
        ValueError: As `rendered`, and if the message does not say one of the facts.
    """
    unsaid = answer.facts.keys() - names_in(answer.message)
    if unsaid:
        raise ValueError(f"{answer.message} does not say {min(unsaid)!r}")
    state = answer.state
    of_state = ("reason", "hits", "rows")
    facts = {name: getattr(state, name) for name in of_state if hasattr(state, name)}
    facts |= {one.name: one.value for one in answer.measures}
    region = [
        (one.variable, one.word) if one.word else (one.variable, one.low, one.high)
        for one in answer.region
    ]
    facts |= {"subject": answer.subject, "region": region} | {**answer.facts}
    return rendered(answer.message, facts)


def names_in(message: str) -> set[str]:
    """Return the names of the facts that a message says.

    Raises:
        KeyError: If there is no such message.
    """
    return {one[1] for one in _FIELD.finditer(MESSAGES[message].template)}


def rendered(message: str, facts: Mapping[str, Fact]) -> str:
    """Return the sentence of a message.

    Raises:
        KeyError: If there is no such message, or a fact is missing.
        ValueError: If a fact is not of the kind that the template shows.

    Example:
        >>> rendered("FT404.used", {"variables in use": 1, "terms in use": 3})
        'rules use 1 variable and 3 terms'
    """
    template = _PART.sub(
        lambda part: (
            part[1] if all(one[1] in facts for one in _FIELD.finditer(part[1])) else ""
        ),
        MESSAGES[message].template,
    )
    return _FIELD.sub(lambda one: shown(facts[one[1]], one[2] or ""), template)


def shown(fact: Fact, how: str) -> str:
    """Return a fact as a sentence shows it.

    `d` is a count, `n term` a count with its noun, `n term has|terms have` with two
    forms; `s` is a number in four digits, `p` a share in percent, and any other letter
    a format of Python. `q` is a name in quotes, or `no class`. Of rows of names and
    numbers, `within` is a region, `above` the half-open box of a leaf, and `at` a
    point. `?` is nothing.

    Raises:
        ValueError: If the fact is not of this kind.

    Example:
        >>> shown(2, "n term has|terms have"), shown(0.25, "p"), shown(None, "q")
        ('2 terms have', '25 %', 'no class')
    """
    if how == "?":
        return ""
    if fact is None and how == "q":
        return "no class"
    if isinstance(fact, str) and how in ("", "q", "s"):
        return repr(fact) if how == "q" else fact
    if isinstance(fact, str) or fact is None or how == "q":
        raise ValueError(f"{fact!r} is not shown as {how!r}")
    if isinstance(fact, int | float):
        return _number(fact, how)
    if how not in _ROWS:
        raise ValueError(f"rows are not shown as {how!r}")
    return _ROWS[how](fact)


def _number(fact: float, how: str) -> str:
    if how == "s":
        text = f"{fact:.4g}"
        return "more than 0.9999" if text == "1" and fact < 1 else text
    if how == "p":
        return f"{100.0 * fact:.3g} %"
    if how == "d":
        return f"{fact:.0f}"
    if how.startswith("n "):
        one, _, many = how[2:].partition("|")
        return f"{fact:.0f} {one if fact == 1 else many or one + 's'}"
    return format(fact, how) if how else str(fact)


Rows = Sequence[Sequence[Scalar]]


def _within(region: Rows) -> str:
    texts = [
        f"{name!r} is {_side(_stretch, *of)}" for name, *of in region[:_MOST_SIDES]
    ]
    texts += ["so on"] * (len(region) > _MOST_SIDES)
    return f"where {' and '.join(texts)}" if texts else "here"


def _side(show: Callable[[Scalar, Scalar], str], *of: Scalar) -> str:
    """Return an interval, or a word for it."""
    if len(of) == 2:
        return show(*of)
    (word,) = of
    return str(word)


def _stretch(low: Scalar, high: Scalar) -> str:
    """Return an interval; one without a lower or an upper end as such."""
    if low is None or high is None:
        return f"at most {_six(high)}" if low is None else f"at least {_six(low)}"
    if _six(low) == _six(high):
        return f"about {_six(low)}" if low != high else _six(low)
    return f"{_six(low)} to {_six(high)}"


def _above(box: Rows) -> str:
    texts = [
        f"{name!r} is {_side(open_interval, *of)}"
        for name, *of in box
        if of != [None, None]
    ]
    return f"where {' and '.join(texts)}" if texts else "everywhere"


def open_interval(low: Scalar, high: Scalar) -> str:
    """Return an interval without its lower end, as people read it.

    Example:
        >>> open_interval(1.0, 2.0), open_interval(None, None)
        ('above 1 and at most 2', 'any value')
    """
    above = [] if low is None else [f"above {_six(low)}"]
    below = [] if high is None else [f"at most {_six(high)}"]
    return " and ".join([*above, *below]) or "any value"


def _six(number: Scalar) -> str:
    if not isinstance(number, int | float):
        raise ValueError(f"{number!r} is no number")
    return f"{number:.6g}"


def _at(point: Rows) -> str:
    return " and ".join(f"{name!r} is {value}" for name, value in point)


_ROWS = {"within": _within, "above": _above, "at": _at}
