"""The terms of a FIS variable."""

from __future__ import annotations

from collections.abc import Sequence

from fuzzytree.formats.fis import fis_text as text
from fuzzytree.formats.fis import fis_words as words
from fuzzytree.formats.fis.fis_text import Entry, Notes
from fuzzytree.formats.fis.fis_words import Dialect
from fuzzytree.formats.formulas import FormulaError, parse
from fuzzytree.model.naming import numbered
from fuzzytree.model.rulebase import name_choice
from fuzzytree.model.system import (
    Curve,
    Formula,
    Label,
    Linear,
    Number,
    SigmoidDifference,
    Singleton,
    curve_mistakes,
)

About = tuple[str, Dialect, tuple[bool, int] | None]
"""The variable's name and the dialect; of an output also whether numbers are weighted
and how many inputs there are."""


_WRONG = Formula(Number(0.0))
"""Stands for a curve with a mistake, so that rules find their terms."""


def labels_of(
    entries: Sequence[Entry], count: Entry | None, about: About, notes: Notes
) -> tuple[Label, ...]:
    """Return the terms of a variable in the order of their numbers.

    Args:
        entries: `MF1 = 'low':'trimf',[0 1 2]` and so on, in any order.
        count: `NumMFs`, if it is there.
        about: The variable.
        notes: Mistakes and remarks are added to it.
    """
    numbered = {int(entry.key[2:]): entry for entry in reversed(entries)}
    if len(numbered) < len(entries):
        twice = next(e for e in entries if numbered[int(e.key[2:])] is not e)
        notes.found.append((twice.line, 1, f"{twice.key} stands twice"))
    for place, number in enumerate(sorted(numbered), 1):
        if place != number:
            what = f"MF{place} is missing before MF{number}"
            notes.found.append((numbered[number].line, 1, what))
            break
    if count is not None and count.value.split("%")[0].strip() != str(len(entries)):
        what = f"NumMFs says {count.value[:20]}, and there are {len(entries)}"
        if about[1] == "fuzzylite":
            notes.remarks.append(f"{about[0]!r}: {what}: fuzzylite reads them all")
        else:
            notes.found.append((count.line, count.column, what))
    labels: list[Label] = []
    taken: dict[str, int] = {}
    for number in sorted(numbered):
        labels.append(_label(numbered[number], about, taken, notes))
    return tuple(labels)


def _label(entry: Entry, about: About, taken: dict[str, int], notes: Notes) -> Label:
    written = text.term_of(entry, notes.found)
    if written is None:
        return Label(entry.key, _WRONG)
    name = written.name or entry.key
    found = numbered(name, taken)
    if found != written.name:
        what = f"term {entry.key} of {about[0]!r} is called {written.name!r}"
        notes.remarks.append(f"{what}; here it is {found!r}")
    curve = _curve(written, entry, about, notes)
    return Label(found, _WRONG if curve is None else curve)


def _curve(
    written: text.Written, entry: Entry, about: About, notes: Notes
) -> Curve | None:
    kind = written.kind
    place = (entry.line, written.column)
    if kind == "function":
        return _formula(written, place, notes)
    if kind not in words.KINDS and kind not in words.OTHER_KINDS:
        known = [*words.KINDS, *words.OTHER_KINDS]
        what = f"no kind of curve {kind[:40]!r}; {name_choice(kind[:40], known)}"
        notes.found.append((entry.line, entry.column, what))
        return None
    before = len(notes.found)
    numbers = text.numbers_of(written.inside, *place, notes.found)
    if len(notes.found) > before:
        return None
    if kind in ("constant", "linear"):
        found = _number(kind, numbers, about, notes)
    else:
        found = words.curve_of(kind, numbers)
        if about[2] is not None and about[2][0] and about[1] != "fuzzylite":
            found = f"a Sugeno system concludes constant and linear, not {kind!r}"
    if isinstance(found, str):
        notes.found.append((*place, found))
        return None
    if isinstance(found, SigmoidDifference) and about[1] != "fuzzylite":
        notes.remarks.append(
            f"term {written.name!r} of {about[0]!r}: where the second sigmoid is above "
            "the first, MATLAB takes their distance, as here, and Octave 0"
        )
    return found


def _number(
    kind: str, numbers: Sequence[float], about: About, notes: Notes
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
    notes.remarks.append(
        f"{name!r}: a 'constant' that is looked at as a curve has the same degree "
        "everywhere, as in fuzzylite"
    )
    return Formula(Number(numbers[0]))


def _formula(
    written: text.Written, place: tuple[int, int], notes: Notes
) -> Curve | None:
    try:
        curve = Formula(parse(written.inside))
    except FormulaError as error:
        notes.found.append((place[0], place[1] + error.column - 1, error.sentence))
        return None
    for mistake in curve_mistakes(curve):
        notes.found.append((*place, mistake))
    return curve
