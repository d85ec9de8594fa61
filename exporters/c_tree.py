"""A tree as C: a table of questions `x > cut` and a walk through it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from fuzzytree.exporters.c_text import (
    CNumbers,
    fill,
    integer_type,
    place_type,
    real_lines,
    whole_lines,
)
from fuzzytree.model.tree import FuzzyTree, Node


@dataclass(frozen=True, slots=True)
class CTreeTest:
    """Whether a value lies above a cut, and where no and yes lead.

    A place below the number of questions is a question, and k places behind is leaf
    k + 1.
    """

    line: int
    cut: float
    no: int
    yes: int


def questions_of(tree: FuzzyTree, line: Mapping[str, int]) -> list[CTreeTest]:
    """Return the questions of a tree; the first is asked first.

    A node of several cuts becomes several questions, by halves.
    """
    starts, count = [0], 0
    for node in tree.nodes:
        count += len(node.cuts)
        starts.append(count)
    found: list[CTreeTest] = []
    for node in tree.nodes:
        targets = [
            count + branch.leaf - 1 if branch.leaf else starts[(branch.node or 1) - 1]
            for branch in node.branches
        ]
        ends = [targets[owner] for owner in node.owners]
        found += _halved(node, line[node.variable], ends, len(found))
    return found


def _halved(node: Node, line: int, ends: list[int], start: int) -> list[CTreeTest]:
    """Return a node's questions, numbered from `start`, each half behind its whole."""

    def lay(first: int, last: int, place: int) -> list[CTreeTest]:
        middle = (first + last) // 2
        left = lay(first, middle, place + 1) if first < middle else []
        behind = place + 1 + len(left)
        right = lay(middle + 1, last, behind) if middle + 1 < last else []
        no = place + 1 if left else ends[first]
        yes = behind if right else ends[last]
        return [CTreeTest(line, node.cuts[middle], no, yes), *left, *right]

    return lay(0, len(node.cuts), start)


_WALK = """
name_answer name_decide(const name_real *x)
{
    name_answer answer = {NAME_WHEN_MISSING, 0, NAME_MISSING};
    PLACE_TYPE place = 0;
TAKE_AXES
    do
        place = name_tree.next[
            2 * place + (value[name_tree.line[place]] > name_tree.cut[place])];
    while (place < NAME_QUESTIONS);
    answer.label = name_tree.label[place - NAME_QUESTIONS];
    answer.rule = (long)(place - NAME_QUESTIONS) + 1;
    answer.status = NAME_DECIDED;
    return answer;
}
"""

_TABLES = """\
/* Is the value at `line` above the cut? No and yes lead to the next two: a question, or
 * NAME_QUESTIONS + leaf - 1. And the class of each leaf. */
static const struct {
"""

_ONE_LEAF = """
name_answer name_decide(const name_real *x)
{
    name_answer answer = {NAME_WHEN_MISSING, 0, NAME_MISSING};
TAKE_AXES
    answer.label = LABEL;
    answer.rule = 1;
    answer.status = NAME_DECIDED;
    return answer;
}
"""


def tree_code(
    tree: FuzzyTree,
    line: Mapping[str, int],
    numbers: CNumbers,
    prefix: str,
    axes: str,
) -> Iterator[str]:
    """Yield the tables of a tree and the function that walks through them."""
    asked = questions_of(tree, line)
    numbered = {label: place for place, label in enumerate(tree.classes)}
    labels = [numbered[leaf.label] for leaf in tree.leaves]
    if not asked:
        plain = axes.replace("    const name_real *value = x;\n", "")
        text = _ONE_LEAF.replace("LABEL", str(labels[0]))
        yield fill(text.replace("TAKE_AXES\n", plain), prefix)
        return
    ends = [place for question in asked for place in (question.no, question.yes)]
    lines = [question.line for question in asked]
    cuts = numbers.nearest([question.cut for question in asked])
    yield fill(f"#define NAME_QUESTIONS {len(asked)}u\n\n", prefix)
    yield fill(_TABLES, prefix)
    for name, values in (("line", lines), ("next", ends), ("label", labels)):
        yield f"    {integer_type(max(values))} {name}[{len(values)}];\n"
    yield f"    {numbers.name} cut[{len(cuts)}];\n"
    yield fill("} name_tree = {\n", prefix)
    for values in (lines, ends, labels):
        yield from ("    {\n", *whole_lines(values), "    },\n")
    yield from ("    {\n", *real_lines(cuts, numbers), "    }\n};\n")
    kind = place_type(2 * len(asked) + len(labels))
    walk = _WALK.replace("PLACE_TYPE", kind).replace("TAKE_AXES\n", axes)
    yield fill(walk, prefix)
