"""Why a model answers one row as it does, as a page of at most 15 lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fuzzytree.auditing import Explanation, Reason, RowChange
from fuzzytree.model import printable
from fuzzytree.report.text import counted, number, some, wrapped

_WIDTH = 100
_LEAD = 11  # of a line, for what it is about
_MOST_REASONS = 5  # lines of the winning rule
_MOST_MOVES = 8
_MOST_RULES = 6  # that fire
_MOST_OUTPUTS = 4
_MOST_NAMES = 4  # inputs of a combination, and missing ones


def why_lines(explanation: Explanation) -> Iterator[str]:
    """Yield an explanation, line by line.

    Example:
        >>> from fuzzytree.auditing import explain_row
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, leaves=2)
        >>> lines = [*why_lines(explain_row(tree, dict.fromkeys(tree.inputs, 0.5)))]
        >>> [line.split()[0] for line in lines if line[0] != " "]
        ['random', 'because', 'runner-up', 'change', 'seen']
    """
    yield printable(_headline(explanation))
    sections = {
        "because": _reasons(explanation),
        "runner-up": _runner_up(explanation),
        "change": _changes(explanation),
        "fires": _fired(explanation),
        "slope": _slopes(explanation),
        "filled in": _filled(explanation),
        "seen": _seen(explanation),
    }
    for title, lines in sections.items():
        for text in lines:
            yield from wrapped(text, _WIDTH, f"{title:{_LEAD}}", " " * _LEAD)
            title = ""


def _headline(explanation: Explanation) -> str:
    if explanation.outputs:
        ends = [
            f"{share.output} {number(share.value)}" for share in explanation.outputs
        ]
        return f"{explanation.model}: {', '.join(ends)}{_status(explanation)}"
    label = "no class" if explanation.label is None else explanation.label
    text = f"{explanation.model}: {label}{_status(explanation)}"
    numbers = [
        _short(one.strength) if one.probability is None else f"{one.probability:.3f}"
        for one in explanation.classes
    ]
    if explanation.rule:
        first = explanation.classes[0]
        what = "strength" if first.probability is None else "probability"
        text += f" by rule {explanation.rule}, {what} {numbers[0]}"
        pairs = zip(explanation.classes[1:], numbers[1:], strict=True)
        others = [f"{one.label} {value}" for one, value in pairs]
        text += f"; {some(others, _MOST_NAMES)}" if others else ""
    return text


def _status(explanation: Explanation) -> str:
    texts = {
        "missing": ", as a value is missing",
        "uncovered": ", as no rule fires",
        "tie": ", the first of equally strong rules,",
    }
    return texts.get(explanation.status, "")


def _reasons(explanation: Explanation) -> list[str]:
    """Return lines of the winning rule, each proposition before what it consists of."""
    lines: list[str] = []
    for shown, reason in enumerate(explanation.because):
        degree = f" (degree {_short(reason.degree)})" if reason.degree < 1.0 else ""
        more = [_reason(reason) + degree]
        if reason.parts:
            adds = [
                f"{part.input} {part.text} adds {part.amount:+.3g}"
                for part in reason.parts
            ]
            more.append(f"= {_fitting(adds)}")
        rest = len(explanation.because) - shown
        if len(lines) + len(more) + (rest > 1) > _MOST_REASONS:
            return [*lines, f"and {counted(rest, 'more proposition')}"]
        lines += more
    return lines


def _fitting(texts: Sequence[str]) -> str:
    """Return as many texts as fit a line, and how many more there are."""
    most = len(texts)
    while most > 1 and len(some(texts, most)) > _WIDTH - _LEAD - 2:
        most -= 1
    return some(texts, most)


def _reason(reason: Reason) -> str:
    value = _short(reason.value) if reason.parts else reason.text
    text = f"{reason.proposition}: {value}"
    if reason.distance is not None:
        side = "above" if reason.distance > 0.0 else "below"
        distance = f"{_short(abs(reason.distance))} {reason.unit}".rstrip()
        distance = f"{distance} {side}" if reason.distance else "at"
        cut = _short(reason.cut or 0.0) if reason.parts else reason.cut_text
        text += f", {distance} its cut {cut}"
    return text


def _short(value: float) -> str:
    """Return a number that was computed, which needs fewer digits than a table's."""
    text = f"{value:.4g}" if abs(value) < 1e4 else number(value)
    return "<1" if text == "1" and value < 1.0 else text


