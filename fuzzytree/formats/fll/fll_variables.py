"""Variables and blocks of FLL files, as they stand there."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Final

import msgspec

from fuzzytree.formats.fll import fll_words as fll
from fuzzytree.formats.fll.fll_rules import RuleError, Variable, Vocabulary, read_rule
from fuzzytree.formats.fll.fll_terms import Place, Term, TermError, read_term
from fuzzytree.formats.fll.fll_words import Entry, Notes, Section
from fuzzytree.formats.lines import LONGEST_WORD, Word, number_of
from fuzzytree.model.contracts import Loss
from fuzzytree.model.rulebase import Points
from fuzzytree.model.system import (
    Defuzzifier,
    Label,
    RuleBlock,
    Singleton,
    SystemInput,
    SystemOutput,
    SystemRule,
)

MOST_VARIABLES: Final = 2000

_DROPPED = re.compile(r"[^\w.]")


class Known(msgspec.Struct, frozen=True):
    """A variable as it was read.

    Attributes:
        section: Where it stands.
        name: Its name.
        terms: Its terms.
        lines: Where they stand.
        said: The words that stand for each term.
        variable: What it is, with its terms.
        kind: The type of a weighted defuzzifier.
        is_enabled: Whether it takes part.
    """

    section: Section
    name: str
    terms: tuple[Term, ...]
    lines: tuple[Entry, ...]
    said: tuple[tuple[str, ...], ...]
    variable: SystemInput | SystemOutput
    kind: str = ""
    is_enabled: bool = True

    @property
    def is_output(self) -> bool:
        """Whether rules may conclude it."""
        return isinstance(self.variable, SystemOutput)


class ReadBlock(msgspec.Struct, frozen=True):
    """A block as it was read, and where it and its rules stand."""

    section: Section
    block: RuleBlock
    lines: tuple[Entry, ...]
    is_enabled: bool = True


def read_variables(sections: Sequence[Section], notes: Notes) -> list[Known]:
    """Return the inputs and outputs of a file; their mistakes are noted."""
    found = [one for one in sections if one.kind in ("InputVariable", "OutputVariable")]
    if len(found) > MOST_VARIABLES:
        sentence = f"more variables than the {MOST_VARIABLES:,} that are read"
        notes.found.append(found[MOST_VARIABLES].head.mistake(sentence))
        return []
    names = [_variable_name(one, notes) for one in found]
    pairs = list(zip(names, found, strict=True))
    inputs = tuple(name for name, one in pairs if one.kind == "InputVariable")
    known: set[str] = set()
    for name, one in pairs:
        if name in known:
            notes.found.append(one.head.mistake(f"a second variable {name!r}"))
        known.add(name)
    place = Place("", inputs, dict.fromkeys(names))
    return [
        _variable(one, name, msgspec.structs.replace(place, variable=name), notes)
        for name, one in pairs
        if not notes.is_full
    ]


def vocabulary_of(variables: Sequence[Known]) -> Vocabulary:
    """Return the variables by the words that stand for them in rules."""
    found: dict[str, Variable] = {}
    for one in variables:
        terms: dict[str, str] = {}
        for term, said in zip(one.terms, one.said, strict=True):
            for word in said:
                terms.setdefault(word, term.label.name)
        entry = Variable(one.name, terms, one.is_output)
        for word in (one.name, one.section.head.value, *_other_names(one.name)):
            found.setdefault(word, entry)
    return found


def _variable_name(section: Section, notes: Notes) -> str:
    given = section.head.value
    if not given or len(given) > LONGEST_WORD:
        what = "a name" if not given else f"a name of at most {LONGEST_WORD} characters"
        notes.found.append(section.head.mistake(f"{section.kind} needs {what}"))
    return _cleaned(given, notes)


def _cleaned(given: str, notes: Notes) -> str:
    """Return a name without the characters that the engines drop."""
    name = _DROPPED.sub("", given) or "_"
    if name != given:
        notes.remarks.append(
            f"the name {given!r} is read as {name!r}, as the engines do"
        )
    return name


def _other_names(name: str) -> Iterator[str]:
    """Yield what the engines make of a name: one drops dots and marks digits."""
    plain = name.replace(".", "")
    yield plain
    if plain[:1].isdigit():
        yield f"_{plain}"


def _variable(section: Section, name: str, place: Place, notes: Notes) -> Known:
    is_enabled = fll.truth(section.one_of("enabled"), True, notes)
    is_output = section.kind == "OutputVariable"
    how = _defuzzifier(section, name, notes) if is_output else None
    if how is not None:
        is_weighted = how[0].is_weighted
        place = msgspec.structs.replace(
            place,
            is_weighted=is_weighted,
            is_inverse=is_weighted and how[1] != "TakagiSugeno",
        )
    terms, kept, said = _terms(section, place, notes)
    low, high = _range(section.one_of("range"), notes)
    clips = fll.truth(section.one_of("lock-range"), False, notes)
    labels = tuple(term.label for term in terms)
    clips = clips and not (low is None and high is None)
    variable: SystemInput | SystemOutput = SystemInput(name, labels, low, high, clips)
    if how is not None:
        variable = SystemOutput(
            name,
            labels,
            low,
            high,
            how[0],
            fll.s_norm(section.one_of("aggregation"), notes),
            _default(section.one_of("default"), notes),
            clips,
        )
        _tell_locked(section.one_of("lock-previous"), name, notes)
    kind = "" if how is None else how[1]
    return Known(
        section,
        name,
        tuple(terms),
        tuple(kept),
        tuple(said),
        variable,
        kind,
        is_enabled,
    )


def _terms(
    section: Section, place: Place, notes: Notes
) -> tuple[list[Term], list[Entry], list[tuple[str, ...]]]:
    """Return the terms of a variable, where they stand, and what stands for each."""
    found: dict[str, tuple[Term, Entry, tuple[str, ...]]] = {}
    for entry in section.all_of("term"):
        term = _term(entry, place, notes)
        if term is not None:
            name = term.label.name
            if name in found:
                _tell_second(name, found.pop(name)[1], entry, notes)
            words = (name, entry.words()[0].text, *_other_names(name))
            found[name] = (term, entry, words)
        if notes.is_full:
            break
    terms = [term for term, _, _ in found.values()]
    return (
        terms,
        [one for _, one, _ in found.values()],
        [w for _, _, w in found.values()],
    )


def _tell_second(name: str, first: Entry, second: Entry, notes: Notes) -> None:
    what = (
        f"the term {name!r} stands in line {second.line} again, which counts as in "
        "pyfuzzylite; fuzzylite 6 takes the first"
    )
    notes.losses.append(Loss(f"line {first.line}", what))


def _defuzzifier(section: Section, name: str, notes: Notes) -> tuple[Defuzzifier, str]:
    found = fll.defuzzifier(section.one_of("defuzzifier"), notes)
    if found is not None:
        return found
    entry = section.one_of("defuzzifier") or section.head
    if fll.truth(section.one_of("enabled"), True, Notes([], [], [])):
        notes.found.append(entry.mistake(f"output {name!r} needs a defuzzifier"))
    return Defuzzifier("weighted average"), ""


def _term(entry: Entry, place: Place, notes: Notes) -> Term | None:
    """Return a term; None where not even its name is known. Mistakes are noted."""
    found = entry.words()
    if len(found) < 2:
        sentence = "a term is a name, a class such as Triangle, and numbers"
        notes.found.append(entry.mistake(sentence))
        return None
    given, kind, *rest = found
    if len(given.text) > LONGEST_WORD:
        sentence = f"a term needs a name of at most {LONGEST_WORD} characters"
        notes.found.append(given.mistake(sentence))
        return None
    name = _cleaned(given.text, notes)
    try:
        formula = entry.value[rest[0].column - entry.start :] if rest else ""
        term = read_term(name, kind, rest, place, formula)
    except TermError as error:
        notes.found.extend(error.found)
        # Rules may ask for it all the same.
        return Term(Label(name, Singleton(0.0)), "")
    _tell_odd(term, rest, place, notes)
    return term


def _tell_odd(term: Term, rest: Sequence[Word], place: Place, notes: Notes) -> None:
    """Note a term by which the two engines mean other things."""
    where = f"term {term.label.name!r} of {place.variable!r}"
    if term.kind == "Rectangle":
        start, end = (number_of(word.text) or 0.0 for word in rest[:2])
        if start > end:
            notes.remarks.append(
                f"{where} ends before it starts: its ends are exchanged, as in "
                "pyfuzzylite; fuzzylite 6 makes it 0 everywhere"
            )
    curve = term.label.curve
    if term.kind != "Discrete" or not isinstance(curve, Points):
        return
    if len(set(curve.values)) < len(curve.values):
        notes.remarks.append(
            f"{where} has a step: at the value itself its first degree holds, as in "
            "fuzzylite 6; pyfuzzylite takes the second"
        )


def _range(entry: Entry | None, notes: Notes) -> tuple[float | None, float | None]:
    """Return the ends of a range; None for one that is not finite."""
    if entry is None:
        return None, None
    found = entry.words()
    if len(found) != 2:
        notes.found.append(entry.mistake(f"a range has 2 numbers, not {len(found)}"))
        return None, None
    low, high = (fll.number(word, notes) for word in found)
    if low > high:
        sentence = f"the range starts at {low!r} and ends below it, at {high!r}"
        notes.found.append(entry.mistake(sentence))
        return None, None
    return (
        low if math.isfinite(low) else None,
        high if math.isfinite(high) else None,
    )


def _default(entry: Entry | None, notes: Notes) -> float | None:
    if entry is None or entry.value == "":
        return None
    found = entry.words()
    if len(found) != 1:
        notes.found.append(entry.mistake(f"a default is 1 number, not {len(found)}"))
        return None
    value = fll.number(found[0], notes)
    if math.isinf(value):
        notes.found.append(entry.mistake("a default cannot be infinite"))
    return value if math.isfinite(value) else None


def _tell_locked(entry: Entry | None, name: str, notes: Notes) -> None:
    if fll.truth(entry, False, notes):
        notes.losses.append(
            Loss(
                f"output {name!r}",
                "lock-previous: where no rule concludes it, the answer to the row "
                "before; the default answers instead",
            )
        )


def read_block(section: Section, vocabulary: Vocabulary, notes: Notes) -> ReadBlock:
    """Return a block of rules; its mistakes are noted."""
    rules: list[SystemRule] = []
    lines: list[Entry] = []
    for entry in section.all_of("rule"):
        try:
            rules.append(read_rule(entry.words("()"), entry.end, vocabulary))
            lines.append(entry)
        except RuleError as error:
            notes.found.extend(error.found)
        if notes.is_full:
            break
    is_enabled = fll.truth(section.one_of("enabled"), True, notes)
    if section.one_of("activation") is None and rules and is_enabled:
        notes.remarks.append(
            f"line {section.head.line}: a block without activation is read as General"
        )
    block = RuleBlock(
        tuple(rules),
        fll.t_norm(section.one_of("conjunction"), notes),
        fll.s_norm(section.one_of("disjunction"), notes),
        fll.t_norm(section.one_of("implication"), notes),
        fll.activation(section.one_of("activation"), notes),
        section.head.value,
    )
    return ReadBlock(section, block, tuple(lines), is_enabled)
