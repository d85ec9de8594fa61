"""Variables of FCL: inputs and outputs, with their ranges, terms and methods."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import msgspec
from lark import Token
from msgspec.structs import replace

from fuzzytree.formats.engines import constant_degrees, fuzzylite_losses
from fuzzytree.formats.fcl import fcl_terms
from fuzzytree.formats.fcl.fcl_blocks import Block
from fuzzytree.formats.fcl.fcl_dialects import DEFUZZIFIERS, METHOD_WORDS, Dialect
from fuzzytree.formats.fcl.fcl_statements import Declaration, Range, TermText, place
from fuzzytree.formats.fll.fll_terms import Place, Term, TermError, as_degree
from fuzzytree.formats.fll.fll_words import Notes
from fuzzytree.formats.lines import number_of
from fuzzytree.model.contracts import Loss
from fuzzytree.model.rulebase import name_choice
from fuzzytree.model.system import (
    Defuzzifier,
    Label,
    Singleton,
    SystemInput,
    SystemOutput,
)

_REAL = frozenset({"REAL", "LREAL", "FLOAT"})


class Named(msgspec.Struct, frozen=True):
    """A declared variable: its name, range, and the block that describes it."""

    token: Token
    low: float | None = None
    high: float | None = None
    block: Block | None = None


class Known(msgspec.Struct, frozen=True):
    """All variables of a file, by name, and what is found on the way."""

    inputs: dict[str, Named]
    outputs: dict[str, Named]
    dialect: Dialect
    notes: Notes

    def mistake(self, token: Token, sentence: str) -> None:
        """Note a mistake at a token."""
        self.notes.found.append((*place(token), sentence))

    def remark(self, sentence: str) -> None:
        """Note a remark."""
        self.notes.remarks.append(sentence)

    def loss(self, where: str, what: str) -> None:
        """Note a loss."""
        self.notes.losses.append(Loss(where, what))


def known_variables(blocks: Sequence[Block], dialect: Dialect, notes: Notes) -> Known:
    """Return the variables of a file; mistakes are noted."""
    known = Known({}, {}, dialect, notes)
    for kind, found in (("VAR_INPUT", known.inputs), ("VAR_OUTPUT", known.outputs)):
        for block in blocks:
            if block.kind == kind:
                _declare(block, found, known)
    for kind, found in (("FUZZIFY", known.inputs), ("DEFUZZIFY", known.outputs)):
        for block in blocks:
            if block.kind == kind:
                _describe(block, found, known)
    for name in known.outputs:
        if name in known.inputs:
            token = known.outputs[name].token
            known.mistake(token, f"{name!r} is an input and an output")
    return known


def _declare(block: Block, found: dict[str, Named], known: Known) -> None:
    last = ""
    for one in block.statements:
        if isinstance(one, Declaration):
            for token in one.names:
                last = str(token)
                if last in found:
                    known.mistake(token, f"{last!r} is declared twice")
                found.setdefault(last, Named(token))
            if one.kind.upper() not in _REAL:
                what = f"the type {one.kind!s} is read as REAL, without rounding"
                known.loss(f"variable {last!r}", what)
        elif isinstance(one, Range) and last:
            low, high = _range(one, known)
            found[last] = replace(found[last], low=low, high=high)


def _describe(block: Block, found: dict[str, Named], known: Known) -> None:
    token = block.head.words[0]
    name = str(token)
    if name not in found:
        kind = "VAR_INPUT" if block.kind == "FUZZIFY" else "VAR_OUTPUT"
        choice = name_choice(name[:99], found)
        known.mistake(token, f"no variable {name!r} in {kind}; {choice}")
        return
    if found[name].block is not None:
        known.mistake(token, f"a second {block.kind} of {name!r}")
    named = replace(found[name], block=block)
    for one in block.statements:
        if isinstance(one, Range):
            low, high = _range(one, known)
            named = replace(named, low=low, high=high)
    found[name] = named


def _range(one: Range, known: Known) -> tuple[float | None, float | None]:
    ends = [number_of(token.lower()) for token in (one.low, one.high)]
    for token, end in zip((one.low, one.high), ends, strict=True):
        if end is None or math.isnan(end):
            known.mistake(token, f"found {str(token)!r}; expected a number")
    low, high = (None if end is None or not math.isfinite(end) else end for end in ends)
    if low is not None and high is not None and low > high:
        known.mistake(one.low, f"the range ends below its start, at {one.high}")
        return None, None
    return low, high


def _terms(
    name: str, block: Block | None, known: Known, *, is_weighted: bool = False
) -> list[Term]:
    found: list[Term] = []
    seen: set[str] = set()
    names = (*known.inputs, *known.outputs)
    where = Place(name, tuple(known.inputs), names, is_weighted)
    for text in block.terms if block is not None else ():
        label = str(text.name)
        if label in seen:
            known.mistake(text.name, f"a second term {label!r}")
            continue
        seen.add(label)
        try:
            made = fcl_terms.read(text, where, known.dialect)
        except TermError as error:
            known.notes.found.extend(error.found)
            found.append(Term(Label(label, Singleton(0.0)), "Constant"))
            continue
        if made.loss:
            known.loss(f"term {label!r} of {name!r}", made.loss)
        found.append(made.term)
    return found


def read_input(name: str, known: Known) -> SystemInput:
    """Return an input; mistakes are noted."""
    named = known.inputs[name]
    _tell_disabled(f"input {name!r}", named, known)
    labels = tuple(term.label for term in _terms(name, named.block, known))
    return SystemInput(name, labels, named.low, named.high)


def _tell_disabled(where: str, named: Named, known: Known) -> None:
    if named.block is not None and named.block.is_disabled:
        known.loss(where, "it is disabled in the file, and read as enabled")


def read_output(name: str, known: Known) -> SystemOutput:
    """Return an output, without its aggregation; mistakes are noted."""
    named = known.outputs[name]
    block = named.block
    if block is None:
        known.mistake(named.token, f"output {name!r} has no DEFUZZIFY")
        return SystemOutput(name, (), 0.0, 1.0, Defuzzifier("weighted average"))
    _tell_disabled(f"output {name!r}", named, known)
    how = _defuzzifier(name, block, known)
    terms = _terms(name, block, known, is_weighted=how.is_weighted)
    labels = tuple(
        as_degree(term.label)
        if how.is_weighted and not term.is_monotone
        else term.label
        for term in terms
    )
    low, high = named.low, named.high
    if known.dialect != "fuzzylite":
        _check_kinds(block.terms, terms, known, is_weighted=how.is_weighted)
    if not how.is_weighted and (low is None or high is None):
        low, high = _estimated(named, labels, known)
    found = SystemOutput(
        name=name,
        labels=labels,
        low=low,
        high=high,
        defuzzifier=how,
        default=_default(name, block, known),
        clips=_clips(name, block, known),
    )
    if known.dialect == "fuzzylite":
        known.notes.losses.extend(fuzzylite_losses(found))
        for text in constant_degrees(found):
            known.remark(text)
    return found


def _check_kinds(
    texts: Iterable[TermText],
    terms: Sequence[Term],
    known: Known,
    *,
    is_weighted: bool,
) -> None:
    """Note numbers where an area is asked for, and curves where numbers are."""
    kinds = {term.label.name: term for term in terms}
    for text in texts:
        term = kinds[str(text.name)]
        is_number = text.kind == "number" or term.is_number
        if is_weighted and not is_number:
            sentence = (
                "a curve where METHOD asks for numbers; write a number, or METHOD : COG"
            )
            known.mistake(text.tokens[0], sentence)
        elif text.kind == "number" and not is_weighted:
            sentence = "a number has no area; METHOD : COGS would be right"
            known.mistake(text.tokens[0], sentence)


def _estimated(
    named: Named, labels: Iterable[Label], known: Known
) -> tuple[float, float]:
    """Return the range that an output's terms span, where the file says none."""
    name = str(named.token)
    if known.notes.found:  # a term that was not read is no reason to ask for a range
        return 0.0, 1.0
    ends = [fcl_terms.extent(label.curve) for label in labels]
    spans = [one for one in ends if one is not None]
    if not spans or known.dialect == "fuzzylite":
        known.mistake(named.token, f"output {name!r} needs a RANGE for its METHOD")
        return 0.0, 1.0
    low = min(low for low, _ in spans) if named.low is None else named.low
    high = max(high for _, high in spans) if named.high is None else named.high
    if not low < high:
        known.mistake(named.token, f"output {name!r} needs a RANGE for its METHOD")
        return 0.0, 1.0
    text = f"output {name!r}: RANGE is missing; its terms span {low!r} .. {high!r}"
    known.remark(text)
    return low, high


