"""Nodes of a YAML file to a fuzzy system; see `docs/reference/systems.md`."""

from __future__ import annotations

from collections.abc import Sequence

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats.text_files import MOST_SHOWN, FileMistake
from fuzzytree.formats.yaml import layout, values
from fuzzytree.formats.yaml.binding import (
    Entries,
    bind,
    entries,
    located,
    not_a_list,
    record,
    record_at,
    records_at,
    shortened,
    variables_at,
)
from fuzzytree.formats.yaml.conditions import SentenceError, parse_conclusions
from fuzzytree.formats.yaml.nodes import ListNode, MappingNode
from fuzzytree.model import (
    Activation,
    And,
    Conclusion,
    Condition,
    Defuzzifier,
    FuzzySystem,
    Mistake,
    Path,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Variable,
)


def read_system(
    root: MappingNode, file_mistakes: list[FileMistake]
) -> FuzzySystem | None:
    """Return the system of a file of `kind: system`, None after adding why not.

    With mistakes added it may be one with placeholders.
    """
    kept = entries(root, layout.SystemFile, file_mistakes)
    head = record(kept, layout.SystemHead, file_mistakes)
    record_at(kept, "semantics", layout.SystemSemantics, file_mistakes)
    mistakes: list[Mistake] = []
    broken: set[Path] = set()
    inputs = variables_at(
        kept,
        "variables",
        layout.VariableOfModel,
        file_mistakes,
        lambda path, one: values.variable(path, one, mistakes),
        lambda name, terms: Variable(name, values.bare(terms)),
        broken,
    )
    outputs = variables_at(
        kept,
        "outputs",
        layout.OutputOfSystem,
        file_mistakes,
        lambda path, one: _output(path, one, mistakes),
        lambda name, terms: SystemOutput(
            name, values.bare(terms), None, None, Defuzzifier("weighted sum")
        ),
        broken,
    )
    blocks = _blocks(kept, file_mistakes, mistakes, broken, _spare(outputs or ()))
    file_mistakes += located(root, mistakes)
    if head is None or inputs is None or outputs is None or blocks is None:
        return None
    try:
        return FuzzySystem(head.name, inputs, outputs, blocks, head.note or "")
    except InvalidModelError as error:
        file_mistakes += located(root, error.mistakes, broken)
        return None


def _output(
    path: Path, one: layout.OutputOfSystem, mistakes: list[Mistake]
) -> SystemOutput:
    low, high, clips = values.range_of(one.range)
    how = Defuzzifier(one.defuzzifier, one.samples, one.grid)
    labels = values.terms(path, one.terms, mistakes)
    return SystemOutput(
        *(one.name, labels, low, high, how, one.aggregation, one.default),
        clips=clips,
        unit=one.unit or "",
    )


def _spare(outputs: Sequence[SystemOutput]) -> SystemRule | None:
    """Return a rule that is always right, to stand in the place of a broken one."""
    for output in outputs:
        for label in output.terms:
            return SystemRule(None, (Conclusion(output.name, label.name),))
    return None


def _blocks(
    kept: Entries,
    file_mistakes: list[FileMistake],
    mistakes: list[Mistake],
    broken: set[Path],
    spare: SystemRule | None,
) -> tuple[RuleBlock, ...] | None:
    """Return the blocks; a broken one has operators that are never wrong.

    In the place of a broken rule stands the spare one; None is returned without it.
    """
    node = kept.get("blocks")
    if not isinstance(node, ListNode):
        if node is not None:
            not_a_list(node, "blocks", file_mistakes)
        return None
    blocks: list[RuleBlock] = []
    known: dict[str, Condition | None] = {}
    for position, item in enumerate(node.items):
        if not isinstance(item, MappingNode):
            bind(item, layout.BlockOfSystem, file_mistakes)
            return None
        own = entries(item, layout.BlockOfSystem, file_mistakes)
        head = record(own, layout.BlockHead, file_mistakes)
        bound = records_at(own, "rules", layout.RuleOfSystem, file_mistakes)
        rules: list[SystemRule] = []
        for index, one in enumerate(bound or ()):
            path: Path = ("blocks", position, "rules", index)
            rule = _rule(path, one, known, mistakes)
            if rule is None:
                broken.add(path)
                rule = spare
            if rule is None:
                return None
            rules.append(rule)
        blocks.append(_block(head, tuple(rules)))
    return tuple(blocks)


def _block(head: layout.BlockHead | None, rules: tuple[SystemRule, ...]) -> RuleBlock:
    if head is None:
        return RuleBlock(rules, "minimum", "maximum", "minimum")
    how = head.activation
    return RuleBlock(
        rules,
        head.and_,
        head.or_,
        head.implication,
        Activation(how.method, how.count, how.threshold, how.relation),
        head.name or "",
    )


def _rule(
    path: Path,
    one: layout.RuleOfSystem | None,
    known: dict[str, Condition | None],
    mistakes: list[Mistake],
) -> SystemRule | None:
    """Return a rule, or None if it is broken."""
    if one is None or len(mistakes) >= MOST_SHOWN:
        return None
    parts = values.conditions(path, one.if_, known, mistakes)
    when = And(tuple(parts)) if len(parts) > 1 else parts[0] if parts else None
    try:
        then = parse_conclusions(one.then)
    except SentenceError as error:
        mistakes.append(((*path, "then"), f"{shortened(one.then)}: {error}"))
        return None
    return SystemRule(when, then, one.weight, one.name or "")
