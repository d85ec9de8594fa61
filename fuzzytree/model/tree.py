"""What is learnt: a fuzzy decision tree as a frozen value.

Nodes and leaves lie in flat tuples and are numbered from 1: node 1 is the root,
leaf k becomes rule k. A node looks at one variable. It stores where the decision
changes (`cuts`) and which branch owns each interval between them; every interval is
open below and closed above, so a value equal to a cut goes to the left of it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar, Literal, TypeVar

import msgspec

from fuzzytree.model.nodes import Branch as Branch
from fuzzytree.model.nodes import Leaf as Leaf
from fuzzytree.model.nodes import Node as Node
from fuzzytree.model.nodes import Sets as Sets
from fuzzytree.model.probabilities import probability_mistakes
from fuzzytree.model.rulebase import (
    Band,
    LabelType,
    Mistake,
    Path,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Variable,
    naming_mistakes,
    proposition_mistakes,
    refuse,
    shapes_of,
    support_mistakes,
    term_names,
    variable_mistakes,
)
from fuzzytree.model.values import AnyModel, ModelKind, summary

if TYPE_CHECKING:
    from fuzzytree.model.contracts import Document

Learned = TypeVar("Learned", bound="FuzzyTree | RuleBase")

Use = Literal["tree", "relative", "raw"]
"""What a tree serves: its own path, its relative rules, the paper's raw rules."""


