"""Which dialect of FCL a file is written in, and what its words mean there."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Final, Literal, NamedTuple, TypeVar

from lark import Token

from fuzzytree.formats.fcl.fcl_syntax import (
    FclBlock,
    FclChain,
    FclCondition,
    FclNegation,
    FclProposition,
    FclRange,
    FclText,
    Header,
    RuleStatement,
    Setting,
    TermStatement,
    place,
)
from fuzzytree.formats.fll.fll_terms import CLASSES
from fuzzytree.formats.text_files import ReaderNotes
from fuzzytree.formats.words import (
    METHOD_WORDS,
    S_NORM_WORDS,
    T_NORM_WORDS,
    Meaning,
    Words,
    meanings,
)
from fuzzytree.model import Defuzzifier, SNorm, TNorm, name_choice

_Norm = TypeVar("_Norm")

Dialect = Literal["portable", "iec", "fuzzylite", "jfuzzylogic", "pyit2fls"]

MARK: Final = " FCL, dialect "
"""How a file that was written here begins, behind `//` or `(*`."""

SHOWN: Mapping[Dialect, str] = {
    "portable": "portable",
    "iec": "IEC 61131-7",
    "fuzzylite": "fuzzylite",
    "jfuzzylogic": "jFuzzyLogic",
    "pyit2fls": "PyIT2FLS",
}

DEFUZZIFIERS: Mapping[Dialect, Defuzzifier] = {
    "portable": Defuzzifier("centroid", 1000),
    "iec": Defuzzifier("centroid", 1000),
    "fuzzylite": Defuzzifier("centroid", 100),
    "jfuzzylogic": Defuzzifier("centroid", 1000, "low ends"),
    "pyit2fls": Defuzzifier("centroid", 100, "ends"),
}
"""At how many values an engine of each dialect looks; a file does not say it."""


def _words(table: Mapping[Meaning, Words]) -> dict[str, Meaning]:
    """Return what words mean, in capitals: those of FLL too, as fuzzylite has it."""
    known = meanings(table, "fcl", "fll")
    return {word.upper(): meaning for word, meaning in known.items()}


FCL_TNORMS: Final = _words(T_NORM_WORDS)
FCL_SNORMS: Final = _words(S_NORM_WORDS)
FCL_METHODS: Final = _words(METHOD_WORDS)
PAIRS: Mapping[TNorm, SNorm] = {
    "minimum": "maximum",
    "product": "algebraic sum",
    "bounded difference": "bounded sum",
    "drastic product": "drastic sum",
    "nilpotent minimum": "nilpotent maximum",
    "einstein product": "einstein sum",
    "hamacher product": "hamacher sum",
}
"""The OR that an AND brings with it."""

JFUZZYLOGIC_PAIRS: Mapping[TNorm, SNorm] = {**PAIRS, "hamacher product": "einstein sum"}
CHOICE: Final = "pass --from fcl:iec or --from fcl:jfuzzylogic"
"""What to do where the engines differ and a file does not say which one is meant."""

_OF_JFUZZYLOGIC = frozenset(
    {"TRIAN", "TRAPE", "GAUSS", "GAUSS2", "GBELL", "SIGM", "DSIGM", "COSINE"}
    | {"SINGLETONS", "COGF", "DMIN", "DMAX", "NIPMIN", "NIPMAX", "HAMACHER"}
    | {"EINSTEIN", "PROBOR", "SUM"}
)
_OF_FUZZYLITE = frozenset(
    {"DPROD", "DSUM", "EPROD", "ESUM", "HPROD", "HSUM", "NMIN", "NMAX", "COGSS"}
    | {"NONE"}
)
_ORDER: Final[list[Dialect]] = ["fuzzylite", "jfuzzylogic", "pyit2fls", "iec"]


class DialectEvidence(NamedTuple):
    """Something that a dialect has; the more it weighs the fewer others have it too."""

    dialect: Dialect
    what: str
    line: int
    weight: int = 2


def detect_dialect(
    text: FclText, wanted: Dialect | None, notes: ReaderNotes
) -> tuple[Dialect, str, bool]:
    """Return the dialect of a file, why it is, and whether no other one can be meant.

    It is the wanted one, which must not contradict the file, or the one that the words
    of the file speak for.
    """
    mark = _first_line(text.text)
    named = wanted or mark
    if wanted is not None:
        _refuse_contradiction(text, wanted, mark, notes)
    if named is not None:
        why = "as it is asked for" if wanted else "the first line says so"
        return named, f"the dialect is {SHOWN[named]}: {why}", True
    result = list(_evidence(text))
    counts: Counter[Dialect] = Counter()
    for one in {(one.dialect, one.what): one for one in result}.values():
        counts[one.dialect] += one.weight
    best: Dialect = max(_ORDER, key=lambda one: (counts[one], -_ORDER.index(one)))
    if not counts[best]:
        return (
            "iec",
            "the dialect is IEC 61131-7: nothing speaks for another one",
            False,
        )
    sentence = f"the dialect is {SHOWN[best]}: {_listed(result, best)}"
    for other in _ORDER:
        if other == best or not counts[other]:
            continue
        sentence += f"; {SHOWN[other]} would have {_listed(result, other)}"
    is_certain = best in ("fuzzylite", "jfuzzylogic") and counts[best] > 1
    return best, sentence, is_certain


def _refuse_contradiction(
    text: FclText, wanted: Dialect, mark: Dialect | None, notes: ReaderNotes
) -> None:
    """Note why a file is for another engine than the wanted one, if it is.

    The standard, PyIT2FLS and the portable profile are read with the words of all.
    """
    if mark not in (None, "portable", wanted) and wanted != "portable":
        what = f"the first line says that the dialect is {mark}"
        notes.mistake((1, 1), f"{what}; pass --from fcl:{mark}")
        return
    if wanted not in ("fuzzylite", "jfuzzylogic"):
        return
    signs = sorted(_evidence(text), key=lambda one: one.line)
    shared = {(one.line, one.what) for one in signs if one.dialect == wanted}
    for one in signs:
        is_shared = one.weight < 2 or (one.line, one.what) in shared
        if not is_shared and one.dialect != "pyit2fls":
            what = f"{one.what} is read by {SHOWN[one.dialect]}, not by {SHOWN[wanted]}"
            notes.mistake((one.line, 1), f"{what}; pass --from fcl:{one.dialect}")
            return


def is_marked(text: str) -> bool:
    """Return whether a file says that it was written here."""
    return _first_line(text) is not None


def _first_line(text: str) -> Dialect | None:
    line, _, _ = text.partition("\n")
    if line[:2] not in ("//", "(*") or not line[2:].startswith(MARK):
        return None
    word = line[2:].removeprefix(MARK).removesuffix("*)").strip()
    match word:
        case "portable" | "iec" | "fuzzylite" | "jfuzzylogic":
            return word
        case _:
            return None


def _listed(results: list[DialectEvidence], dialect: Dialect) -> str:
    first: dict[str, int] = {}
    for one in results:
        if one.dialect == dialect:
            first.setdefault(one.what, one.line)
    shown = [f"{what} (line {line})" for what, line in first.items()]
    return ", ".join(shown[:4]) + (", ..." if len(shown) > 4 else "")


def _evidence(text: FclText) -> Iterator[DialectEvidence]:
    block = ""
    for one in text.statements:
        match one:
            case Header(keyword=keyword):
                block = keyword.type
            case TermStatement(kind="shape", tokens=tokens):
                yield from _of_shape(tokens[0])
            case RuleStatement():
                yield from _of_rule(one)
            case Setting(keyword=keyword, words=words):
                yield from _of_setting(keyword, words, block)
            case FclRange(keyword=keyword) if block.startswith("VAR"):
                what = "RANGE among the variables"
                yield DialectEvidence("jfuzzylogic", what, keyword.line or 1)
            case _:
                pass
    for sign, dialect in _COMMENTS.items():
        before, result, _ = text.text.partition(sign)
        if result:
            line = before.count("\n") + 1
            yield DialectEvidence(dialect, f"comments {sign}", line, 1)
    if text.text.startswith("//Code automatically generated with fuzzylite"):
        yield DialectEvidence("fuzzylite", "its first line", 1)


_COMMENTS: Mapping[str, Dialect] = {"(*": "iec", "/*": "jfuzzylogic"}


def _of_shape(word: Token) -> Iterator[DialectEvidence]:
    if str(word) in CLASSES:
        yield DialectEvidence("fuzzylite", f"the term class {word}", word.line or 1, 4)
    elif word.upper() in _OF_JFUZZYLOGIC or word.upper() == "FUNCTION":
        yield DialectEvidence("jfuzzylogic", f"the shape {word}", word.line or 1, 4)


def _of_setting(
    keyword: Token, words: tuple[Token, ...], block: str
) -> Iterator[DialectEvidence]:
    line = keyword.line or 1
    for word in words:
        if word.upper() in _OF_JFUZZYLOGIC:
            yield DialectEvidence("jfuzzylogic", f"{keyword.upper()} {word}", line)
        elif word.upper() in _OF_FUZZYLITE:
            yield DialectEvidence("fuzzylite", f"{keyword.upper()} {word}", line)
    if keyword.type in ("ENABLED", "LOCK"):
        yield DialectEvidence("fuzzylite", keyword.upper(), line)
    if keyword.type == "ACCU" and block == "DEFUZZIFY":
        yield DialectEvidence("fuzzylite", "ACCU in DEFUZZIFY", line)
    elif keyword.type == "ACCU":  # fuzzylite refuses it there
        yield DialectEvidence("iec", "ACCU in RULEBLOCK", line)
        yield DialectEvidence("jfuzzylogic", "ACCU in RULEBLOCK", line, 1)
    is_default = keyword.type == "DEFAULT"
    if is_default and (words[0].upper() == "NAN" or len(words) > 1):
        shown = " | ".join(map(str, words))
        yield DialectEvidence("fuzzylite", f"DEFAULT {shown}", line)


_HEDGES = frozenset({"ANY", "VERY", "SOMEWHAT", "EXTREMELY", "SELDOM"})


def _of_rule(rule: RuleStatement) -> Iterator[DialectEvidence]:
    line = rule.keyword.line or 1
    every = list(propositions(rule.condition))
    words = [word for one in every for word in one.words[:-1]]
    is_any = any(one.words[-1].upper() == "ANY" for one in every)
    if is_any or any(word.upper() in _HEDGES for word in words):
        yield DialectEvidence("fuzzylite", "hedges", line)
    if is_lower(rule):
        yield DialectEvidence("fuzzylite", "rules in lower case", line, 1)
    elif len(rule.conclusions) > 1:
        if rule.has_comma:
            yield DialectEvidence("iec", "conclusions with ','", line, 1)
            yield DialectEvidence("jfuzzylogic", "conclusions with ','", line, 1)
        else:
            yield DialectEvidence("pyit2fls", "conclusions with AND", line)
    elif rule.is_grouped:
        yield DialectEvidence("pyit2fls", "brackets behind THEN", line)


def is_lower(rule: RuleStatement) -> bool:
    """Return whether the word behind a rule's variable is `is`."""
    return str(next(iter(propositions(rule.condition))).verb) == "is"


def propositions(condition: FclCondition) -> Iterator[FclProposition]:
    """Yield the propositions of a condition, from left to right."""
    match condition:
        case FclProposition():
            yield condition
        case FclNegation(part=part):
            yield from propositions(part)
        case FclChain(parts=parts):
            for part in parts:
                yield from propositions(part)


def norm_of(
    block: FclBlock, keyword: str, words: Mapping[str, _Norm], notes: ReaderNotes
) -> _Norm | None:
    """Return the norm that a block names behind a keyword; None if it names none."""
    for word in block.words(keyword):
        if word.upper() != "NONE" and word.upper() not in words:
            choice = name_choice(word.upper()[:99], words)
            sentence = f"no {keyword} {str(word)!r}; {choice}"
            notes.mistake(place(word), sentence)
        return words.get(word.upper())
    return None
