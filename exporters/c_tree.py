"""A tree as C: a table of tests `x > cut` and a walk through it."""

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
from fuzzytree.model import FuzzyTree, Node


@dataclass(frozen=True, slots=True)
class CTreeTest:
    """Whether a value lies above a cut, and where no and yes lead.

    A place below the number of tests is a test, and k places behind is leaf k + 1.
    """

    line: int
    cut: float
    no: int
    yes: int


def cut_tests(tree: FuzzyTree, line: Mapping[str, int]) -> list[CTreeTest]:
    """Return the tests of a tree; the first is that of the root.

    A node of several cuts becomes several tests, by halves.
    """
    starts, count = [0], 0
    for node in tree.nodes:
        count += len(node.cuts)
        starts.append(count)
    result: list[CTreeTest] = []
    for node in tree.nodes:
        targets = [
            count + branch.leaf - 1 if branch.leaf else starts[(branch.node or 1) - 1]
            for branch in node.branches
        ]
        ends = [targets[owner] for owner in node.owners]
        result += _halved(node, line[node.variable], ends, len(result))
    return result


def _halved(node: Node, line: int, ends: list[int], start: int) -> list[CTreeTest]:
    """Return a node's tests, numbered from `start`, each half behind its whole."""

    def arrange(first: int, last: int, place: int) -> list[CTreeTest]:
        middle = (first + last) // 2
        left = arrange(first, middle, place + 1) if first < middle else []
        behind = place + 1 + len(left)
        right = arrange(middle + 1, last, behind) if middle + 1 < last else []
        no = place + 1 if left else ends[first]
        yes = behind if right else ends[last]
        return [CTreeTest(line, node.cuts[middle], no, yes), *left, *right]

    return arrange(0, len(node.cuts), start)


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
/* Is the value at `line` above the cut? No and yes lead to the next two: a test, or
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
    tests = cut_tests(tree, line)
    numbered = {label: place for place, label in enumerate(tree.classes)}
    labels = [numbered[leaf.label] for leaf in tree.leaves]
    if not tests:
        plain = axes.replace("    const name_real *value = x;\n", "")
        text = _ONE_LEAF.replace("LABEL", str(labels[0]))
        yield fill(text.replace("TAKE_AXES\n", plain), prefix)
        return
    ends = [place for test in tests for place in (test.no, test.yes)]
    lines = [test.line for test in tests]
    cuts = numbers.rounded([test.cut for test in tests])
    yield fill(f"#define NAME_QUESTIONS {len(tests)}u\n\n", prefix)
    yield fill(_TABLES, prefix)
    for name, values in (("line", lines), ("next", ends), ("label", labels)):
        yield f"    {integer_type(max(values))} {name}[{len(values)}];\n"
    yield f"    {numbers.name} cut[{len(cuts)}];\n"
    yield fill("} name_tree = {\n", prefix)
    for values in (lines, ends, labels):
        yield from ("    {\n", *whole_lines(values), "    },\n")
    yield from ("    {\n", *real_lines(cuts, numbers), "    }\n};\n")
    kind = place_type(2 * len(tests) + len(labels))
    walk = _WALK.replace("PLACE_TYPE", kind).replace("TAKE_AXES\n", axes)
    yield fill(walk, prefix)
