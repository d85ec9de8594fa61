"""FIS text as sections of keys and values, their terms, and rules of term numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import msgspec

from fuzzytree.errors import ReadError
from fuzzytree.formats.fis import fis_words as words
from fuzzytree.formats.fis.fis_words import Dialect
from fuzzytree.formats.formulas import FormulaError, parse
from fuzzytree.formats.text_files import (
    LONGEST_NAME,
    FileMistake,
    Position,
    PositionGroup,
    Positions,
    ReaderNotes,
    check_characters,
    decoded,
    number_of,
    positions_of,
    split_lines,
)
from fuzzytree.model import (
    And,
    Conclusion,
    Curve,
    Formula,
    Hedge,
    Linear,
    Number,
    Or,
    Proposition,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
    combined,
    name_choice,
    numbered,
)

MOST_BYTES: Final = 4 * 2**20
MOST_LINES: Final = 60_000

TERM: Final = re.compile(r"MF([0-9]{1,6})")
"""The key of a term."""

_FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_NUMBERED = re.compile(r"(input|output)\s*([0-9]{1,6})")
_TOKEN = re.compile(r"[^\s,;]+")


class FisEntry(msgspec.Struct, frozen=True):
    """A key and its value; line and column of the value, from 1."""

    key: str
    value: str
    line: int
    column: int

    @property
    def position(self) -> Position:
        """Where the value stands."""
        return self.line, self.column


class FisSection(msgspec.Struct, frozen=True):
    """A section: `system`, `rules`, or a numbered `input` or `output`."""

    kind: str
    number: int
    line: int
    entries: list[FisEntry]


class FisFile(msgspec.Struct, frozen=True):
    """A file: its sections in their order, and the lines of comments between them."""

    sections: tuple[FisSection, ...]
    comments: dict[str, int]


def read_page(content: bytes, name: str, notes: ReaderNotes) -> FisFile:
    """Return the sections of a file.

    Raises:
        ReadError: If it is too large.
    """
    text, remarks = decoded(content, name, MOST_BYTES, reads_utf16=True)
    notes.remarks.extend(remarks)
    result = notes.mistakes
    check_characters(text, name, _FORBIDDEN)
    sections: list[FisSection] = []
    comments: dict[str, int] = {}
    earlier: dict[tuple[str, int], int] = {}
    lines = split_lines(text)
    if len(lines) > MOST_LINES:
        raise ReadError(
            f"{name}: {len(lines):,} lines are more than the {MOST_LINES:,} "
            "that are read"
        )
    for number, line in enumerate(lines, 1):
        plain = line.strip()
        if plain.startswith(("#", "%", "//")):
            comments.setdefault(plain.lstrip("#%/").strip(), number)
        elif plain.startswith("["):
            _start_section(
                (sections, earlier), plain, number, line.index("[") + 1, result
            )
        elif plain and not sections:
            what = f"{plain[:40]!r} stands before the first section, [System]"
            result.append((number, 1, what))
        elif plain:
            _add_entry(sections[-1], line, number, result)
    return FisFile(tuple(sections), comments)


def _start_section(
    so_far: tuple[list[FisSection], dict[tuple[str, int], int]],
    plain: str,
    line: int,
    column: int,
    mistakes: list[FileMistake],
) -> None:
    sections, earlier = so_far
    inside = plain[1:].partition("]")[0].strip().lower()
    numbered = _NUMBERED.fullmatch(inside)
    kind, number = inside, 0
    if numbered:
        kind, number = numbered.group(1), int(numbered.group(2))
    elif kind not in ("system", "rules"):
        what = f"no section [{inside[:40]}]; there is System, Input1, Output1, Rules"
        mistakes.append((line, column, what))
    first = earlier.setdefault((kind, number), line)
    if first != line:
        what = f"section [{inside[:40]}] stands twice; the first is in line {first}"
        mistakes.append((line, column, what))
    sections.append(FisSection(kind, number, line, []))


def _add_entry(
    section: FisSection, line: str, number: int, mistakes: list[FileMistake]
) -> None:
    start = len(line) - len(line.lstrip())
    if section.kind == "rules":
        cut = min((at for at in map(line.find, "%#") if at >= 0), default=len(line))
        section.entries.append(FisEntry("", line[:cut].rstrip(), number, 1))
        return
    key, sign, value = line.partition("=")
    if not sign:
        what = f"{line.strip()[:40]!r} is no key and value, such as Name='tip'"
        mistakes.append((number, start + 1, what))
        return
    column = len(key) + 2 + len(value) - len(value.lstrip())
    section.entries.append(FisEntry(key.strip(), value.strip(), number, column))


def numbers_of(
    text: str, line: int, column: int, mistakes: list[FileMistake]
) -> list[float]:
    """Return the numbers of a text, parted by blanks or commas."""
    numbers: list[float] = []
    for token in _TOKEN.finditer(text):
        value = number_of(token.group())
        if value is None:
            what = f"{token.group()[:40]!r} is no number"
            mistakes.append((line, column + token.start(), what))
        else:
            numbers.append(value)
    return numbers


def unquoted(entry: FisEntry, mistakes: list[FileMistake]) -> str:
    """Return the text between the quotes of a value."""
    value = entry.value
    if value.find("'", 1) > LONGEST_NAME + 1:
        what = f"{entry.key} has more than {LONGEST_NAME} characters"
        mistakes.append((entry.line, entry.column, what))
    if len(value) >= 2 and value[0] == "'":
        end = value.find("'", 1)
        rest = value[end + 1 :].strip() if end > 0 else ""
        if end > 0 and (not rest or rest[0] in "%#"):
            return value[1:end]
        if value[-1] == "'":
            return value[1:-1]  # a quote within the quotes
    what = f"{entry.key} must stand in quotes, such as 'tip', not {value[:40]!r}"
    mistakes.append((entry.line, entry.column, what))
    return value.strip("'")


class FisTerm(msgspec.Struct, frozen=True):
    """`'name' : 'kind', [numbers]`, and the column where the numbers start."""

    name: str
    kind: str
    inside: str
    column: int


def term_of(entry: FisEntry, mistakes: list[FileMistake]) -> FisTerm | None:
    """Return the parts of a term; the last quotes are the kind's."""
    value = entry.value
    open_, close = value.rfind("["), value.rfind("]")
    last = value.rfind("'", 0, open_ if open_ >= 0 else len(value))
    first = value.rfind("'", 0, last) if last > 0 else -1
    head = value[:first].rstrip() if first > 0 else ""
    name = head[:-1].rstrip() if head.endswith(":") else ""
    between = value[last + 1 : open_].strip()
    is_whole = len(name) >= 2 and name[0] == "'" and name[-1] == "'"
    if not is_whole or open_ < last or close < open_ or between not in (",", ""):
        what = f"{entry.key} must be like 'low':'trimf',[0 1 2], not {value[:60]!r}"
        mistakes.append((entry.line, entry.column, what))
        return None
    kind = value[first + 1 : last].strip()
    column = entry.column + open_ + 1
    return FisTerm(name[1:-1], kind, value[open_ + 1 : close], column)


