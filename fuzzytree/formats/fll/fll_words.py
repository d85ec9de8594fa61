"""FLL files as sections of keys and values, and the words that values are made of."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Final, TypeVar, get_args

import msgspec
from msgspec.structs import replace

from fuzzytree.formats.text_files import (
    LONGEST_NAME,
    Position,
    ReaderNotes,
    Word,
    number_of,
    split_lines,
    words,
)
from fuzzytree.formats.words import (
    HEDGE_WORDS,
    METHOD_WORDS,
    S_NORM_WORDS,
    T_NORM_WORDS,
    meanings,
)
from fuzzytree.model import (
    Activation,
    ActivationMethod,
    Defuzzifier,
    Relation,
    name_choice,
)

KEYS: Mapping[str, tuple[str, ...]] = {
    "Engine": ("description",),
    "InputVariable": ("description", "enabled", "range", "lock-range", "term"),
    "OutputVariable": (
        *("description", "enabled", "range", "lock-range", "aggregation"),
        *("defuzzifier", "default", "lock-previous", "term"),
    ),
    "RuleBlock": (
        *("description", "enabled", "conjunction", "disjunction", "implication"),
        *("activation", "rule"),
    ),
}
"""What each kind of section may say."""

T = TypeVar("T")

MOST_BYTES: Final = 32 * 2**20
MOST_LINES: Final = 500_000
MOST_WORDS: Final = 20_000
"""Of one line: enough for 4096 points, or for a rule of 5000 questions."""

_REPEATED = frozenset({"term", "rule"})

FLL_TNORMS: Final = meanings(T_NORM_WORDS, "fll")
FLL_SNORMS: Final = meanings(S_NORM_WORDS, "fll")
FLL_METHODS: Final = meanings(METHOD_WORDS, "fll")
FLL_HEDGES: Final = meanings(HEDGE_WORDS, "fll")
TYPES: Final = ("Automatic", "TakagiSugeno", "Tsukamoto")
"""How a weighted defuzzifier may treat terms."""

SAMPLES: Final = 1000
"""At how many values a curve is looked at where a file does not say it."""

ACTIVATIONS: Mapping[str, ActivationMethod] = {
    method.capitalize(): method for method in get_args(ActivationMethod)
}
_RELATIONS: Mapping[str, Relation] = {one: one for one in get_args(Relation)}


class FllEntry(msgspec.Struct, frozen=True):
    """A line `key: value`, and where the key and the value stand."""

    key: str
    value: str
    line: int
    column: int
    start: int

    @property
    def position(self) -> Position:
        """Where the value stands."""
        return self.line, self.start

    def words(self, signs: str = "") -> tuple[Word, ...]:
        """Return the words of the value, as many as a line may have."""
        result = words(self.value, self.line, self.start, signs)
        return tuple(itertools.islice(result, MOST_WORDS))

    @property
    def end(self) -> Word:
        """An empty word behind the value."""
        return Word("", self.line, self.start + len(self.value))


class FllSection(msgspec.Struct, frozen=True):
    """A section: its first line, and those behind it."""

    head: FllEntry
    entries: tuple[FllEntry, ...]

    @property
    def kind(self) -> str:
        """Engine, InputVariable, OutputVariable or RuleBlock."""
        return self.head.key

    def all_of(self, key: str) -> tuple[FllEntry, ...]:
        """Return the lines of a key, in order."""
        return tuple(one for one in self.entries if one.key == key)

    def one_of(self, key: str) -> FllEntry | None:
        """Return the line of a key that stands once; None where it is missing."""
        return next((one for one in self.entries if one.key == key), None)


class FllFile(msgspec.Struct, frozen=True):
    """A file: its sections, and its comments without their sign."""

    sections: tuple[FllSection, ...]
    comments: tuple[str, ...]


def read_page(text: str, notes: ReaderNotes) -> FllFile:
    """Return the sections of a text; what is wrong with its lines is noted."""
    comments: list[str] = []
    heads: list[tuple[FllEntry, list[FllEntry]]] = []
    count = max(text.count("\n"), text.count("\r"))
    if count > MOST_LINES:
        result = f"{count:,} lines are more than the {MOST_LINES:,} that are read"
        notes.mistake((MOST_LINES + 1, 1), result)
        return FllFile((), ())
    for number, line in enumerate(split_lines(text), 1):
        content, sign, comment = line.partition("#")
        if sign:
            comments.append(comment.strip())
        if not content.strip() or notes.is_full:
            continue
        entry = _entry(content, number, notes)
        if entry is None or _is_too_long(entry, notes):
            continue
        entry = _current(entry, notes)
        if entry.key in KEYS:
            heads.append((entry, []))
        elif _belongs(entry, heads, notes):
            heads[-1][1].append(entry)
    sections = tuple(FllSection(head, tuple(entries)) for head, entries in heads)
    for extra in [one for one in sections if one.kind == "Engine"][1:]:
        result = "a second Engine; a file holds one"
        notes.mistake((extra.head.line, extra.head.column), result)
    return FllFile(sections, tuple(comments))


def _entry(text: str, line: int, notes: ReaderNotes) -> FllEntry | None:
    key, colon, value = text.partition(":")
    column = len(key) - len(key.lstrip()) + 1
    if not colon:
        sentence = f"{_short(text)!r} where 'key: value' must stand"
        notes.mistake((line, column), sentence)
        return None
    start = len(key) + 2 + len(value) - len(value.lstrip())
    return FllEntry(key.strip(), value.strip(), line, column, start)


_OLD_KEYS = {"accumulation": "aggregation", "lock-valid": "lock-previous"}


def _current(entry: FllEntry, notes: ReaderNotes) -> FllEntry:
    """Return an entry of fuzzylite 5 under the key that fuzzylite 6 takes it for."""
    key = _OLD_KEYS.get(entry.key, entry.key)
    if key == "activation" and entry.value in FLL_TNORMS:
        key = "implication"
    if key != entry.key:
        what = f"{entry.key!r} of fuzzylite 5 is read as {key!r}, as in fuzzylite 6"
        notes.remark(f"line {entry.line}: {what}")
    return replace(entry, key=key)


def _is_too_long(entry: FllEntry, notes: ReaderNotes) -> bool:
    if len(entry.value) < MOST_WORDS:
        return False
    result = words(entry.value, entry.line, entry.start, "()")
    extra = next(itertools.islice(result, MOST_WORDS - 1, None), None)
    if extra is not None:
        sentence = f"a line of more words than the {MOST_WORDS:,} that are read"
        notes.mistake(extra.position, sentence)
    return extra is not None


def _belongs(
    entry: FllEntry,
    heads: Sequence[tuple[FllEntry, list[FllEntry]]],
    notes: ReaderNotes,
) -> bool:
    """Return whether an entry may stand in the last section."""
    key = entry.key
    if not heads:
        known = [*KEYS, *(key for keys in KEYS.values() for key in keys)]
        sentence = f"{_short(key)!r} stands before any section"
        if key not in known:
            sentence = f"no section {_short(key)!r}; {name_choice(key[:99], KEYS)}"
    elif key not in KEYS[heads[-1][0].key]:
        kind = heads[-1][0].key
        choice = name_choice(key[:99], [*KEYS[kind], *KEYS])
        sentence = f"{kind} has no key {_short(key)!r}; {choice}"
    elif key not in _REPEATED and any(one.key == key for one in heads[-1][1]):
        sentence = f"a second {key!r} in one {heads[-1][0].key}"
    else:
        return True
    notes.mistake((entry.line, entry.column), sentence)
    return False


def _short(text: str) -> str:
    text = text.strip()
    return text if len(text) <= LONGEST_NAME else text[:LONGEST_NAME] + "..."


def truth(entry: FllEntry | None, default: bool, notes: ReaderNotes) -> bool:
    """Return what an entry of `true` or `false` says."""
    if entry is None:
        return default
    if entry.value not in ("true", "false"):
        sentence = f"{entry.key} is true or false, not {_short(entry.value)!r}"
        notes.mistake(entry.position, sentence)
    return entry.value == "true"


def number(word: Word, notes: ReaderNotes) -> float:
    """Return the number that a word is; NaN, and a mistake, where it is none."""
    value = number_of(word.text)
    if value is None:
        notes.mistake(word.position, f"{_short(word.text)!r} where a number must stand")
        return float("nan")
    return value


def named(
    entry: FllEntry | None, table: Mapping[str, T], notes: ReaderNotes
) -> T | None:
    """Return what the word of an entry means; None for none, or with a mistake."""
    if entry is None or entry.value in ("", "none"):
        return None
    if entry.value not in table:
        choice = name_choice(entry.value[:99], [*table, "none"])
        sentence = f"no {entry.key} {_short(entry.value)!r}; {choice}"
        notes.mistake(entry.position, sentence)
    return table.get(entry.value)


def activation(entry: FllEntry | None, notes: ReaderNotes) -> Activation:
    """Return the activation method that an entry says."""
    if entry is None or entry.value in ("", "none"):
        return Activation()
    name, *rest = entry.words()
    method = ACTIVATIONS.get(name.text)
    if method is None:
        sentence = f"no activation {name.text!r}; {name_choice(name.text, ACTIVATIONS)}"
        notes.mistake(name.position, sentence)
        return Activation()
    counts = {"first": 2, "last": 2, "threshold": 2, "highest": 1, "lowest": 1}
    if len(rest) not in (0, counts.get(method, 0)):
        sentence = f"{name.text} takes {_WANTED[method]}"
        notes.mistake(name.position, sentence)
        return Activation()
    if not rest or method in ("general", "proportional"):
        return Activation(method)
    if method == "threshold":
        relation = _RELATIONS.get(rest[0].text)
        if relation is None:
            sentence = f"no relation {rest[0].text!r}; {name_choice('', _RELATIONS)}"
            notes.mistake(rest[0].position, sentence)
        threshold = _threshold(rest[1], notes)
        return Activation(method, threshold=threshold, relation=relation or ">=")
    count = _count(rest[0], 1, notes)
    threshold = _threshold(rest[1], notes) if len(rest) > 1 else 0.0
    return Activation(method, count, threshold)


_WANTED: Mapping[ActivationMethod, str] = {
    "general": "nothing",
    "proportional": "nothing",
    "first": "a number of rules and a threshold",
    "last": "a number of rules and a threshold",
    "highest": "a number of rules",
    "lowest": "a number of rules",
    "threshold": "a relation and a threshold",
}


def _threshold(word: Word, notes: ReaderNotes) -> float:
    value = number(word, notes)
    if not 0.0 <= value <= 1.0:
        notes.mistake(word.position, f"a threshold lies in [0, 1], not {word.text}")
        return 0.0
    return value


def _count(word: Word, least: int, notes: ReaderNotes) -> int:
    text = word.text
    if not (
        text.isascii() and text.isdigit() and len(text) < 10 and int(text) >= least
    ):
        sentence = f"{_short(text)!r} where a whole number from {least} on must stand"
        notes.mistake(word.position, sentence)
        return least
    return int(text)


def defuzzifier(
    entry: FllEntry | None, notes: ReaderNotes
) -> tuple[Defuzzifier, str] | None:
    """Return the defuzzifier of an entry and the type of a weighted one, if any."""
    if entry is None or entry.value in ("", "none"):
        return None
    name, *rest = entry.words()
    method = FLL_METHODS.get(name.text)
    if method is None:
        sentence = (
            f"no defuzzifier {name.text!r}; {name_choice(name.text, FLL_METHODS)}"
        )
        notes.mistake(name.position, sentence)
        return Defuzzifier("centroid"), ""
    if len(rest) > 1:
        notes.mistake(rest[1].position, f"{name.text} takes one word behind it")
    if method in ("weighted average", "weighted sum"):
        kind = rest[0].text if rest else "Automatic"
        if kind not in TYPES:
            sentence = f"no type {kind!r}; {name_choice(kind, TYPES)}"
            notes.mistake(rest[0].position, sentence)
        return Defuzzifier(method), kind
    usual = 100 if notes.dialect == "fuzzylite" else SAMPLES
    samples = _count(rest[0], 2, notes) if rest else usual
    if not rest and not notes.dialect:
        notes.rivals[:] = ["fuzzylite"]
    return Defuzzifier(method, samples), ""
