"""FLL files of fuzzylite and pyfuzzylite as systems.

`docs/reference/fll.md` describes the file and the differences between the two engines.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import PurePath
from typing import Final, Literal, NamedTuple

import msgspec
from msgspec.structs import replace

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats.fll import fll_words as fll
from fuzzytree.formats.fll.fll_differences import (
    differences,
    fuzzylite_losses,
    joined_twice,
)
from fuzzytree.formats.fll.fll_rules import FllVariable, Vocabulary, read_rule
from fuzzytree.formats.fll.fll_terms import FllTerm, TermScope, as_degree, read_term
from fuzzytree.formats.fll.fll_words import MOST_BYTES, FllEntry, FllSection, read_page
from fuzzytree.formats.text_files import (
    CONTROL,
    LONGEST_NAME,
    MOST_SHOWN,
    PartError,
    PositionGroup,
    Positions,
    ReaderNotes,
    Word,
    check_characters,
    decoded,
    locating,
    number_of,
    placed,
    positions_of,
    report,
)
from fuzzytree.model import (
    And,
    Condition,
    Defuzzifier,
    FuzzySystem,
    Not,
    Or,
    Points,
    Proposition,
    Reading,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
    printable,
)
from fuzzytree.semantics import as_written

Dialect = Literal["fuzzylite", "pyfuzzylite"]


def read_fll(content: bytes, name: str, *, dialect: Dialect | None = None) -> Reading:
    r"""Return what an FLL file says.

    Args:
        content: The file.
        name: What messages call it.
        dialect: Whose meaning counts where fuzzylite 6 and pyfuzzylite differ on how
            the numbers of a term are joined; else it is a loss.

    Raises:
        ReadError: With every mistake of the file.

    Example:
        >>> lines = ["Engine: tip", "InputVariable: food", "  term: good Ramp 0 10",
        ...          "OutputVariable: tip", "  defuzzifier: WeightedAverage",
        ...          "  term: much Constant 25", "RuleBlock:",
        ...          "  rule: if food is good then tip is much"]
        >>> read_fll("\n".join(lines).encode(), "tip.fll").model.inputs
        ('food',)
    """
    notes = ReaderNotes(dialect=dialect or "")
    text, remarks = decoded(content, name, MOST_BYTES)
    check_characters(text, name, CONTROL)
    notes.remarks.extend(remarks)
    page = read_page(text, notes)
    parts = None
    if not notes.is_full:
        parts = _system(page.sections, printable(PurePath(name).stem), notes)
    if notes.mistakes or parts is None:
        raise report(name, notes.mistakes)
    system, positions = parts
    is_own = "Written by fuzzytree." in page.comments
    system = _join_numbers(system, dialect, notes, is_own=is_own)
    for output in system.outputs if dialect == "fuzzylite" else ():
        notes.losses.extend(fuzzylite_losses(output))
    model, facts = as_written(system, page.comments)
    engine = dialect or ("pyfuzzylite" if "fuzzylite" in notes.rivals else "fuzzylite")
    return notes.reading(model, locating(positions, facts), f"fll:{engine}")


def _system(
    sections: Sequence[FllSection], stem: str, notes: ReaderNotes
) -> tuple[FuzzySystem, Callable[[], Positions]] | None:
    """Return the system; None where it has mistakes, which are noted."""
    variables = read_variables(sections, notes)
    vocabulary = vocabulary_of(variables)
    blocks = [
        read_block(section, vocabulary, notes)
        for section in sections
        if section.kind == "RuleBlock" and not notes.is_full
    ]
    if not any(one.is_output and one.is_enabled for one in variables):
        notes.mistake((1, 1), "there is no OutputVariable that is enabled")
    if notes.mistakes:
        return None
    variables, blocks = _without_disabled(variables, blocks, notes)
    _note_descriptions(sections, notes)
    outputs = [one for one in variables if one.is_output]
    inputs = [one for one in variables if not one.is_output]
    engine = next((one for one in sections if one.kind == "Engine"), None)
    positions = functools.partial(_positions, inputs, outputs, blocks)
    described = None if engine is None else engine.one_of("description")
    try:
        system = FuzzySystem(
            (engine.head.value if engine else "") or stem or "system",
            tuple(one.variable for one in inputs if isinstance(one.variable, Variable)),
            tuple(_as_meant(one, notes) for one in outputs),
            tuple(one.block for one in blocks),
            described.value if described else "",
        )
    except InvalidModelError as error:
        mistakes = error.mistakes[: MOST_SHOWN + 1]
        notes.mistakes.extend(placed(positions(), mistakes))
        return None
    notes.remarks.extend(differences(system))
    return system, positions


def _join_numbers(
    system: FuzzySystem, dialect: Dialect | None, notes: ReaderNotes, *, is_own: bool
) -> FuzzySystem:
    """Return a system whose numbers are joined as in an engine, and note which."""
    outputs = {one.name: one for one in system.outputs}
    for output, what, norm in joined_twice(system):
        if dialect is not None:
            aggregation = norm if dialect == "pyfuzzylite" else None
            outputs[output.name] = replace(output, aggregation=aggregation)
        elif is_own:  # docs/reference/fll.md says what we mean
            notes.remark(f"output {output.name!r}: {what}")
        else:
            what += "; pass --from fll:fuzzylite or --from fll:pyfuzzylite"
            notes.loss(f"output {output.name!r}", what)
            notes.rivals[:] = ["fuzzylite" if output.aggregation else "pyfuzzylite"]
    return replace(system, outputs=tuple(outputs.values()))


def _note_descriptions(sections: Sequence[FllSection], notes: ReaderNotes) -> None:
    sources = [
        one.head.value or one.kind
        for one in sections
        if one.kind != "Engine" and one.one_of("description")
    ]
    if sources:
        names = ", ".join(map(repr, sources[:5])) + (
            ", ..." if len(sources) > 5 else ""
        )
        notes.remark(f"descriptions have no place here: of {names}")


def _positions(
    inputs: Sequence[ReadVariable],
    outputs: Sequence[ReadVariable],
    blocks: Sequence[FllRuleBlock],
) -> Positions:
    """Return where the parts of the system stand."""
    return positions_of(
        (_group(one.section, [term.entry for term in one.terms]) for one in inputs),
        (_group(one.section, [term.entry for term in one.terms]) for one in outputs),
        (_group(one.section, one.lines) for one in blocks),
    )


def _group(section: FllSection, lines: Sequence[FllEntry]) -> PositionGroup:
    return section.head.position, [one.position for one in lines]


MOST_VARIABLES: Final = 2000

_DROPPED = re.compile(r"[^\w.]")


class ReadTerm(NamedTuple):
    """A term as it was read: where it stands, and which words stand for it."""

    term: FllTerm
    entry: FllEntry
    words: tuple[str, ...]


class ReadVariable(msgspec.Struct, frozen=True):
    """A variable as it was read."""

    section: FllSection
    name: str
    terms: tuple[ReadTerm, ...]
    variable: Variable | SystemOutput
    kind: str = ""
    is_enabled: bool = True

    @property
    def is_output(self) -> bool:
        """Whether rules may conclude it."""
        return isinstance(self.variable, SystemOutput)


class FllRuleBlock(msgspec.Struct, frozen=True):
    """A block as it was read, and where it and its rules stand."""

    section: FllSection
    block: RuleBlock
    lines: tuple[FllEntry, ...]
    is_enabled: bool = True


def read_variables(
    sections: Sequence[FllSection], notes: ReaderNotes
) -> list[ReadVariable]:
    """Return the inputs and outputs of a file; their mistakes are noted."""
    results = [
        one for one in sections if one.kind in ("InputVariable", "OutputVariable")
    ]
    if len(results) > MOST_VARIABLES:
        sentence = f"more variables than the {MOST_VARIABLES:,} that are read"
        notes.mistake(results[MOST_VARIABLES].head.position, sentence)
        return []
    names = [_variable_name(one, notes) for one in results]
    pairs = list(zip(names, results, strict=True))
    inputs = tuple(name for name, one in pairs if one.kind == "InputVariable")
    known: set[str] = set()
    for name, one in pairs:
        if name in known:
            notes.mistake(one.head.position, f"a second variable {name!r}")
        known.add(name)
    place = TermScope("", inputs, dict.fromkeys(names))
    return [
        _variable(one, name, msgspec.structs.replace(place, variable=name), notes)
        for name, one in pairs
        if not notes.is_full
    ]


def vocabulary_of(variables: Sequence[ReadVariable]) -> Vocabulary:
    """Return the variables by the words that stand for them in rules."""
    results: dict[str, FllVariable] = {}
    for one in variables:
        terms: dict[str, str] = {}
        for term, _, words in one.terms:
            for word in words:
                terms.setdefault(word, term.label.name)
        entry = FllVariable(one.name, terms, one.is_output)
        for word in (one.name, one.section.head.value, *_other_names(one.name)):
            results.setdefault(word, entry)
    return results


def _variable_name(section: FllSection, notes: ReaderNotes) -> str:
    source = section.head.value
    if not source or len(source) > LONGEST_NAME:
        what = (
            "a name" if not source else f"a name of at most {LONGEST_NAME} characters"
        )
        notes.mistake(section.head.position, f"{section.kind} needs {what}")
    return _cleaned(source, notes)


def _cleaned(value: str, notes: ReaderNotes) -> str:
    """Return a name without the characters that the engines drop."""
    name = _DROPPED.sub("", value) or "_"
    if name != value:
        notes.remark(f"the name {value!r} is read as {name!r}, as the engines do")
    return name


def _other_names(name: str) -> Iterator[str]:
    """Yield what the engines make of a name: one drops dots and marks digits."""
    plain = name.replace(".", "")
    yield plain
    if plain[:1].isdigit():
        yield f"_{plain}"


def _variable(
    section: FllSection, name: str, place: TermScope, notes: ReaderNotes
) -> ReadVariable:
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
    terms = _terms(section, place, notes)
    low, high = _range(section.one_of("range"), notes)
    clips = fll.truth(section.one_of("lock-range"), False, notes)
    labels = tuple(one.term.label for one in terms)
    clips = clips and not (low is None and high is None)
    variable: Variable | SystemOutput = Variable(
        name, labels, low=low, high=high, clips=clips
    )
    if how is not None:
        variable = SystemOutput(
            name,
            labels,
            low,
            high,
            how[0],
            fll.named(section.one_of("aggregation"), fll.FLL_SNORMS, notes),
            _default(section.one_of("default"), notes),
            clips,
        )
        if fll.truth(section.one_of("lock-previous"), False, notes):
            what = (
                "lock-previous: where no rule concludes it, the answer to the row "
                "before; the default answers instead"
            )
            notes.loss(f"output {name!r}", what)
    kind = "" if how is None else how[1]
    return ReadVariable(section, name, terms, variable, kind, is_enabled)


def _terms(
    section: FllSection, place: TermScope, notes: ReaderNotes
) -> tuple[ReadTerm, ...]:
    """Return the terms of a variable."""
    results: dict[str, ReadTerm] = {}
    for entry in section.all_of("term"):
        term = _term(entry, place, notes)
        if term is not None:
            name = term.label.name
            if name in results:
                what = (
                    f"the term {name!r} stands in line {entry.line} again, which "
                    "counts as in pyfuzzylite; fuzzylite 6 takes the first"
                )
                notes.loss(f"line {results.pop(name).entry.line}", what)
            words = (name, entry.words()[0].text, *_other_names(name))
            results[name] = ReadTerm(term, entry, words)
        if notes.is_full:
            break
    return (*results.values(),)


def _defuzzifier(
    section: FllSection, name: str, notes: ReaderNotes
) -> tuple[Defuzzifier, str]:
    result = fll.defuzzifier(section.one_of("defuzzifier"), notes)
    if result is not None:
        return result
    entry = section.one_of("defuzzifier") or section.head
    if fll.truth(section.one_of("enabled"), True, ReaderNotes()):
        notes.mistake(entry.position, f"output {name!r} needs a defuzzifier")
    return Defuzzifier("weighted average"), ""


def _term(entry: FllEntry, place: TermScope, notes: ReaderNotes) -> FllTerm | None:
    """Return a term; None where not even its name is known. Mistakes are noted."""
    result = entry.words()
    if len(result) < 2:
        sentence = "a term is a name, a class such as Triangle, and numbers"
        notes.mistake(entry.position, sentence)
        return None
    source, kind, *rest = result
    if len(source.text) > LONGEST_NAME:
        sentence = f"a term needs a name of at most {LONGEST_NAME} characters"
        notes.mistake(source.position, sentence)
        return None
    name = _cleaned(source.text, notes)
    try:
        formula = entry.value[rest[0].column - entry.start :] if rest else ""
        term = read_term(name, kind, rest, place, formula)
    except PartError as error:
        notes.mistakes.extend(error.mistakes)
        # Rules may use it all the same.
        return FllTerm(Term(name, Singleton(0.0)), "")
    _note_differences(term, rest, place, notes)
    return term


def _note_differences(
    term: FllTerm, rest: Sequence[Word], place: TermScope, notes: ReaderNotes
) -> None:
    """Note a term by which the two engines mean other things."""
    where = f"term {term.label.name!r} of {place.variable!r}"
    if term.kind == "Rectangle":
        start, end = (number_of(word.text) or 0.0 for word in rest[:2])
        if start > end:
            notes.remark(
                f"{where} ends before it starts: its ends are exchanged, as in "
                "pyfuzzylite; fuzzylite 6 makes it 0 everywhere"
            )
    curve = term.label.function
    if term.kind != "Discrete" or not isinstance(curve, Points):
        return
    if len(set(curve.values)) < len(curve.values):
        notes.remark(
            f"{where} has a step: at the value itself its first degree holds, as in "
            "fuzzylite 6; pyfuzzylite takes the second"
        )


def _range(
    entry: FllEntry | None, notes: ReaderNotes
) -> tuple[float | None, float | None]:
    """Return the ends of a range; None for one that is not finite."""
    if entry is None:
        return None, None
    result = entry.words()
    if len(result) != 2:
        notes.mistake(entry.position, f"a range has 2 numbers, not {len(result)}")
        return None, None
    low, high = (fll.number(word, notes) for word in result)
    if low > high:
        sentence = f"the range starts at {low!r} and ends below it, at {high!r}"
        notes.mistake(entry.position, sentence)
        return None, None
    return (
        low if math.isfinite(low) else None,
        high if math.isfinite(high) else None,
    )


def _default(entry: FllEntry | None, notes: ReaderNotes) -> float | None:
    if entry is None or entry.value == "":
        return None
    result = entry.words()
    if len(result) != 1:
        notes.mistake(entry.position, f"a default is 1 number, not {len(result)}")
        return None
    value = fll.number(result[0], notes)
    if math.isinf(value):
        notes.mistake(entry.position, "a default cannot be infinite")
    return value if math.isfinite(value) else None


def read_block(
    section: FllSection, vocabulary: Vocabulary, notes: ReaderNotes
) -> FllRuleBlock:
    """Return a block of rules; its mistakes are noted."""
    rules: list[SystemRule] = []
    lines: list[FllEntry] = []
    for entry in section.all_of("rule"):
        try:
            rules.append(read_rule(entry.words("()"), entry.end, vocabulary))
            lines.append(entry)
        except PartError as error:
            notes.mistakes.extend(error.mistakes)
        if notes.is_full:
            break
    is_enabled = fll.truth(section.one_of("enabled"), True, notes)
    if section.one_of("activation") is None and rules and is_enabled:
        notes.remark(
            f"line {section.head.line}: a block without activation is read as General"
        )
    block = RuleBlock(
        tuple(rules),
        fll.named(section.one_of("conjunction"), fll.FLL_TNORMS, notes),
        fll.named(section.one_of("disjunction"), fll.FLL_SNORMS, notes),
        fll.named(section.one_of("implication"), fll.FLL_TNORMS, notes),
        fll.activation(section.one_of("activation"), notes),
        section.head.value,
    )
    return FllRuleBlock(section, block, tuple(lines), is_enabled)


def _without_disabled(
    variables: Sequence[ReadVariable],
    blocks: Sequence[FllRuleBlock],
    notes: ReaderNotes,
) -> tuple[list[ReadVariable], list[FllRuleBlock]]:
    """Return variables and blocks without what is disabled, with remarks.

    A proposition on a disabled variable has degree 0, whatever the hedges. A disabled
    input stays a column, for formulas may name it.
    """
    for block in blocks:
        if not block.is_enabled:
            line = block.section.head.line
            notes.remark(f"line {line}: a disabled block is left out")
    kept_blocks = [one for one in blocks if one.is_enabled]
    off = [one.name for one in variables if not one.is_enabled]
    kept = [one for one in variables if one.is_enabled or not one.is_output]
    for name in off:
        text = f"{name!r} is disabled: nothing concludes it, and it is nothing"
        notes.remark(text)
    outputs = [one.name for one in kept if one.is_output]
    if not off or not outputs:
        return kept, kept_blocks
    never = Proposition(outputs[0], (), ("not", "any"))
    return kept, [_without(one, off, never, notes) for one in kept_blocks]


def _without(
    read_fll: FllRuleBlock, off: Collection[str], never: Condition, notes: ReaderNotes
) -> FllRuleBlock:
    """Return a block whose rules do not know the disabled variables."""
    rules: list[SystemRule] = []
    lines: list[FllEntry] = []
    for rule, line in zip(read_fll.block.rules, read_fll.lines, strict=True):
        then = tuple(one for one in rule.then if one.output not in off)
        when = None if rule.when is None else _condition_without(rule.when, off, never)
        if then:
            rules.append(replace(rule, when=when, then=then))
            lines.append(line)
        elif read_fll.block.activation.method not in ("general", "threshold"):
            what = "it concludes only what is disabled, and is not counted any more"
            notes.loss(f"the rule in line {line.line}", what)
    block = replace(read_fll.block, rules=tuple(rules))
    return replace(read_fll, block=block, lines=tuple(lines))


def _condition_without(
    condition: Condition, off: Collection[str], never: Condition
) -> Condition:
    match condition:
        case Proposition(variable=variable):
            return never if variable in off else condition
        case And(parts=parts):
            return And(tuple(_condition_without(part, off, never) for part in parts))
        case Or(parts=parts):
            return Or(tuple(_condition_without(part, off, never) for part in parts))
        case Not(part=part):
            return Not(_condition_without(part, off, never))


def _as_meant(output: ReadVariable, notes: ReaderNotes) -> SystemOutput:
    """Return an output whose weighted terms are numbers where the file says so.

    Fuzzylite calls it the type: `TakagiSugeno` takes the degree of every term at the
    activation, `Tsukamoto` the value at which a monotone term has that degree, and
    `Automatic` goes by the terms.
    """
    variable = output.variable
    assert isinstance(variable, SystemOutput)  # the caller selects outputs
    if not variable.defuzzifier.is_weighted:
        return variable
    terms = [one.term for one in output.terms]
    has_numbers = any(term.is_number for term in terms)
    has_monotone = any(term.is_monotone for term in terms)
    if output.kind == "Automatic" and has_numbers and has_monotone:
        what = (
            "numbers and monotone terms are mixed, which fuzzylite 6 takes by the "
            "first that is activated and pyfuzzylite refuses; each is taken by its kind"
        )
        notes.loss(f"output {output.name!r}", what)
    is_sugeno = output.kind == "TakagiSugeno"
    labels = tuple(
        as_degree(term.label) if is_sugeno or not term.is_monotone else term.label
        for term in terms
    )
    return replace(variable, terms=labels)