class FuzzyTree(AnyModel, frozen=True):
    """A fuzzy decision tree.

    Attributes:
        name: For people and files.
        classes: The possible answers, in the order of their numbers.
        variables: Inputs and combinations, with their relative terms; a combination
            stands after its inputs.
        nodes: Numbered from 1 in depth-first order; none if there is one leaf only.
        leaves: Numbered from 1 in the order in which a depth-first walk meets them.
        sets: The paper's fitted sets on each variable that a node tests; may be empty.
        semantics: How missing values are answered, and the AND of the tree's rules.
        columns: The columns of the training table, of which the inputs are some.

    Raises:
        InvalidModelError: If the parts contradict each other; it lists everything.
    """

    name: str
    classes: tuple[str, ...]
    variables: tuple[Variable, ...]
    nodes: tuple[Node, ...]
    leaves: tuple[Leaf, ...]
    sets: tuple[Sets, ...] = ()
    semantics: Semantics = Semantics()
    columns: tuple[str, ...] = ()

    representation: ClassVar[ModelKind] = "tree"
    outputs: ClassVar[tuple[()]] = ()  # its answers are classes
    rules: ClassVar[tuple[Rule, ...]] = ()  # one path is followed
    blocks: ClassVar[tuple[()]] = ()
    kind: ClassVar[None] = None
    note: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Refuse a tree that contradicts itself."""
        refuse(
            naming_mistakes(self.name, self.classes, self.semantics),
            variable_mistakes(self.variables, self.columns),
            _set_mistakes(self),
            _leaf_mistakes(self),
            node_mistakes(self.nodes, self.variables, self.sets),
            probability_mistakes(
                "leaves",
                [leaf.probabilities for leaf in self.leaves],
                len(self.classes),
                self.semantics.sharpness,
            ),
        )
        refuse(_order_mistakes(self), _plateau_mistakes(self))

    @property
    def rule_labels(self) -> tuple[str, ...]:
        """The class of each leaf, in order."""
        return tuple(leaf.label for leaf in self.leaves)

    def rule_path(self, number: int) -> Path:
        """Return where the leaf of a number, from 1, stands in the model."""
        return ("leaves", number - 1)

    def __repr__(self) -> str:
        """Show how much it holds; `str` shows the outline."""
        return summary(
            "FuzzyTree",
            nodes=len(self.nodes),
            leaves=len(self.leaves),
            inputs=len(self.inputs),
            classes=len(self.classes),
        )

    def __str__(self) -> str:
        """Show the tree as an indented outline."""
        return "\n".join(outline(self))


def with_label_type(
    model: Learned, label_type: LabelType | msgspec.UnsetType
) -> Learned:
    """Return a tree or rules whose class names stand for labels of a type."""
    semantics = msgspec.structs.replace(model.semantics, label_type=label_type)
    return msgspec.structs.replace(model, semantics=semantics)


def depth(tree: Document) -> int:
    """Return how many nodes the longest path of a tree has."""
    # Nodes stand before those below them.
    depths = [1] * len(tree.nodes)
    for number, node in enumerate(tree.nodes):
        for branch in node.branches:
            if branch.node is not None:
                depths[branch.node - 1] = depths[number] + 1
    return max(depths, default=0)


def root_of(tree: Document) -> Branch:
    """Return the way to the first node of a tree, or to its only leaf."""
    return Branch((), node=1) if tree.nodes else Branch((), leaf=1)


def leaf_paths(tree: FuzzyTree) -> list[tuple[int, ...]]:
    """Return the numbers of the nodes that lead to each leaf, its own last.

    Nodes and leaves are numbered together, depth-first from 0.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> leaf_paths(random_tree(1, leaves=2))
        [(0, 1), (0, 2)]
    """
    paths: list[tuple[int, ...]] = [()] * len(tree.leaves)
    todo: list[tuple[Branch, tuple[int, ...]]] = [(root_of(tree), ())]
    for number in range(len(tree.nodes) + len(tree.leaves)):
        branch, above = todo.pop()
        path = (*above, number)
        if branch.node is None:
            paths[(branch.leaf or 1) - 1] = path
        else:
            branches = reversed(tree.nodes[branch.node - 1].branches)
            todo.extend((child, path) for child in branches)
    return paths


def outline(tree: FuzzyTree) -> Iterator[str]:
    """Yield the tree line by line, two spaces a level, branches in interval order."""
    todo = [(0, root_of(tree))]
    while todo:
        depth, branch = todo.pop()
        label = " or ".join(branch.terms) + ": " if branch.terms else ""
        start = "  " * depth + label
        if branch.node is None:
            end = tree.leaves[(branch.leaf or 1) - 1]
            pattern = f" ({end.pattern})" if end.pattern not in ("", end.label) else ""
            yield f"{start}{end.label}{pattern} [{branch.leaf}]"
            continue
        node = tree.nodes[branch.node - 1]
        cuts = ", ".join(f"{cut:.6g}" for cut in node.cuts)
        yield f"{start}{node.variable}? (cut at {cuts})"
        todo.extend((depth + 1, way) for way in reversed(node.branches))


def interval_names(nodes_cuts: Sequence[Sequence[float]]) -> list[list[str]]:
    """Return a name for each interval of each node that tests one variable.

    A variable with at most four different cuts has words for what lies between them,
    such as low, medium and high. Otherwise an interval is named by its bounds, with as
    few digits (three at least) as tell all the cuts apart.

    Args:
        nodes_cuts: The cuts of each node that tests the variable.

    Example:
        >>> interval_names([[2.45]])
        [['low', 'high']]
        >>> interval_names([[2.45], [4.75]])
        [['low', 'medium or high'], ['low or medium', 'high']]
    """
    every = sorted({cut for cuts in nodes_cuts for cut in cuts})
    if len(every) in _WORDS:
        return [_in_words(cuts, every) for cuts in nodes_cuts]
    text = _short_numbers({*every})
    names: list[list[str]] = []
    for cuts in nodes_cuts:
        shown = [text[cut] for cut in cuts]
        inner = [f"{a} to {b}" for a, b in itertools.pairwise(shown)]
        names.append([f"below {shown[0]}", *inner, f"above {shown[-1]}"])
    return names


_WORDS = {
    1: ("low", "high"),
    2: ("low", "medium", "high"),
    3: ("very low", "low", "high", "very high"),
    4: ("very low", "low", "medium", "high", "very high"),
}
"""What lies between so many cuts, in words."""


def _in_words(cuts: Sequence[float], every: Sequence[float]) -> list[str]:
    places = [0, *(every.index(cut) + 1 for cut in cuts), len(every) + 1]
    words = _WORDS[len(every)]
    return [" or ".join(words[a:b]) for a, b in itertools.pairwise(places)]


def _short_numbers(values: set[float]) -> dict[float, str]:
    text: dict[float, str] = {}
    for digits in range(3, 18):
        text = {value: f"{value:.{digits}g}" for value in values}
        if len(set(text.values())) == len(values):
            break
    return text


def _set_mistakes(tree: FuzzyTree) -> Iterator[Mistake]:
    names = {variable.name for variable in tree.variables}
    for position, group in enumerate(tree.sets):
        path: Path = ("sets", position)
        if group.variable not in names:
            yield (*path, "variable"), f"sets of an unknown variable {group.variable!r}"
        for _, sentence in variable_mistakes((Variable(group.variable, group.terms),)):
            yield (*path, "terms"), f"sets: {sentence}"


def _leaf_mistakes(tree: FuzzyTree) -> Iterator[Mistake]:
    if not tree.leaves:
        yield ("leaves",), "a tree needs at least one leaf"
    classes = set(tree.classes)
    for number, leaf in enumerate(tree.leaves, 1):
        if leaf.label not in classes:
            yield (
                ("leaves", number - 1, "label"),
                f"leaf {number}: no class {leaf.label!r}",
            )
        path: Path = ("leaves", number - 1)
        yield from support_mistakes(path, f"leaf {number}", leaf, len(classes))


def node_mistakes(
    nodes: Sequence[Node], variables: Iterable[Variable], groups: Sequence[Sets] | None
) -> Iterator[Mistake]:
    """Yield what is wrong with nodes; fitted sets of None are not looked at."""
    terms = term_names(variables)
    sets = term_names(Variable(s.variable, s.terms) for s in groups or ())
    for number, node in enumerate(nodes, 1):
        path: Path = ("nodes", number - 1)
        where = f"node {number}"
        if node.variable not in terms:
            yield (*path, "variable"), f"{where}: no variable {node.variable!r}"
            continue
        yield from _cut_mistakes(path, where, node)
        for index, branch in enumerate(node.branches):
            step = (*path, "branches", index)
            proposition = Proposition(node.variable, branch.terms)
            yield from proposition_mistakes(step, where, proposition, terms)
            if groups is not None and (branch.sets or groups):
                proposition = Proposition(node.variable, branch.sets)
                yield from proposition_mistakes(
                    step, f"{where}, sets", proposition, sets
                )
            if (branch.node is None) == (branch.leaf is None):
                yield step, f"{where}: a branch leads to one node or to one leaf"


def _cut_mistakes(path: Path, where: str, node: Node) -> Iterator[Mistake]:
    cuts = node.cuts
    if not all(map(math.isfinite, cuts)) or any(
        a >= b for a, b in itertools.pairwise(cuts)
    ):
        yield (*path, "cuts"), f"{where}: the cuts must be finite and increase"
    if len(node.owners) != len(cuts) + 1:
        yield (
            (*path, "owners"),
            f"{where}: {len(cuts)} cuts make {len(cuts) + 1} intervals, "
            f"but {len(node.owners)} have an owner",
        )
    if any(a == b for a, b in itertools.pairwise(node.owners)):
        yield (*path, "owners"), f"{where}: a cut lies within one branch"
    if set(node.owners) != set(range(len(node.branches))):
        yield (*path, "owners"), f"{where}: every branch must own an interval"
    if len(node.branches) < 2:
        yield (*path, "branches"), f"{where}: a node needs two branches"


def _order_mistakes(tree: FuzzyTree) -> Iterator[Mistake]:
    """Walk depth-first and expect nodes and leaves in the order of their numbers."""
    nodes = leaves = 0
    todo = [root_of(tree)]
    while todo:
        branch = todo.pop()
        if branch.leaf is not None:
            leaves += 1
            if branch.leaf != leaves:
                text = f"leaf {branch.leaf} stands where leaf {leaves} should"
                yield ("nodes",), text
                return
        elif branch.node is not None:
            nodes += 1
            if branch.node != nodes or nodes > len(tree.nodes):
                text = f"node {branch.node} stands where node {nodes} should"
                yield ("nodes",), text
                return
            todo.extend(reversed(tree.nodes[nodes - 1].branches))
    if nodes != len(tree.nodes) or leaves != len(tree.leaves):
        yield (
            ("nodes",),
            f"the root reaches {nodes} of {len(tree.nodes)} nodes "
            f"and {leaves} of {len(tree.leaves)} leaves",
        )


def intervals(node: Node) -> tuple[tuple[float | None, float | None], ...]:
    """Return the open lower and closed upper end of each interval of a node."""
    return tuple(zip((None, *node.cuts), (*node.cuts, None), strict=True))


def _plateau_mistakes(tree: FuzzyTree) -> Iterator[Mistake]:
    """Compare each branch's plateaus with its intervals: this makes rules = tree."""
    shapes = shapes_of(tree.variables)
    for number, node in enumerate(tree.nodes, 1):
        owned: list[list[tuple[float | None, float | None]]]
        owned = [[] for _ in node.branches]
        for owner, interval in zip(node.owners, intervals(node), strict=True):
            owned[owner].append(interval)
        for index, branch in enumerate(node.branches):
            result = [shapes[node.variable, name] for name in branch.terms]
            plateaus = [(s.low, s.high) for s in result if isinstance(s, Band)]
            if plateaus != owned[index]:
                yield (
                    ("nodes", number - 1, "branches", index, "terms"),
                    f"node {number}: the plateaus of branch {index + 1} are not "
                    "the intervals that it owns",
                )
