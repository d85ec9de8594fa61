"""FCL files (IEC 61131-7) of all dialects to fuzzy systems.

Keywords may be in upper or lower case; names must be spelled alike everywhere. The
reader detects the dialect of a file and reports it in a remark with the reasons.
Engines give the same words other meanings, so each file is read as its own engine
reads it. `docs/reference/fcl.md` lists the differences.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import msgspec
from lark import Token
from msgspec.structs import replace

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats.fcl import fcl_terms
from fuzzytree.formats.fcl.fcl_dialects import (
    CHOICE,
    DEFUZZIFIERS,
    FCL_METHODS,
    FCL_SNORMS,
    Dialect,
    detect_dialect,
    is_marked,
    norm_of,
)
from fuzzytree.formats.fcl.fcl_rules import (
    FclRuleBlock,
    Scope,
    read_block,
    without_questions,
)
from fuzzytree.formats.fcl.fcl_syntax import (
    Declaration,
    FclBlock,
    FclRange,
    TermStatement,
    blocks_of,
    parsed,
    place,
)
from fuzzytree.formats.fll.fll_differences import constant_degrees, fuzzylite_losses
from fuzzytree.formats.fll.fll_terms import FllTerm, TermScope, as_degree
from fuzzytree.formats.formulas import FUZZYLITE, JFUZZYLOGIC
from fuzzytree.formats.text_files import (
    PartError,
    PositionGroup,
    Positions,
    ReaderNotes,
    locating,
    number_of,
    placed,
    positions_of,
    report,
)
from fuzzytree.model import (
    Defuzzifier,
    Document,
    FuzzySystem,
    Reading,
    Singleton,
    SystemOutput,
    Term,
    Variable,
    name_choice,
    sampled_values,
)
from fuzzytree.semantics import (
    as_rules,
    curve_degree,
    joined_by_number,
    with_flanks,
)

FACTS = " facts "
"""How the comment begins that says what rules have no place for in a system."""

_MOST_LINES = 10  # among which the facts are looked for


def read_fcl(content: bytes, name: str, *, dialect: Dialect | None = None) -> Reading:
    """Return the system of an FCL file, or the rule base that was written as one.

    Only the first FUNCTION_BLOCK is read.

    Args:
        content: The file.
        name: What messages call it.
        dialect: Whose meaning counts; what the file's words speak for unless given.

    Raises:
        ReadError: With all mistakes of the file.

    Example:
        >>> text = '''FUNCTION_BLOCK washer
        ... VAR_INPUT dirt : REAL; END_VAR
        ... VAR_OUTPUT minutes : REAL; END_VAR
        ... FUZZIFY dirt TERM much := (0, 0) (10, 1); END_FUZZIFY
        ... DEFUZZIFY minutes
        ...   TERM long := 60; METHOD : COGS; DEFAULT := 0;
        ... END_DEFUZZIFY
        ... RULEBLOCK one AND : MIN;
        ...   RULE 1 : IF dirt IS much THEN minutes IS long;
        ... END_RULEBLOCK
        ... END_FUNCTION_BLOCK'''
        >>> read_fcl(text.encode(), "washer.fcl").model.outputs[0].name
        'minutes'
    """
    text = parsed(content, name)
    notes = ReaderNotes(list(text.mistakes), remarks=list(text.remarks))
    dialect, sentence, is_certain = detect_dialect(text, dialect, notes)
    notes.remark(sentence)
    title, blocks = blocks_of(text, notes)
    known = FclVariables({}, {}, dialect, notes, is_certain)
    describe_variables(blocks, known)
    inputs = tuple(read_input(one, known) for one in known.inputs)
    outputs = tuple(read_output(one, known) for one in known.outputs)
    labels = {one.name: [label.name for label in one.terms] for one in inputs}
    labels |= {one.name: [label.name for label in one.terms] for one in outputs}
    curved = {one.name for one in outputs if not one.defuzzifier.is_weighted}
    scope = Scope(labels, set(known.outputs), curved, dialect, notes, is_certain)
    read_blocks = _rule_blocks(blocks, scope)
    outputs = tuple(_aggregated(one, known, read_blocks) for one in outputs)
    if not outputs and not notes.mistakes:
        notes.mistake((1, 1), "the file has no VAR_OUTPUT")
    if notes.mistakes:
        raise report(name, notes.mistakes)
    rules = tuple(one.block for one in read_blocks)
    positions = functools.partial(_positions, known, read_blocks)
    try:
        system = FuzzySystem(title or "system", inputs, outputs, rules)
    except InvalidModelError as error:
        raise report(name, placed(positions(), error.mistakes)) from error
    if dialect == "jfuzzylogic":
        _note_jumps(system, notes)
    model, facts = _model(joined_by_number(system), text.text, notes)
    written_as = "iec" if dialect == "pyit2fls" else dialect  # which PyIT2FLS reads
    if not is_certain:
        notes.rivals.extend({"iec", "jfuzzylogic"} - {written_as})
    return notes.reading(model, locating(positions, facts), f"fcl:{written_as}")


def _groups(variables: Mapping[str, FclVariable]) -> Iterator[PositionGroup]:
    for one in variables.values():
        terms = one.block.terms if one.block else ()
        yield place(one.token), [place(term.name) for term in terms]


def _positions(known: FclVariables, blocks: Sequence[FclRuleBlock]) -> Positions:
    rules = ((place(one.head), map(place, one.tokens)) for one in blocks)
    return positions_of(_groups(known.inputs), _groups(known.outputs), rules)


def _model(
    system: FuzzySystem, text: str, notes: ReaderNotes
) -> tuple[Document, str | None]:
    """Return the rule base that a system stands for and its facts, or the system."""
    if not is_marked(text):
        return system, None
    facts = ""
    for line in text.split("\n", _MOST_LINES)[:_MOST_LINES]:
        if line[:2] in ("//", "(*") and line[2:].startswith(FACTS):
            facts = line[2:].removeprefix(FACTS).removesuffix("*)").strip()
    if not facts:
        return with_flanks(without_questions(system)), None
    rules = as_rules(system, facts)
    if rules is not None:
        return rules, facts
    text = "the facts in a comment belong to other rules; the file is read as a system"
    notes.remark(text)
    return with_flanks(system), None


def _rule_blocks(blocks: Sequence[FclBlock], scope: Scope) -> list[FclRuleBlock]:
    results: list[FclRuleBlock] = []
    for block in blocks:
        if block.kind != "RULEBLOCK":
            continue
        if block.is_disabled:
            text = f"line {block.line}: a disabled block is left out"
            scope.notes.remark(text)
        else:
            results.append(read_block(block, scope))
    return results


def _aggregated(
    output: SystemOutput, known: FclVariables, blocks: Sequence[FclRuleBlock]
) -> SystemOutput:
    """Return an output with the aggregation that its block, or its rules' block, says.

    Numbers are summed one by one in fuzzylite, whatever ACCU says, and everywhere if
    it says nothing.
    """
    own = known.outputs[output.name].block
    stated = [None if own is None else norm_of(own, "ACCU", FCL_SNORMS, known.notes)]
    accus = [block.accu for block in blocks if output.name in block.concluded]
    is_sum = output.defuzzifier.is_weighted or known.dialect == "jfuzzylogic"
    if any(accus):  # a block that says none does not take that of another one
        stated += [accu or ("sum" if is_sum else "maximum") for accu in accus]
    norms = [one for one in stated if one is not None]
    where = f"output {output.name!r}"
    if len(set(norms)) > 1:
        what = f"its blocks say different ACCU; {norms[0]} is taken for all rules"
        known.notes.loss(where, what)
    if output.defuzzifier.is_weighted:
        if not norms or norms[0] == "sum":
            return output
        if known.dialect in ("fuzzylite", "portable"):
            known.notes.remark(
                f"{where}: numbers are summed; fuzzylite ignores ACCU here"
            )
            return output
        return replace(output, aggregation=norms[0])
    if norms:
        return replace(output, aggregation=norms[0])
    if known.dialect == "jfuzzylogic":
        known.notes.remark(f"{where}: ACCU is missing; SUM is taken, as in jFuzzyLogic")
        return replace(output, aggregation="sum")
    if any(output.name in one.concluded for one in blocks):
        if known.is_certain:
            known.notes.remark(f"{where}: ACCU is missing; MAX is taken")
        else:
            what = "ACCU is missing: MAX is taken, and jFuzzyLogic takes SUM"
            known.notes.loss(where, f"{what}; {CHOICE}")
    return replace(output, aggregation="maximum")


def _note_jumps(system: FuzzySystem, notes: ReaderNotes) -> None:
    """Note terms that differ at jFuzzyLogic's samples, which add up rounded steps."""
    for output in system.outputs:
        if output.defuzzifier.is_weighted:
            continue
        samples = sampled_values(output)
        step = ((output.high or 0.0) - samples[0]) / len(samples)
        sums = [*itertools.accumulate([samples[0], *[step] * (len(samples) - 1)])]
        for term in output.terms:
            curve, knots = term.function, term.function.knots()
            jumps = [
                (x, step_sum)
                for x, step_sum in zip(samples, sums, strict=True)
                if any(min(x, step_sum) <= knot <= max(x, step_sum) for knot in knots)
                and abs(curve_degree(curve, x) - curve_degree(curve, step_sum)) > 1e-9
            ]
            for x, step_sum in jumps[:1]:
                what = f"it jumps between {x!r} and {step_sum!r}, where jFuzzyLogic "
                what += "looks, which adds up steps; a side with some width is safe"
                notes.loss(f"term {term.name!r} of {output.name!r}", what)


