"""YAML to a rule base, a tree or a system; see `docs/reference/yaml-format.md`."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, TypeVar

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats.text_files import MOST_SHOWN, FileMistake, report
from fuzzytree.formats.yaml import layout, values
from fuzzytree.formats.yaml.binding import (
    Entries,
    bind,
    entries,
    find,
    located,
    not_a_list,
    record,
    record_at,
    records_at,
    value_of,
    variables_at,
)
from fuzzytree.formats.yaml.layout import RuleBaseFile, TreeFile
from fuzzytree.formats.yaml.nodes import ListNode, MappingNode, Node, Scalar, compose
from fuzzytree.model import (
    Conclusion,
    Condition,
    Document,
    FuzzySystem,
    FuzzyTree,
    Mistake,
    Path,
    Proposition,
    Reading,
    Rule,
    RuleBase,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Variable,
    naming_mistakes,
    node_mistakes,
    variable_mistakes,
)

R = TypeVar("R")


def read_yaml(content: bytes, name: str) -> Reading:
    """Return the rule base, tree or system of a YAML file.

    Raises:
        ReadError: If the file is no model; it lists all mistakes with their places.

    Example:
        >>> from fuzzytree.exporters.yaml import write
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> read_yaml(write(tree).content, "tree.yaml").model == tree
        True
    """
    root, mistakes = mapping_of_format(content, name, layout.YAML_FORMAT, "model")
    try:
        model = _READERS[_kind(root)](root, mistakes)
    except _UnreadableError as error:
        raise report(name, [*mistakes, *error.mistakes]) from error.__cause__
    if mistakes or model is None:
        raise report(name, mistakes)

    def locate(path: Path) -> tuple[int, int]:
        node = find(root, path)
        return node.line, node.column

    return Reading(model, locate=locate)


class _UnreadableError(Exception):
    """What stops a file from being read at all."""

    def __init__(self, *mistakes: FileMistake) -> None:
        self.mistakes = mistakes
        super().__init__()


def mapping_of_format(
    content: bytes, name: str, known: str, noun: str
) -> tuple[MappingNode, list[FileMistake]]:
    """Return the mapping that a YAML file is, and mistakes of its syntax.

    Raises:
        ReadError: If it is none, or does not say that its format is `known`.
    """
    root, mistakes = compose(content, name)
    if not isinstance(root, MappingNode):
        text = f"a {noun} must be a mapping that begins with 'format: {known}'"
        raise report(name, [*mistakes, (root.line, root.column, text)])
    node = value_of(root, "format")
    if node is None:
        text = f"no 'format: {known}' says what this file is"
        raise report(name, [*mistakes, (root.line, root.column, text)])
    value = node.text if isinstance(node, Scalar) else ""
    if value == known:
        return root, mistakes
    text = f"'format' must be {known!r}"
    if re.fullmatch(known.removesuffix("1") + "[1-9][0-9]{0,8}", value):
        text = (
            f"a file of format {value!r} needs a newer fuzzytree, one that reads "
            f"{value!r}; this one reads {known!r}"
        )
    elif value.startswith("fuzzytree/"):
        what = f"{value!r} is none that this fuzzytree reads"
        is_model = known == layout.YAML_FORMAT
        text = f"{what if is_model else f'this is a model, and no {noun}'}; {text}"
    raise report(name, [*mistakes, (node.line, node.column, text)])


def _kind(root: MappingNode) -> str:
    node = value_of(root, "kind")
    if isinstance(node, Scalar) and node.text in _READERS:
        return node.text
    place = node or root
    text = "'kind' must be 'rule base', 'tree' or 'system'"
    raise _UnreadableError((place.line, place.column, text))


def _rule_base(root: MappingNode, file_mistakes: list[FileMistake]) -> RuleBase | None:
    kept = entries(root, RuleBaseFile, file_mistakes)
    head = record(kept, layout.RuleBaseHead, file_mistakes)
    semantics = record_at(kept, "semantics", layout.RuleSemantics, file_mistakes)
    bound = records_at(kept, "rules", layout.RuleOfModel, file_mistakes)
    broken: set[Path] = set()
    mistakes: list[Mistake] = []
    variables = _variables(kept, (file_mistakes, mistakes), broken)
    rules = _rules(bound or [], head.classes if head else ("",), mistakes)
    file_mistakes += located(root, mistakes)
    if head is None or bound is None or variables is None:
        return None
    return _built(
        lambda: RuleBase(
            name=head.name,
            classes=head.classes,
            variables=variables,
            rules=rules,
            semantics=values.semantics(semantics),
            kind=head.terms,
            columns=head.columns,
        ),
        root, file_mistakes, broken,
    )  # fmt: skip


def _rules(
    bound: list[layout.RuleOfModel | None],
    classes: Sequence[str],
    mistakes: list[Mistake],
) -> tuple[Rule, ...]:
    """Return the rules, with one that is always right in the place of a broken one."""
    known: dict[str, Condition | None] = {}
    rules: list[Rule] = []
    for position, one in enumerate(bound):
        if one is None:
            rules.append(Rule((), classes[0]))
            continue
        path: Path = ("rules", position)
        when = values.conditions(path, one.if_, known, mistakes)
        propositions = tuple(part for part in when if isinstance(part, Proposition))
        if len(propositions) < len(when):
            text = (
                "only a fuzzy system joins propositions; a rule base has 'VARIABLE is "
                "TERM or TERM', or the same with 'is not'"
            )
            mistakes.append(((*path, "when"), f"rule {position + 1}: {text}"))
        shares = values.probabilities(path, one.probabilities, classes, mistakes)
        rows = values.counts(path, one.counts, classes, mistakes)
        rules.append(Rule(propositions, one.then, one.support, shares, rows))
    return tuple(rules)


def _tree(root: MappingNode, file_mistakes: list[FileMistake]) -> FuzzyTree | None:
    kept = entries(root, TreeFile, file_mistakes)
    head = record(kept, layout.TreeHead, file_mistakes)
    semantics = record_at(kept, "semantics", layout.TreeSemantics, file_mistakes)
    questions = records_at(kept, "nodes", layout.NodeOfTree, file_mistakes)
    ends = records_at(kept, "leaves", layout.End, file_mistakes)
    groups = records_at(kept, "sets", layout.SetsOfVariable, file_mistakes)
    broken: set[Path] = set()
    wrong: list[Mistake] = []
    variables = _variables(kept, (file_mistakes, wrong), broken)
    if questions is not None and ends is not None:
        wrong += _number_mistakes(questions, ends)
    nodes, kept_ends, fitted = _whole(questions), _whole(ends), _whole(groups)
    tree_nodes = tuple(map(values.node, nodes or ()))
    sets = tuple(
        values.sets(("sets", place), one, wrong)
        for place, one in enumerate(fitted or ())
    )
    ends_of = head.classes if head else ()
    leaves = tuple(
        values.leaf(("leaves", place), one, ends_of, wrong)
        for place, one in enumerate(kept_ends or ())
    )
    file_mistakes += located(root, wrong)
    if head is None or variables is None:
        return None
    meaning = values.semantics(semantics)
    if nodes is None or kept_ends is None or fitted is None or broken:
        of_nodes = node_mistakes(
            tree_nodes, variables, None if fitted is None else sets
        )
        mistakes = [
            *naming_mistakes(head.name, head.classes, meaning),
            *variable_mistakes(variables, head.columns),
            *itertools.islice(of_nodes, MOST_SHOWN),
        ]
        file_mistakes += located(root, mistakes, broken)
        return None
    return _built(
        lambda: FuzzyTree(
            name=head.name,
            classes=head.classes,
            variables=variables,
            nodes=tree_nodes,
            leaves=leaves,
            sets=sets,
            semantics=meaning,
            columns=head.columns,
        ),
        root, file_mistakes, broken,
    )  # fmt: skip


def _system(root: MappingNode, file_mistakes: list[FileMistake]) -> FuzzySystem | None:
    kept = entries(root, layout.SystemFile, file_mistakes)
    head = record(kept, layout.SystemHead, file_mistakes)
    record_at(kept, "semantics", layout.SystemSemantics, file_mistakes)
    broken: set[Path] = set()
    mistakes: list[Mistake] = []
    both = file_mistakes, mistakes
    variables = _variables(kept, both, broken)
    outputs = variables_at(
        *(kept, "outputs", layout.OutputOfSystem, values.output, values.bare_output),
        both,
        broken,
    )
    blocks = _blocks(kept, both, broken, _spare(outputs or ()))
    file_mistakes += located(root, mistakes)
    if head is None or variables is None or outputs is None or blocks is None:
        return None
    return _built(
        lambda: FuzzySystem(head.name, variables, outputs, blocks, head.note or ""),
        root, file_mistakes, broken,
    )  # fmt: skip


def _spare(outputs: Sequence[SystemOutput]) -> SystemRule | None:
    """Return a rule that is always right, to stand in the place of a broken one."""
    for output in outputs:
        for label in output.terms:
            return SystemRule(None, (Conclusion(output.name, label.name),))
    return None


def _blocks(
    kept: Entries,
    mistakes: tuple[list[FileMistake], list[Mistake]],
    broken: set[Path],
    spare: SystemRule | None,
) -> tuple[RuleBlock, ...] | None:
    """Return the blocks; a broken one has operators that are never wrong.

    In the place of a broken rule stands the spare one; None is returned without it.
    """
    file_mistakes, wrong = mistakes
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
            rule = values.system_rule(path, one, known, wrong)
            if rule is None:
                broken.add(path)
                rule = spare
            if rule is None:
                return None
            rules.append(rule)
        blocks.append(values.block(head, tuple(rules)))
    return tuple(blocks)


M = TypeVar("M", RuleBase, FuzzyTree, FuzzySystem)


def _built(
    build: Callable[[], M],
    root: Node,
    file_mistakes: list[FileMistake],
    broken: set[Path],
) -> M | None:
    """Return the model, or None after adding what is wrong with it."""
    try:
        return build()
    except InvalidModelError as error:
        file_mistakes += located(root, error.mistakes, broken)
        return None


_READERS: Final[
    Mapping[str, Callable[[MappingNode, list[FileMistake]], Document | None]]
] = {
    "rule base": _rule_base,
    "tree": _tree,
    "system": _system,
}


def _whole(items: list[R | None] | None) -> list[R] | None:
    """Return the items if none is broken."""
    kept = [item for item in items or () if item is not None]
    return None if items is None or len(kept) < len(items) else kept


def _variables(
    kept: Entries,
    mistakes: tuple[list[FileMistake], list[Mistake]],
    broken: set[Path],
) -> tuple[Variable, ...] | None:
    """Return the inputs and combinations; None if names cannot be known."""
    kind, bare = layout.VariableOfModel, values.bare_variable
    make = values.variable
    return variables_at(kept, "variables", kind, make, bare, mistakes, broken)


def _number_mistakes(
    questions: list[layout.NodeOfTree | None], ends: list[layout.End | None]
) -> Iterator[Mistake]:
    """Compare the numbers that stand in nodes and leaves with their places."""
    for place, node in enumerate(questions, 1):
        if node is not None and node.node != place:
            text = f"this is node {place} of the list, not node {node.node}"
            yield ("nodes", place - 1, "node"), text
    for place, leaf in enumerate(ends, 1):
        if leaf is not None and leaf.leaf != place:
            text = f"this is leaf {place} of the list, not leaf {leaf.leaf}"
            yield ("leaves", place - 1, "leaf"), text
