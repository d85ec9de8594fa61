"""Draw a tree, its rules and the curves of its terms as one SVG picture.

Run it from the project's folder: `.venv/bin/python examples/picture.py`. It learns on
the wine table and writes `docs/wine.svg`, the picture of the README.
"""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterator
from html import escape
from pathlib import Path

import fuzzytree as ft
from fuzzytree.model.rulebase import Band, RuleBase, Variable, sentence
from fuzzytree.model.tree import Branch, FuzzyTree
from fuzzytree.semantics.reference import degree

HERE = Path(__file__).resolve().parent
WIDTH = 960
ROW = 96  # from one level of the tree to the next
PLOT_WIDTH, PLOT_HEIGHT, PLOT_PITCH = 400, 84, 172
COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9")
STYLE = """
  text { font: 13px system-ui, sans-serif; fill: #24292f; }
  .small { font-size: 11.5px; } .faint { fill: #57606a; } .strong { font-weight: 600; }
  .line { stroke: #8c959f; fill: none; } .box { fill: #f6f8fa; stroke: #8c959f; }
  .curve { fill: none; stroke-width: 2; }
  @media (prefers-color-scheme: dark) {
    text { fill: #e6edf3; } .faint { fill: #9da7b3; }
    .box { fill: #161b22; }
  }
"""


def picture(tree: FuzzyTree, rules: RuleBase) -> str:
    """Return an SVG of a tree (left), its terms (right) and its rules (below)."""
    colours = {label: COLOURS[k % len(COLOURS)] for k, label in enumerate(tree.classes)}
    asked = [v for v in rules.variables if v.terms]
    drawn = list(_tree(tree, colours))
    for position, variable in enumerate(asked):
        drawn += _terms(tree, variable, 40 + position * PLOT_PITCH)
    levels = 1 + max(depth for _, _, depth, _ in _places(tree))
    top = 20 + max(levels * ROW, len(asked) * PLOT_PITCH)
    for line, rule in enumerate(rules.rules, 1):
        x, y = 24, top + 24 * line
        drawn.append(
            f'<circle cx="{x + 5}" cy="{y - 4}" r="5" fill="{colours[rule.then]}"/>'
        )
        drawn.append(_text(x + 18, y, f"{line}. {sentence(rule)}"))
    height = top + 24 * len(rules.rules) + 24
    body = "\n".join(drawn)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        f'width="{WIDTH}" height="{height}" role="img">\n'
        f"<title>{escape(tree.name)}: a fuzzy tree, its terms and its rules</title>\n"
        f"<style>{STYLE}</style>\n{body}\n</svg>\n"
    )


def _places(tree: FuzzyTree) -> list[tuple[Branch, float, int, int]]:
    """Return each branch with its place from 0 to 1, its depth and its parent.

    A leaf stands at its number, a node in the middle of its branches. The parent is
    a position in the list, -1 for the root.
    """
    places: list[tuple[Branch, float, int, int]] = []

    def place(branch: Branch, depth: int, parent: int) -> float:
        position = len(places)
        places.append((branch, 0.0, depth, parent))
        if branch.node is None:
            x = ((branch.leaf or 1) - 0.5) / len(tree.leaves)
        else:
            inner = tree.nodes[branch.node - 1].branches
            below = [place(one, depth + 1, position) for one in inner]
            x = (below[0] + below[-1]) / 2
        places[position] = (branch, x, depth, parent)
        return x

    start = Branch(terms=(), node=1) if tree.nodes else Branch(terms=(), leaf=1)
    place(start, 0, -1)
    return places