_REAL = frozenset({"REAL", "LREAL", "FLOAT"})


class FclVariable(msgspec.Struct, frozen=True):
    """A declared variable: its name, range, and the block that describes it."""

    token: Token
    low: float | None = None
    high: float | None = None
    block: FclBlock | None = None


class FclVariables(msgspec.Struct, frozen=True):
    """All variables of a file, by name, and what is found on the way."""

    inputs: dict[str, FclVariable]
    outputs: dict[str, FclVariable]
    dialect: Dialect
    notes: ReaderNotes
    is_certain: bool

    def mistake(self, token: Token, sentence: str) -> None:
        """Note a mistake at a token."""
        self.notes.mistake(place(token), sentence)


def describe_variables(blocks: Sequence[FclBlock], known: FclVariables) -> None:
    """Add the variables of a file; mistakes are noted."""
    for kind, variables in (("VAR_INPUT", known.inputs), ("VAR_OUTPUT", known.outputs)):
        for block in blocks:
            if block.kind == kind:
                _declare(block, variables, known)
    for kind, variables in (("FUZZIFY", known.inputs), ("DEFUZZIFY", known.outputs)):
        for block in blocks:
            if block.kind == kind:
                _describe(block, variables, known)
    for name in known.outputs:
        if name in known.inputs:
            token = known.outputs[name].token
            known.mistake(token, f"{name!r} is an input and an output")


