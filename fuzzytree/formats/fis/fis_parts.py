"""The terms of a FIS variable, and rules: lines of term numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import msgspec

from fuzzytree.formats.fis import fis_text as text
from fuzzytree.formats.fis import fis_words as words
from fuzzytree.formats.fis.fis_text import FisEntry
from fuzzytree.formats.fis.fis_words import Dialect
from fuzzytree.formats.formulas import FormulaError, parse
from fuzzytree.formats.text_files import ReaderNotes
from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Curve,
    Formula,
    Hedge,
    Is,
    Linear,
    Number,
    Or,
    SigmoidDifference,
    Singleton,
    SystemInput,
    SystemOutput,
    SystemRule,
    SystemTerm,
    curve_mistakes,
    name_choice,
    numbered,
)

About = tuple[str, Dialect, tuple[bool, int] | None]
"""The variable's name and the dialect; of an output also whether numbers are weighted
and how many inputs there are."""


_WRONG = Formula(Number(0.0))
"""Stands for a curve with a mistake, so that rules find their terms."""


def labels_of(
    entries: Sequence[FisEntry],
    count: FisEntry | None,
    about: About,
    notes: ReaderNotes,
) -> tuple[SystemTerm, ...]:
    """Return the terms of a variable in the order of their numbers."""
    numbered = {int(entry.key[2:]): entry for entry in reversed(entries)}
    if len(numbered) < len(entries):
        twice = next(e for e in entries if numbered[int(e.key[2:])] is not e)
        notes.mistake((twice.line, 1), f"{twice.key} stands twice")
    for place, number in enumerate(sorted(numbered), 1):
        if place != number:
            what = f"MF{place} is missing before MF{number}"
            notes.mistake((numbered[number].line, 1), what)
            break
    if count is not None and count.value.split("%")[0].strip() != str(len(entries)):
        what = f"NumMFs says {count.value[:20]}, and there are {len(entries)}"
        if about[1] == "fuzzylite":
            notes.remark(f"{about[0]!r}: {what}: fuzzylite reads them all")
        else:
            notes.mistake((count.line, count.column), what)
    labels: list[SystemTerm] = []
    taken: dict[str, int] = {}
    for number in sorted(numbered):
        labels.append(_label(numbered[number], about, taken, notes))
    return tuple(labels)


def _label(
    entry: FisEntry, about: About, taken: dict[str, int], notes: ReaderNotes
) -> SystemTerm:
    written = text.term_of(entry, notes.mistakes)
    if written is None:
        return SystemTerm(entry.key, _WRONG)
    name = written.name or entry.key
    result = numbered(name, taken)
    if result != written.name:
        what = f"term {entry.key} of {about[0]!r} is called {written.name!r}"
        notes.remark(f"{what}; here it is {result!r}")
    curve = _curve(written, entry, about, notes)
    return SystemTerm(result, _WRONG if curve is None else curve)


def _curve(
    written: text.FisTerm, entry: FisEntry, about: About, notes: ReaderNotes
) -> Curve | None:
    kind = written.kind
    place = (entry.line, written.column)
    if kind == "function":
        return _formula(written, place, notes)
    if kind not in words.KINDS and kind not in words.OTHER_KINDS:
        known = [*words.KINDS, *words.OTHER_KINDS]
        what = f"no kind of curve {kind[:40]!r}; {name_choice(kind[:40], known)}"
        notes.mistake(entry.position, what)
        return None
    mistake_count = len(notes.mistakes)
    numbers = text.numbers_of(written.inside, *place, notes.mistakes)
    if len(notes.mistakes) > mistake_count:
        return None
    if kind in ("constant", "linear"):
        result = _conclusion_number(kind, numbers, about, notes)
    else:
        result = words.curve_of(kind, numbers)
        if about[2] is not None and about[2][0] and about[1] != "fuzzylite":
            result = f"a Sugeno system concludes constant and linear, not {kind!r}"
    if isinstance(result, str):
        notes.mistake(place, result)
        return None
    if isinstance(result, SigmoidDifference) and about[1] != "fuzzylite":
        notes.remark(
            f"term {written.name!r} of {about[0]!r}: where the second sigmoid is above "
            "the first, MATLAB takes their distance, as here, and Octave 0"
        )
    return result


def _conclusion_number(
    kind: str, numbers: Sequence[float], about: About, notes: ReaderNotes
) -> Curve | str:
    """Return what a `constant` or `linear` concludes."""
    name, dialect, output = about
    if kind == "constant" and len(numbers) != 1:
        return f"a 'constant' has 1 number, not {len(numbers)}"
    curve: Curve
    if output is not None and output[0]:
        inputs = output[1]
        if kind == "constant" or len(numbers) == 1:
            curve = Singleton(numbers[0])
        elif len(numbers) != inputs + 1:
            return (
                f"a 'linear' has a number for each of {inputs} inputs and one more, "
                f"not {len(numbers)}"
            )
        else:
            curve = Linear(tuple(numbers[:-1]), numbers[-1])
        return next(curve_mistakes(curve), curve)
    if dialect != "fuzzylite" or kind == "linear":
        return f"a {kind!r} belongs to the outputs of a Sugeno system"
    notes.remark(
        f"{name!r}: a 'constant' that is looked at as a curve has the same degree "
        "everywhere, as in fuzzylite"
    )
    return Formula(Number(numbers[0]))


def _formula(
    written: text.FisTerm, place: tuple[int, int], notes: ReaderNotes
) -> Curve | None:
    try:
        curve = Formula(parse(written.inside))
    except FormulaError as error:
        notes.mistake((place[0], place[1] + error.column - 1), error.sentence)
        return None
    for mistake in curve_mistakes(curve):
        notes.mistake(place, mistake)
    return curve


Variables = tuple[Sequence[SystemInput], Sequence[SystemOutput]]


class _Line(msgspec.Struct, frozen=True):
    """`1 0 -2, 1 (1) : 1` in parts: numbers before and behind the comma, and so on."""

    antecedent: list[float]
    concluded: list[float]
    weight: float
    connection: float


class _Code(msgspec.Struct, frozen=True):
    """A number of a rule: the place of a term, from 1, and what is done to it."""

    place: int
    hundredths: int
    is_negated: bool


def rules_of(
    lines: Sequence[FisEntry],
    variables: Variables,
    dialect: Dialect,
    notes: ReaderNotes,
) -> list[tuple[FisEntry, SystemRule]]:
    """Return the rules and their lines; what is found is added to the notes.

    A rule whose hedges act on several conclusions becomes one rule for each in Octave's
    dialect, where they act on each alone.
    """
    rules: list[tuple[FisEntry, SystemRule]] = []
    for number, entry in enumerate(lines, 1):
        line = _line(entry, variables, notes)
        if line is not None:
            result = _rules(line, (number, entry), variables, dialect, notes)
            rules += ((entry, rule) for rule in result)
    return rules


def _line(entry: FisEntry, variables: Variables, notes: ReaderNotes) -> _Line | None:
    before, comma, rest = entry.value.partition(",")
    behind, open_, rest = rest.partition("(")
    weight, close, rest = rest.partition(")")
    colon = rest.strip()[:1]
    if not (comma and open_ and close and colon == ":"):
        what = f"{entry.value.strip()[:60]!r} is no rule, such as 1 2, 1 (1) : 1"
        notes.mistake((entry.line, 1), what)
        return None
    mistake_count = len(notes.mistakes)
    places: list[list[float]] = []
    column = 1
    for part in (before, behind, weight, rest.replace(":", " ", 1)):
        places.append(text.numbers_of(part, entry.line, column, notes.mistakes))
        column += len(part) + 1
    if len(notes.mistakes) > mistake_count:
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
            notes.mistake((entry.line, 1), what.replace("1 numbers", "1 number"))
    if len(notes.mistakes) > mistake_count:
        return None
    (share,), (connection,) = places[2:]
    if not 0.0 <= share <= 1.0:
        what = f"the weight must lie in [0, 1], not {share!r}"
        notes.mistake((entry.line, len(before) + len(behind) + 3), what)
    if connection not in (1.0, 2.0):
        what = f"the last number is 1 (and) or 2 (or), not {connection!r}"
        notes.mistake((entry.line, len(entry.value)), what)
    if len(notes.mistakes) > mistake_count:
        return None
    return _Line(places[0], places[1], share, connection)


def _rules(
    line: _Line,
    where: tuple[int, FisEntry],
    variables: Variables,
    dialect: Dialect,
    notes: ReaderNotes,
) -> Iterator[SystemRule]:
    number, _ = where
    mistake_count = len(notes.mistakes)
    questions = [
        proposition
        for variable, code in zip(variables[0], line.antecedent, strict=True)
        if (proposition := _question(variable, code, where, dialect, notes)) is not None
    ]
    conclusions = [
        one
        for output, code in zip(variables[1], line.concluded, strict=True)
        if (one := _conclusion(output, code, where, dialect, notes)) is not None
    ]
    if len(notes.mistakes) > mistake_count:
        return
    if not conclusions:
        notes.loss(f"rule {number}", "it concludes nothing; left out")
        return
    if any(one.label and one.hedges[-1:] == ("any",) for one in questions):
        what = (
            "it uses 'any' (.99) with a term, which fuzzylite does not load; left out"
        )
        notes.loss(f"rule {number}", what)
        return
    is_or = line.connection == 2.0
    if not questions and (is_or or dialect == "fuzzylite"):
        why = (
            "fuzzylite does not load it" if dialect == "fuzzylite" else "an or of none"
        )
        what = f"its antecedent is empty and it never fires ({why}); left out"
        notes.loss(f"rule {number}", what)
        return
    if not questions and dialect == "octave":
        what = f"rule {number} has no antecedent and always fires; Octave cannot run it"
        notes.remark(what)
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
    where: tuple[int, FisEntry],
    notes: ReaderNotes,
) -> _Code | None:
    """Return what a number means; None if there is no such term."""
    size = abs(code)
    if not size < len(variable.labels) + 1:  # NaN too
        number, entry = where
        what = (
            f"rule {number}: {variable.name!r} has {len(variable.labels)} terms, "
            f"and no term {size:g}"
        )
        notes.mistake((entry.line, 1), what)
        return None
    place = int(size)
    return _Code(place, round(100.0 * (size - place)), code < 0.0)


def _question(
    variable: SystemInput,
    code: float,
    where: tuple[int, FisEntry],
    dialect: Dialect,
    notes: ReaderNotes,
) -> Is | None:
    """Return the proposition on an input; None if there is none."""
    if code == 0.0:
        return None
    result = _code(code, variable, where, notes)
    if result is None or (not result.place and dialect != "fuzzylite"):
        return None
    hedges = _hedges(words.FIS_HEDGES[dialect], result, (variable.name, where), notes)
    if not result.place:
        if hedges[-1:] == ("any",):
            return Is(variable.name, None, hedges)
        what = f"rule {where[0]}: a hedge of no term of {variable.name!r}"
        notes.mistake((where[1].line, 1), what)
        return None
    return Is(variable.name, variable.labels[result.place - 1].name, hedges)


def _conclusion(
    output: SystemOutput,
    code: float,
    where: tuple[int, FisEntry],
    dialect: Dialect,
    notes: ReaderNotes,
) -> Conclusion | None:
    if code == 0.0:
        return None
    result = _code(code, output, where, notes)
    if result is None or not result.place:
        return None
    is_changed = result.is_negated or result.hundredths
    if is_changed and dialect != "fuzzylite" and not output.defuzzifier.is_weighted:
        what = (
            f"rule {where[0]}: a term of {output.name!r} that is negated or hedged; "
            "it must be a term of its own"
        )
        notes.mistake((where[1].line, 1), what)
        return None
    table = words.FIS_HEDGES[dialect]
    if dialect == "octave":
        table = words.CONCLUDING_HEDGES
    hedges = _hedges(table, result, (output.name, where), notes)
    return Conclusion(output.name, output.labels[result.place - 1].name, hedges)


def _hedges(
    table: Mapping[int, tuple[Hedge, ...]],
    code: _Code,
    about: tuple[str, tuple[int, FisEntry]],
    notes: ReaderNotes,
) -> tuple[Hedge, ...]:
    """Return what hundredths and a sign do to a degree."""
    result = table.get(code.hundredths)
    if result is None:
        variable, (number, _) = about
        what = f"no hedge is known by .{code.hundredths:02d}; it is left out"
        notes.loss(f"rule {number}, {variable!r}", what)
        result = ()
    return ("not", *result) if code.is_negated else result