def fis_positions(
    inputs: Sequence[FisSection],
    outputs: Sequence[FisSection],
    rules: Sequence[FisEntry],
) -> Positions:
    """Return where the parts of a system stand."""
    lines = [(one.line, one.value) for one in rules]
    begins = tuple((n, len(line) - len(line.lstrip()) + 1) for n, line in lines)
    block = (begins[0] if begins else (1, 1), begins)
    return positions_of(map(_group, inputs), map(_group, outputs), [block])


def _group(section: FisSection) -> PositionGroup:
    terms = sorted(
        (int(entry.key[2:]), entry.position)
        for entry in section.entries
        if TERM.fullmatch(entry.key)
    )
    return (section.line, 1), [position for _, position in terms]


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
) -> tuple[Term, ...]:
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
    labels: list[Term] = []
    taken: dict[str, int] = {}
    for number in sorted(numbered):
        labels.append(_label(numbered[number], about, taken, notes))
    return tuple(labels)


def _label(
    entry: FisEntry, about: About, taken: dict[str, int], notes: ReaderNotes
) -> Term:
    written = term_of(entry, notes.mistakes)
    if written is None:
        return Term(entry.key, _WRONG)
    name = written.name or entry.key
    result = numbered(name, taken)
    if result != written.name:
        what = f"term {entry.key} of {about[0]!r} is called {written.name!r}"
        notes.remark(f"{what}; here it is {result!r}")
    function, height = _curve(written, entry, about, notes) or (_WRONG, 1.0)
    return Term(result, function, height)