def _defuzzifier(name: str, block: Block, known: Known) -> Defuzzifier:
    default = DEFUZZIFIERS[known.dialect]
    words = block.words("METHOD")
    if not words:
        is_number = all(one.kind == "number" for one in block.terms)
        word = "COGS" if is_number else "COG"
        known.remark(f"output {name!r}: METHOD is missing; {word} is taken")
        return Defuzzifier("weighted average") if is_number else default
    method = METHOD_WORDS.get(words[0].upper())
    if method is None:
        choice = name_choice(words[0].upper()[:99], METHOD_WORDS)
        known.mistake(words[0], f"no method {str(words[0])!r}; {choice}")
        return Defuzzifier("weighted average")
    if method in ("weighted average", "weighted sum"):
        return Defuzzifier(method)
    made = replace(default, method=method)
    text = f"output {name!r}: {made.samples} values of its range are looked at"
    if known.dialect == "jfuzzylogic":
        text += "; jFuzzyLogic takes the low ends of as many pieces, and not the middle"
    known.remark(text)
    return made


def _default(name: str, block: Block, known: Known) -> float | None:
    words = block.words("DEFAULT")
    if not words:
        text = f"output {name!r}: DEFAULT is missing; NaN answers where no rule fires"
        known.remark(text)
        return None
    shown = [word.upper() for word in words]
    if "NC" in shown:
        what = "NC keeps the answer of the row before; here each row stands for itself"
        known.loss(f"the default of {name!r}", what)
    value = number_of(shown[0].lower())
    is_wrong = value is None and shown[0] != "NC"
    if is_wrong or (len(shown) > 1 and shown[1] != "NC"):
        word = words[0] if is_wrong else words[1]
        known.mistake(word, f"found {str(word)!r}; expected a number or NC")
    return value if value is not None and math.isfinite(value) else None


def _clips(name: str, block: Block, known: Known) -> bool:
    words = block.words("LOCK")
    for word in words:
        if word.upper() not in ("PREVIOUS", "RANGE"):
            known.mistake(word, f"found {str(word)!r}; expected PREVIOUS or RANGE")
    if any(word.upper() == "PREVIOUS" for word in words):
        what = "LOCK keeps the answer of the row before; each row stands for itself"
        known.loss(f"the default of {name!r}", what)
    return any(word.upper() == "RANGE" for word in words)
