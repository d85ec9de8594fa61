"""The rules of a FIS file: lines of term numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import msgspec

from fuzzytree.formats.fis import fis_text as text
from fuzzytree.formats.fis import fis_words as words
from fuzzytree.formats.fis.fis_text import Entry, Notes
from fuzzytree.formats.fis.fis_words import Dialect
from fuzzytree.model.contracts import Loss
from fuzzytree.model.system import (
    And,
    Conclusion,
    Condition,
    Hedge,
    Is,
    Or,
    SystemInput,
    SystemOutput,
    SystemRule,
)

Variables = tuple[Sequence[SystemInput], Sequence[SystemOutput]]


class _Line(msgspec.Struct, frozen=True):
    """`1 0 -2, 1 (1) : 1` in parts: numbers before and behind the comma, and so on."""

    asked: list[float]
    concluded: list[float]
    weight: float
    connection: float


class _Code(msgspec.Struct, frozen=True):
    """A number of a rule: the place of a term, from 1, and what is done to it."""

    place: int
    hundredths: int
    is_negated: bool


def rules_of(
    lines: Sequence[Entry], variables: Variables, dialect: Dialect, notes: Notes
) -> list[tuple[Entry, SystemRule]]:
    """Return the rules and their lines; what is found is added to the notes.

    A rule whose hedges act on several conclusions becomes one rule for each in Octave's
    dialect, where they act on each alone.
    """
    rules: list[tuple[Entry, SystemRule]] = []
    for number, entry in enumerate(lines, 1):
        line = _line(entry, variables, notes)
        if line is not None:
            made = _rules(line, (number, entry), variables, dialect, notes)
            rules += ((entry, rule) for rule in made)
    return rules


def _line(entry: Entry, variables: Variables, notes: Notes) -> _Line | None:
    before, comma, rest = entry.value.partition(",")
    behind, open_, rest = rest.partition("(")
    weight, close, rest = rest.partition(")")
    colon = rest.strip()[:1]
    if not (comma and open_ and close and colon == ":"):
        what = f"{entry.value.strip()[:60]!r} is no rule, such as 1 2, 1 (1) : 1"
        notes.found.append((entry.line, 1, what))
        return None
    found = len(notes.found)
    places: list[list[float]] = []
    column = 1
    for part in (before, behind, weight, rest.replace(":", " ", 1)):
        places.append(text.numbers_of(part, entry.line, column, notes.found))
        column += len(part) + 1
    if len(notes.found) > found:
        return None
    needed = (len(variables[0]), len(variables[1]), 1, 1)
    names = (
        "before the comma for the inputs",
        "behind the comma for the outputs",
        "in the parentheses as weight",
        "behind the colon: 1 is and, 2 is or",
    )
    for numbers, count, where in zip(places, needed, names, strict=True):
        if len(numbers) != count:
            what = f"{count} numbers stand {where}, not {len(numbers)}"
            notes.found.append((entry.line, 1, what.replace("1 numbers", "1 number")))
    if len(notes.found) > found:
        return None
    (share,), (connection,) = places[2:]
    if not 0.0 <= share <= 1.0:
        what = f"the weight must lie in [0, 1], not {share!r}"
        notes.found.append((entry.line, len(before) + len(behind) + 3, what))
    if connection not in (1.0, 2.0):
        what = f"the last number is 1 (and) or 2 (or), not {connection!r}"
        notes.found.append((entry.line, len(entry.value), what))
    if len(notes.found) > found:
        return None
    return _Line(places[0], places[1], share, connection)


def _rules(
    line: _Line,
    where: tuple[int, Entry],
    variables: Variables,
    dialect: Dialect,
    notes: Notes,
) -> Iterator[SystemRule]:
    number, _ = where
    found = len(notes.found)
    questions = [
        asked
        for variable, code in zip(variables[0], line.asked, strict=True)
        if (asked := _question(variable, code, where, dialect, notes)) is not None
    ]
    conclusions = [
        one
        for output, code in zip(variables[1], line.concluded, strict=True)
        if (one := _conclusion(output, code, where, dialect, notes)) is not None
    ]
    if len(notes.found) > found:
        return
    if not conclusions:
        notes.losses.append(Loss(f"rule {number}", "it concludes nothing; left out"))
        return
    if any(one.label and one.hedges[-1:] == ("any",) for one in questions):
        what = "it asks 'any' (.99) of a term, and fuzzylite does not load it; left out"
        notes.losses.append(Loss(f"rule {number}", what))
        return
    is_or = line.connection == 2.0
    if not questions and (is_or or dialect == "fuzzylite"):
        why = (
            "fuzzylite does not load it" if dialect == "fuzzylite" else "an or of none"
        )
        what = f"it asks nothing and never fires ({why}); left out"
        notes.losses.append(Loss(f"rule {number}", what))
        return
    if not questions and dialect == "octave":
        what = f"rule {number} asks nothing and always fires; Octave cannot run it"
        notes.remarks.append(what)
    when: Condition | None = questions[0] if questions else None
    if len(questions) > 1:
        when = Or(tuple(questions)) if is_or else And(tuple(questions))
    if dialect == "octave" and any(one.hedges for one in conclusions):
        for one in conclusions:
            yield SystemRule(when, (one,), line.weight)
    else:
        yield SystemRule(when, tuple(conclusions), line.weight)


def _code(
    code: float,
    variable: SystemInput | SystemOutput,
    where: tuple[int, Entry],
    notes: Notes,
) -> _Code | None:
    """Return what a number means; None if there is no such term."""
    size = abs(code)
    if not size < len(variable.labels) + 1:  # NaN too
        number, entry = where
        what = (
            f"rule {number}: {variable.name!r} has {len(variable.labels)} terms, "
            f"and no term {size:g}"
        )
        notes.found.append((entry.line, 1, what))
        return None
    place = int(size)
    return _Code(place, round(100.0 * (size - place)), code < 0.0)


def _question(
    variable: SystemInput,
    code: float,
    where: tuple[int, Entry],
    dialect: Dialect,
    notes: Notes,
) -> Is | None:
    """Return what is asked of an input; None if nothing."""
    if code == 0.0:
        return None
    found = _code(code, variable, where, notes)
    if found is None or (not found.place and dialect != "fuzzylite"):
        return None
    hedges = _hedges(words.HEDGES[dialect], found, (variable.name, where), notes)
    if not found.place:
        if hedges[-1:] == ("any",):
            return Is(variable.name, None, hedges)
        what = f"rule {where[0]}: a hedge of no term of {variable.name!r}"
        notes.found.append((where[1].line, 1, what))
        return None
    return Is(variable.name, variable.labels[found.place - 1].name, hedges)


def _conclusion(
    output: SystemOutput,
    code: float,
    where: tuple[int, Entry],
    dialect: Dialect,
    notes: Notes,
) -> Conclusion | None:
    if code == 0.0:
        return None
    found = _code(code, output, where, notes)
    if found is None or not found.place:
        return None
    is_changed = found.is_negated or found.hundredths
    if is_changed and dialect != "fuzzylite" and not output.defuzzifier.is_weighted:
        what = (
            f"rule {where[0]}: a term of {output.name!r} that is negated or hedged; "
            "it must be a term of its own"
        )
        notes.found.append((where[1].line, 1, what))
        return None
    table = words.HEDGES[dialect]
    if dialect == "octave":
        table = words.CONCLUDING_HEDGES
    hedges = _hedges(table, found, (output.name, where), notes)
    return Conclusion(output.name, output.labels[found.place - 1].name, hedges)


def _hedges(
    table: Mapping[int, tuple[Hedge, ...]],
    code: _Code,
    about: tuple[str, tuple[int, Entry]],
    notes: Notes,
) -> tuple[Hedge, ...]:
    """Return what hundredths and a sign do to a degree."""
    found = table.get(code.hundredths)
    if found is None:
        variable, (number, _) = about
        what = f"no hedge is known by .{code.hundredths:02d}; it is left out"
        notes.losses.append(Loss(f"rule {number}, {variable!r}", what))
        found = ()
    return ("not", *found) if code.is_negated else found