def _tree(tree: FuzzyTree, colours: dict[str, str]) -> Iterator[str]:
    places = _places(tree)
    points = [(24 + x * 470, 52 + depth * ROW) for _, x, depth, _ in places]
    for (branch, _, _, parent), (x, y) in zip(places, points, strict=True):
        if parent >= 0:
            above_x, above_y = points[parent]
            yield (
                f'<path class="line" d="M{above_x:.1f} {above_y + 16:.1f} '
                f'L{x:.1f} {y - 16:.1f}"/>'
            )
            side, anchor = (-8, "end") if x < above_x else (8, "start")
            middle = (above_x + x) / 2 + side, (above_y + y) / 2 + 4
            yield _text(*middle, " or ".join(branch.terms), "small faint", anchor)
    for (branch, *_), (x, y) in zip(places, points, strict=True):
        if branch.node is not None:
            label, colour = tree.nodes[branch.node - 1].variable + "?", None
        else:
            leaf = tree.leaves[(branch.leaf or 1) - 1]
            label, colour = leaf.label, colours[leaf.label]
        width = 22 + 7.4 * len(label)
        style = f'style="stroke:{colour};stroke-width:2.5"' if colour else ""
        yield (
            f'<rect class="box" {style} x="{x - width / 2:.1f}" y="{y - 16:.1f}" '
            f'width="{width:.1f}" height="32" rx="{6 if colour is None else 16}"/>'
        )
        yield _text(x, y + 4.5, label, "strong", "middle")


def _terms(tree: FuzzyTree, variable: Variable, top: float) -> Iterator[str]:
    """Draw the terms of one variable over the range where they change."""
    cuts = [cut for n in tree.nodes if n.variable == variable.name for cut in n.cuts]
    ends = [
        end
        for term in variable.terms
        if isinstance(term.shape, Band)
        for _, end in term.shape.flanks
    ]
    low, high = min([*cuts, *ends]), max([*cuts, *ends])
    margin = (high - low) * 0.12 or 1.0
    low, high = low - margin, high + margin
    left = WIDTH - PLOT_WIDTH - 24
    formula = textwrap.wrap(_formula(variable), 66)
    bottom = top + 16 + PLOT_HEIGHT + 15 * len(formula)

    def across(value: float) -> float:
        return left + (value - low) / (high - low) * PLOT_WIDTH

    yield _text(left, top, variable.name, "strong")
    for line, text in enumerate(formula, 1):
        yield _text(left, top + 15 * line, text, "small faint")
    yield f'<path class="line" d="M{left} {bottom} h{PLOT_WIDTH}"/>'
    for index, term in enumerate(variable.terms):
        colour = COLOURS[-1 - index % len(COLOURS)]
        steps = [low + (high - low) * step / 200 for step in range(201)]
        points = " ".join(
            f"{across(x):.1f},{bottom - PLOT_HEIGHT * degree(term.shape, x):.1f}"
            for x in sorted([*steps, *cuts])
        )
        yield f'<polyline class="curve" style="stroke:{colour}" points="{points}"/>'
        middle = _middle(term.shape, low, high) if isinstance(term.shape, Band) else low
        yield _text(
            across(middle), bottom - PLOT_HEIGHT - 4, term.name, "small", "middle"
        )
    for cut in cuts:
        yield (
            f'<path class="line" stroke-dasharray="3 3" '
            f'd="M{across(cut):.1f} {bottom} v-{PLOT_HEIGHT}"/>'
        )
        yield _text(across(cut), bottom + 15, f"{cut:.4g}", "small faint", "middle")


def _formula(variable: Variable) -> str:
    summands = [
        f"{'-' if part.weight < 0 else '+'} {abs(part.weight):.3g} "
        f"({part.input} - {part.centre:.4g})"
        for part in variable.parts
    ]
    return " ".join(["=", *summands]).replace("= + ", "= ") if summands else ""


def _middle(band: Band, low: float, high: float) -> float:
    return (
        (low if band.low is None else band.low)
        + (high if band.high is None else band.high)
    ) / 2


def _text(x: float, y: float, text: str, style: str = "", anchor: str = "start") -> str:
    return (
        f'<text class="{style}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">'
        f"{escape(text)}</text>"
    )


def drawn() -> str:
    """Learn on the wine table and return its picture."""
    table = HERE / "wine" / "wine.csv"
    tree = ft.learn(
        table,
        target="cultivar",
        name="wine",
        columns_per_node=1,
        leaves=4,
    )
    return picture(tree, ft.rules_from_tree(tree))


def main() -> None:
    """Write the README's picture."""
    path = HERE.parent / "docs" / "wine.svg"
    path.write_text(drawn(), "utf-8")
    sys.stdout.write(f"wrote docs/{path.name}\n")


if __name__ == "__main__":
    main()