def _declare(
    block: FclBlock, variables: dict[str, FclVariable], known: FclVariables
) -> None:
    last = ""
    for one in block.statements:
        if isinstance(one, Declaration):
            for token in one.names:
                last = str(token)
                if last in variables:
                    known.mistake(token, f"{last!r} is declared twice")
                variables.setdefault(last, FclVariable(token))
            if one.kind.upper() not in _REAL:
                what = f"the type {one.kind!s} is read as REAL, without rounding"
                known.notes.loss(f"variable {last!r}", what)
        elif isinstance(one, FclRange) and last:
            low, high = _range(one, known)
            variables[last] = replace(variables[last], low=low, high=high)


def _describe(
    block: FclBlock, variables: dict[str, FclVariable], known: FclVariables
) -> None:
    token = block.head.words[0]
    name = str(token)
    if name not in variables:
        kind = "VAR_INPUT" if block.kind == "FUZZIFY" else "VAR_OUTPUT"
        choice = name_choice(name[:99], variables)
        if name in known.outputs:
            choice = "it is an output, whose terms stand in DEFUZZIFY"
        known.mistake(token, f"no variable {name!r} in {kind}; {choice}")
        return
    if variables[name].block is not None:
        known.mistake(token, f"a second {block.kind} of {name!r}")
    named = replace(variables[name], block=block)
    for one in block.statements:
        if isinstance(one, FclRange):
            low, high = _range(one, known)
            named = replace(named, low=low, high=high)
    variables[name] = named


def _range(one: FclRange, known: FclVariables) -> tuple[float | None, float | None]:
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
    name: str, block: FclBlock | None, known: FclVariables, *, is_weighted: bool = False
) -> list[FllTerm]:
    results: list[FllTerm] = []
    earlier: set[str] = set()
    names = (*known.inputs, *known.outputs)
    operators = FUZZYLITE if known.dialect == "fuzzylite" else JFUZZYLOGIC
    inputs = tuple(known.inputs)
    where = TermScope(name, inputs, names, is_weighted, operators=operators)
    for text in block.terms if block is not None else ():
        label = str(text.name)
        if label in earlier:
            known.mistake(text.name, f"a second term {label!r}")
            continue
        earlier.add(label)
        try:
            results.append(fcl_terms.read(text, where, known.dialect))
        except PartError as error:
            known.notes.mistakes.extend(error.mistakes)
            results.append(FllTerm(Term(label, Singleton(0.0)), "Constant"))
    return results


def read_input(name: str, known: FclVariables) -> Variable:
    """Return an input; mistakes are noted."""
    named = known.inputs[name]
    _note_disabled(f"input {name!r}", named, known)
    labels = tuple(term.label for term in _terms(name, named.block, known))
    return Variable(name, labels, low=named.low, high=named.high)


def _note_disabled(where: str, named: FclVariable, known: FclVariables) -> None:
    if named.block is not None and named.block.is_disabled:
        known.notes.loss(where, "it is disabled in the file, and read as enabled")