def _curve(
    written: FisTerm, entry: FisEntry, about: About, notes: ReaderNotes
) -> tuple[Curve, float] | None:
    """Return the curve of a term and its height; None if there is a mistake."""
    kind, height = written.kind, 1.0
    place = (entry.line, written.column)
    if kind == "function":
        formula = _formula(written, place, notes)
        return None if formula is None else (formula, height)
    if kind not in words.FIS_KINDS and kind not in words.OTHER_KINDS:
        known = [*words.FIS_KINDS, *words.OTHER_KINDS]
        what = f"no kind of curve {kind[:40]!r}; {name_choice(kind[:40], known)}"
        notes.mistake(entry.position, what)
        return None
    mistake_count = len(notes.mistakes)
    numbers = numbers_of(written.inside, *place, notes.mistakes)
    if len(notes.mistakes) > mistake_count:
        return None
    if kind in ("constant", "linear"):
        result = _conclusion_number(kind, numbers, about, notes)
    else:
        word = words.FIS_KINDS.get(kind)
        one_more = len(numbers) % 2 if word is None else len(numbers) == word.arity + 1
        if about[1] == "fuzzylite" and one_more:
            height = numbers.pop()
        result = words.curve_of(kind, numbers, about[1])
        if about[2] is not None and about[2][0] and about[1] != "fuzzylite":
            result = f"a Sugeno system concludes constant and linear, not {kind!r}"
    if isinstance(result, str):
        notes.mistake(place, result)
        return None
    return result, height


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
        return next(curve.mistakes(), curve)
    if dialect != "fuzzylite" or kind == "linear":
        return f"a {kind!r} belongs to the outputs of a Sugeno system"
    notes.remark(
        f"{name!r}: a 'constant' that is looked at as a curve has the same degree "
        "everywhere, as in fuzzylite"
    )
    return Formula(Number(numbers[0]))


def _formula(
    written: FisTerm, place: tuple[int, int], notes: ReaderNotes
) -> Curve | None:
    try:
        curve = Formula(parse(written.inside))
    except FormulaError as error:
        notes.mistake((place[0], place[1] + error.column - 1), error.sentence)
        return None
    for mistake in curve.mistakes():
        notes.mistake(place, mistake)
    return curve


Variables = tuple[Sequence[Variable], Sequence[SystemOutput]]


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
        places.append(numbers_of(part, entry.line, column, notes.mistakes))
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
    if any(one.term and one.hedges[-1:] == ("any",) for one in questions):
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
    when = combined(Or if is_or else And, questions) if questions else None
    if dialect == "octave" and any(one.hedges for one in conclusions):
        for one in conclusions:
            yield SystemRule(when, (one,), line.weight)
    else:
        yield SystemRule(when, tuple(conclusions), line.weight)


def _code(
    code: float,
    variable: Variable | SystemOutput,
    where: tuple[int, FisEntry],
    notes: ReaderNotes,
) -> _Code | None:
    """Return what a number means; None if there is no such term."""
    size = abs(code)
    if not size < len(variable.terms) + 1:  # NaN too
        number, entry = where
        what = (
            f"rule {number}: {variable.name!r} has {len(variable.terms)} terms, "
            f"and no term {size:g}"
        )
        notes.mistake((entry.line, 1), what)
        return None
    place = int(size)
    return _Code(place, round(100.0 * (size - place)), code < 0.0)


def _question(
    variable: Variable,
    code: float,
    where: tuple[int, FisEntry],
    dialect: Dialect,
    notes: ReaderNotes,
) -> Proposition | None:
    """Return the proposition on an input; None if there is none."""
    if code == 0.0:
        return None
    result = _code(code, variable, where, notes)
    if result is None or (not result.place and dialect != "fuzzylite"):
        return None
    hedges = _hedges(words.FIS_HEDGES[dialect], result, (variable.name, where), notes)
    if not result.place:
        if hedges[-1:] == ("any",):
            return Proposition(variable.name, (), hedges)
        what = f"rule {where[0]}: a hedge of no term of {variable.name!r}"
        notes.mistake((where[1].line, 1), what)
        return None
    return Proposition(variable.name, (variable.terms[result.place - 1].name,), hedges)


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
    return Conclusion(output.name, output.terms[result.place - 1].name, hedges)


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
