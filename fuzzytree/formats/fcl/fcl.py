"""FCL files (IEC 61131-7) of all dialects to fuzzy systems.

Keywords may be in upper or lower case; names must be written alike everywhere. The
dialect of a file is found out from the file, and told as a remark with the reasons:
engines mean other things by the same words, and each file is taken as its own engine
takes it. `docs/reference/fcl.md` lists the differences.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats.fcl.fcl_blocks import Block, blocks_of
from fuzzytree.formats.fcl.fcl_dialects import detected, is_marked, norm_of
from fuzzytree.formats.fcl.fcl_rules import (
    ReadBlock,
    Scope,
    read_block,
    without_questions,
)
from fuzzytree.formats.fcl.fcl_statements import place
from fuzzytree.formats.fcl.fcl_text import parsed
from fuzzytree.formats.fcl.fcl_variables import (
    Known,
    Named,
    known_variables,
    read_input,
    read_output,
)
from fuzzytree.formats.fll.fll_words import Notes
from fuzzytree.formats.yaml.nodes import report
from fuzzytree.formats.yaml.spots import Group, Spots
from fuzzytree.model.contracts import Document, Locate, Reading
from fuzzytree.model.system import FuzzySystem, SystemOutput
from fuzzytree.semantics.conversion import as_rules, joined_by_number

FACTS = " facts "
"""How the comment begins that says what rules have no place for in a system."""

_MOST_LINES = 10  # among which the facts are looked for


def read(content: bytes, name: str) -> Reading:
    """Return the system of an FCL file, or the rule base that was written as one.

    Only the first FUNCTION_BLOCK is read.

    Args:
        content: The file: UTF-8, or UTF-16 with its mark, or else Latin-1.
        name: What messages call it.

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
        >>> read(text.encode(), "washer.fcl").model.outputs[0].name
        'minutes'
    """
    return _read(content, name)[0]


def places(content: bytes, name: str) -> Locate:
    """Return where the parts of the model of an FCL file stand.

    A rule stands at its keyword, a term and a variable at their names.

    Raises:
        ReadError: With all mistakes of the file.
    """
    _, parts, facts = _read(content, name)
    return parts.spots().of_facts(facts).find


class _Parts(NamedTuple):
    """What the parts of a system were made of."""

    known: Known
    blocks: Sequence[ReadBlock]

    def spots(self) -> Spots:
        return Spots(
            _groups(self.known.inputs),
            _groups(self.known.outputs),
            tuple(
                Group(place(one.head), tuple(map(place, one.tokens)))
                for one in self.blocks
            ),
        )


def _groups(variables: Mapping[str, Named]) -> tuple[Group, ...]:
    return tuple(
        Group(
            place(one.token),
            tuple(place(term.name) for term in (one.block.terms if one.block else ())),
        )
        for one in variables.values()
    )


def _read(content: bytes, name: str) -> tuple[Reading, _Parts, str | None]:
    """Return what a file says, what of, and the facts of a rule base if it is one."""
    text = parsed(content, name)
    notes = Notes(list(text.found), [], [])
    dialect, sentence = detected(text)
    notes.remarks.append(sentence)
    if text.encoding != "UTF-8":
        notes.remarks.append(f"the file is no UTF-8; it was read as {text.encoding}")
    title, blocks = blocks_of(text, notes)
    known = known_variables(blocks, dialect, notes)
    inputs = tuple(read_input(one, known) for one in known.inputs)
    outputs = tuple(read_output(one, known) for one in known.outputs)
    labels = {one.name: [label.name for label in one.labels] for one in inputs}
    labels |= {one.name: [label.name for label in one.labels] for one in outputs}
    curved = {one.name for one in outputs if not one.defuzzifier.is_weighted}
    scope = Scope(labels, set(known.outputs), curved, dialect, notes)
    read_blocks = _rule_blocks(blocks, scope)
    outputs = tuple(_aggregated(one, known, read_blocks) for one in outputs)
    if not outputs and not notes.found:
        notes.found.append((1, 1, "the file has no VAR_OUTPUT"))
    if notes.found:
        raise report(name, notes.found)
    parts = _Parts(known, read_blocks)
    try:
        rules = tuple(one.block for one in read_blocks)
        system = FuzzySystem(title or "system", inputs, outputs, rules)
    except InvalidModelError as error:
        found = parts.spots().placed(error.mistakes)
        raise report(name, list(found)) from error
    model, facts = _model(joined_by_number(system), text.text, notes)
    reading = Reading(model, tuple(notes.losses), tuple(notes.remarks))
    return reading, parts, facts


def _model(system: FuzzySystem, text: str, notes: Notes) -> tuple[Document, str | None]:
    """Return the rule base that a system stands for and its facts, or the system."""
    if not is_marked(text):
        return system, None
    facts = ""
    for line in text.split("\n", _MOST_LINES)[:_MOST_LINES]:
        if line[:2] in ("//", "(*") and line[2:].startswith(FACTS):
            facts = line[2:].removeprefix(FACTS).removesuffix("*)").strip()
    if not facts:
        return without_questions(system), None
    rules = as_rules(system, facts)
    if rules is not None:
        return rules, facts
    text = "the facts in a comment belong to other rules; the file is read as a system"
    notes.remarks.append(text)
    return system, None


def _rule_blocks(blocks: Sequence[Block], scope: Scope) -> list[ReadBlock]:
    found: list[ReadBlock] = []
    for block in blocks:
        if block.kind != "RULEBLOCK":
            continue
        if block.is_disabled:
            text = f"line {block.line}: a disabled block is left out"
            scope.notes.remarks.append(text)
        else:
            found.append(read_block(block, scope))
    return found


def _aggregated(
    output: SystemOutput, known: Known, blocks: Sequence[ReadBlock]
) -> SystemOutput:
    """Return an output with the aggregation that its block, or its rules' block, says.

    Numbers are summed one by one in fuzzylite, whatever ACCU says, and everywhere if
    it says nothing.
    """
    own = known.outputs[output.name].block
    stated = [None if own is None else norm_of(own, "ACCU", known.notes)]
    stated += [one.accu for one in blocks if output.name in one.concluded]
    norms = [one for one in stated if one is not None]
    where = f"output {output.name!r}"
    if len(set(norms)) > 1:
        what = f"its blocks say different ACCU; {norms[0]} is taken for all rules"
        known.loss(where, what)
    if output.defuzzifier.is_weighted:
        if not norms or norms[0] == "sum":
            return output
        if known.dialect in ("fuzzylite", "portable"):
            known.remark(f"{where}: numbers are summed; fuzzylite ignores ACCU here")
            return output
        return replace(output, aggregation=norms[0])
    if norms:
        return replace(output, aggregation=norms[0])
    if known.dialect == "jfuzzylogic":
        known.remark(f"{where}: ACCU is missing; SUM is taken, as in jFuzzyLogic")
        return replace(output, aggregation="sum")
    if any(output.name in one.concluded for one in blocks):
        known.loss(where, "ACCU is missing, and engines differ; MAX is taken")
    return replace(output, aggregation="maximum")