def read_output(name: str, known: FclVariables) -> SystemOutput:
    """Return an output, without its aggregation; mistakes are noted."""
    named = known.outputs[name]
    block = named.block
    if block is None:
        known.mistake(named.token, f"output {name!r} has no DEFUZZIFY")
        return SystemOutput(name, (), 0.0, 1.0, Defuzzifier("weighted average"))
    _note_disabled(f"output {name!r}", named, known)
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
    result = SystemOutput(
        name=name,
        terms=labels,
        low=low,
        high=high,
        defuzzifier=how,
        default=_default(name, block, known),
        clips=_clips(name, block, known),
    )
    if known.dialect == "fuzzylite":
        known.notes.losses.extend(fuzzylite_losses(result))
        for text in constant_degrees(result):
            known.notes.remark(text)
    return result


def _check_kinds(
    texts: Iterable[TermStatement],
    terms: Sequence[FllTerm],
    known: FclVariables,
    *,
    is_weighted: bool,
) -> None:
    """Note numbers where an area is needed, and curves where numbers are."""
    kinds = {term.label.name: term for term in terms}
    for text in texts:
        term = kinds[str(text.name)]
        is_number = text.kind == "number" or term.is_number
        if is_weighted and not is_number:
            sentence = (
                "a curve where METHOD needs numbers; write a number, or METHOD : COG"
            )
            known.mistake(text.tokens[0], sentence)
        elif text.kind == "number" and not is_weighted:
            sentence = "a number has no area; METHOD : COGS would be right"
            known.mistake(text.tokens[0], sentence)


def _estimated(
    named: FclVariable, labels: Iterable[Term], known: FclVariables
) -> tuple[float, float]:
    """Return the range that an output's terms span, where the file says none."""
    name = str(named.token)
    if known.notes.mistakes:  # a term that was not read is no reason to demand a range
        return 0.0, 1.0
    ends = [fcl_terms.extent(label.function) for label in labels]
    spans = [one for one in ends if one is not None]
    if not spans or len(spans) < len(ends) or known.dialect == "fuzzylite":
        known.mistake(named.token, f"output {name!r} needs a RANGE for its METHOD")
        return 0.0, 1.0
    low = min(low for low, _ in spans) if named.low is None else named.low
    high = max(high for _, high in spans) if named.high is None else named.high
    if not low < high:
        known.mistake(named.token, f"output {name!r} needs a RANGE for its METHOD")
        return 0.0, 1.0
    text = f"output {name!r}: RANGE is missing; its terms span {low!r} .. {high!r}"
    known.notes.remark(text)
    return low, high


def _defuzzifier(name: str, block: FclBlock, known: FclVariables) -> Defuzzifier:
    default = DEFUZZIFIERS[known.dialect]
    words = block.words("METHOD")
    if not words:
        is_number = all(one.kind == "number" for one in block.terms)
        word = "COGS" if is_number else "COG"
        known.notes.remark(f"output {name!r}: METHOD is missing; {word} is taken")
        return Defuzzifier("weighted average") if is_number else default
    method = FCL_METHODS.get(words[0].upper())
    if method is None:
        choice = name_choice(words[0].upper()[:99], FCL_METHODS)
        known.mistake(words[0], f"no method {str(words[0])!r}; {choice}")
        return Defuzzifier("weighted average")
    if method in ("weighted average", "weighted sum"):
        return Defuzzifier(method)
    result = replace(default, method=method)
    text = (
        f"output {name!r}: {result.samples} values of its range are looked at "
        f"({result.grid})"
    )
    if not known.is_certain:
        text += "; jFuzzyLogic takes 1000 (low ends), and fuzzylite 100 (middle)"
    elif known.dialect == "jfuzzylogic" and method == "bisector":
        text += "; its COA adds areas from both ends, and can end at another value"
    known.notes.remark(text)
    return result


def _default(name: str, block: FclBlock, known: FclVariables) -> float | None:
    words = block.words("DEFAULT")
    if not words:
        text = f"output {name!r}: DEFAULT is missing; NaN answers where no rule fires"
        known.notes.remark(text)
        return None
    shown = [word.upper() for word in words]
    if "NC" in shown:
        what = "NC keeps the answer of the row before; here each row stands for itself"
        known.notes.loss(f"the default of {name!r}", what)
    value = number_of(shown[0].lower())
    is_wrong = value is None and shown[0] != "NC"
    if is_wrong or (len(shown) > 1 and shown[1] != "NC"):
        word = words[0] if is_wrong else words[1]
        known.mistake(word, f"found {str(word)!r}; expected a number or NC")
    return value if value is not None and math.isfinite(value) else None


def _clips(name: str, block: FclBlock, known: FclVariables) -> bool:
    words = block.words("LOCK")
    for word in words:
        if word.upper() not in ("PREVIOUS", "RANGE"):
            known.mistake(word, f"found {str(word)!r}; expected PREVIOUS or RANGE")
    if any(word.upper() == "PREVIOUS" for word in words):
        what = "LOCK keeps the answer of the row before; each row stands for itself"
        known.notes.loss(f"the default of {name!r}", what)
    return any(word.upper() == "RANGE" for word in words)
