"""What an answer of an audit can say: the messages of `sentences.toml`, rendered."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

Scalar = str | int | float | None
Fact = Scalar | Sequence[Sequence[Scalar]]
"""A text, a number, None for no class, or rows of these."""


class Message(NamedTuple):
    """What an answer can say; the subject is empty if that of answers differs."""

    grade: str
    text: str
    subject: str = ""


MOST_BYTES = 2**20
with Path(__file__).with_name("sentences.toml").open("rb") as _file:
    _TABLE: dict[str, Any] = tomllib.loads(_file.read(MOST_BYTES).decode())
LIMITS: tuple[str, ...] = tuple(_TABLE.pop("limits"))
"""What every audit says that it does not establish, word for word."""
MESSAGES: Mapping[str, Message] = {
    f"{code}.{name}": Message(**entry)
    for code, entries in _TABLE.items()
    for name, entry in entries.items()
}
"""Every message by its name. Of `FTD` the code is that of the answer's state."""

_MOST_SIDES = 3  # of a region in a sentence
_PART = re.compile(r"\[([^\[\]]*)\]")
_FIELD = re.compile(r"\{([^{}:]+)(?::([^{}]*))?\}")


def sentence_of(answer: Any) -> str:
    """Return the sentence of an answer: what its message says of its facts.

    The answer is an audit's own record, or what the re-checker read of it: these share
    no class, but the names of fields. What the subject, the state, the region or a
    measure holds is no fact besides.
    """
    unsaid = answer.facts.keys() - names_in(answer.message)
    if unsaid:
        raise ValueError(f"{answer.message} does not say {min(unsaid)!r}")
    state = answer.state
    of_state = ("reason", "hits", "rows")
    facts = {name: getattr(state, name) for name in of_state if hasattr(state, name)}
    facts |= {m.name: m.value for m in answer.measures}
    region = [
        (o.variable, o.word) if o.word else (o.variable, o.low, o.high)
        for o in answer.region
    ]
    facts |= {"subject": answer.subject, "region": region} | {**answer.facts}
    return render(answer.message, facts)


def names_in(message: str) -> set[str]:
    """Return the names of the facts that a message says."""
    return {field[1] for field in _FIELD.finditer(MESSAGES[message].text)}


def render(message: str, facts: Mapping[str, Fact]) -> str:
    """Return the sentence of a message.

    Example:
        >>> render("FT404.used", {"variables in use": 1, "terms in use": 3})
        'rules use 1 variable and 3 terms'
    """

    def part(match: re.Match[str]) -> str:
        is_whole = all(field[1] in facts for field in _FIELD.finditer(match[1]))
        return match[1] if is_whole else ""

    template = _PART.sub(part, MESSAGES[message].text)
    return _FIELD.sub(lambda field: express(facts[field[1]], field[2] or ""), template)


def express(fact: Fact, how: str) -> str:
    """Return a fact as a sentence shows it.

    `d` is a count, `n term` a count with its noun, `n term has|terms have` with two
    forms; `s` is a number in four digits, `p` a share in percent, and any other letter
    a format of Python. `q` is a name in quotes, or `no class`. Of rows of names and
    numbers, `within` is a region, `above` the half-open box of a leaf, and `at` a
    point. `?` is nothing.

    Example:
        >>> express(2, "n term has|terms have"), express(0.25, "p"), express(None, "q")
        ('2 terms have', '25 %', 'no class')
    """
    match fact, how:
        case _, "?":
            return ""
        case None, "q":
            return "no class"
        case str(), "q":
            return repr(fact)
        case str(), "" | "s":
            return fact
        case ((int() | float()), _) if how != "q":
            return _number(fact, how)
        case ((list() | tuple()), "within"):
            texts = [_side(name, _interval, of) for name, *of in fact[:_MOST_SIDES]]
            texts += ["so on"] * (len(fact) > _MOST_SIDES)
            return _where(texts, "here")
        case ((list() | tuple()), "above"):
            sides = [row for row in fact if [*row[1:]] != [None, None]]
            texts = [_side(name, open_interval, of) for name, *of in sides]
            return _where(texts, "everywhere")
        case ((list() | tuple()), "at"):
            return " and ".join(f"{name!r} is {value}" for name, value in fact)
        case _:
            raise ValueError(f"{fact!r} is not shown as {how!r}")


def _number(fact: float, how: str) -> str:
    if how == "s":
        text = f"{fact:.4g}"
        return "more than 0.9999" if text == "1" and fact < 1 else text
    if how == "p":
        return f"{100.0 * fact:.3g} %"
    if how == "d":
        return f"{fact:.0f}"
    if how.startswith("n "):
        single, _, many = how[2:].partition("|")
        return f"{fact:.0f} {single if fact == 1 else many or single + 's'}"
    return format(fact, how) if how else str(fact)


def _where(texts: Sequence[str], nowhere: str) -> str:
    return f"where {' and '.join(texts)}" if texts else nowhere


def _side(
    name: Scalar, show: Callable[[Scalar, Scalar], str], of: Sequence[Scalar]
) -> str:
    """Return that a variable is in an interval, or is what a word says."""
    return f"{name!r} is {show(*of) if len(of) == 2 else of[0]}"


def _interval(low: Scalar, high: Scalar) -> str:
    """Return an interval; one without a lower or an upper end as such."""
    if low is None or high is None:
        return f"at most {_six(high)}" if low is None else f"at least {_six(low)}"
    if _six(low) == _six(high):
        return f"about {_six(low)}" if low != high else _six(low)
    return f"{_six(low)} to {_six(high)}"


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