def _runner_up(explanation: Explanation) -> list[str]:
    rule = explanation.runner_up
    if rule is None:
        return []
    text = f"rule {rule.rule} for {rule.label}, strength {_short(rule.strength)}"
    return [text + f", kept back by {_reason(rule.reason)}" if rule.reason else text]


def _changes(explanation: Explanation) -> list[str]:
    change, alone = explanation.change, explanation.alone
    if explanation.outputs:
        return []
    if change is None:
        return [f"none is needed: the class is {explanation.wanted} already"]
    goal = "another class" if explanation.wanted is None else explanation.wanted
    if change.verdict == "NONE":
        return [f"no change that is allowed gives {goal}: proved on the whole domain"]
    if change.cost is None:
        return [f"none to {goal} is known: {change.why}"]
    lines = [f"{_moves(change, explanation)}; {_proof(change, explanation)}"]
    if alone is not None and alone.moves:
        lines.append(f"or alone {_moves(alone, explanation)}")
    elif alone is not None:
        lines.append(f"no input alone gives {goal}: proved")
    return lines


def _moves(change: RowChange, explanation: Explanation) -> str:
    moves = [
        f"{one.old.input} {one.old.text} -> {one.new.text}" for one in change.moves
    ]
    label = "no class" if change.label is None else change.label
    each = "each by at most " if len(moves) > 1 else ""
    cost = _cost(change.cost or 0.0, explanation)
    return f"to {label}: {some(moves, _MOST_MOVES)}; {each}{cost}"


def _proof(change: RowChange, explanation: Explanation) -> str:
    if change.verdict == "PROVED":
        return "proved smallest"
    return f"no change below {_cost(change.low, explanation)} does it; {change.why}"


def _cost(cost: float, explanation: Explanation) -> str:
    if explanation.unit == "cost":
        return f"cost {number(cost)}"
    if cost == 1.0:
        return "as much as a whole range"
    return f"{100 * cost:.3g}% of its range"


def _fired(explanation: Explanation) -> list[str]:
    lines: list[str] = []
    for rule in explanation.fired[:_MOST_RULES]:
        shares = [f"{100 * one.value:.3g}% of {one.output}" for one in rule.shares]
        degree = f"rule {rule.rule}, degree {_short(rule.degree)}"
        lines.append(f"{degree}, {some(shares, 2)}: {rule.sentence}")
    rest = len(explanation.fired) - len(lines)
    return [*lines, f"and {counted(rest, 'more rule')}"] if rest else lines


def _slopes(explanation: Explanation) -> list[str]:
    return [
        f"{name}: "
        + some(
            [
                f"{one.slope:+.4g} per unit of {one.input}"
                for one in explanation.slopes
                if one.output == name
            ],
            _MOST_NAMES,
        )
        for name in [share.output for share in explanation.outputs][:_MOST_OUTPUTS]
        if explanation.slopes
    ]


def _filled(explanation: Explanation) -> list[str]:
    cells = [f"{cell.text} for a missing {cell.input}" for cell in explanation.filled]
    return [some(cells, _MOST_NAMES)] if cells else []


def _seen(explanation: Explanation) -> Sequence[str]:
    counts = {one.label: one.rows for one in explanation.classes if one.rows}
    if not counts:
        return []
    rows = ", ".join(f"{label} {count}" for label, count in counts.items())
    return [f"{counted(sum(counts.values()), 'training row')} in this rule: {rows}"]
