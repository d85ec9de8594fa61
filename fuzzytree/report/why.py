"""Why a model answers one row as it does, as a page of at most 15 lines."""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.auditing import Explanation, Reason, RowChange
from fuzzytree.model import printable
from fuzzytree.report.text import counted, number, some, wrapped

_WIDTH = 100
_LEAD = 11  # of a line, for what it is about
_MOST_REASONS = 5  # lines of the winning rule
_MOST_MOVES = 8
_MOST_RULES = 6  # that fire
_MOST_OUTPUTS = 4
_MOST_NAMES = 4  # in a list
_STATUS = {
    "missing": ", as a value is missing",
    "uncovered": ", as no rule fires",
    "tie": ", the first of equally strong rules,",
}


def why_lines(of: Explanation) -> Iterator[str]:
    """Yield an explanation, line by line.

    Example:
        >>> import fuzzytree
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, leaves=2)
        >>> lines = [*why_lines(fuzzytree.why(tree, dict.fromkeys(tree.inputs, 0.5)))]
        >>> [line.split()[0] for line in lines if line[0] != " "]
        ['random', 'because', 'runner-up', 'change', 'seen']
    """
    yield printable(_headline(of))
    filled = [f"{text} for a missing {name}" for name, text in of.filled.items()]
    counts = sorted(of.counts.items(), key=lambda pair: -pair[1])
    rows = ", ".join(f"{name} {count}" for name, count in counts if count)
    total = counted(sum(of.counts.values()), "training row")
    sections = {
        "because": [*_reasons(of)],
        "runner-up": [*_runner_up(of)],
        "change": [*_changes(of)],
        "fires": [*_fired(of)],
        "slope": [*_slopes(of)],
        "filled in": [some(filled, _MOST_NAMES)] if filled else [],
        "seen": [f"{total} in this rule: {rows}"] if rows else [],
    }
    for title, lines in sections.items():
        for text in lines:
            yield from wrapped(text, _WIDTH, f"{title:{_LEAD}}", " " * _LEAD)
            title = ""


def _headline(of: Explanation) -> str:
    ends = [f"{name} {number(value)}" for name, value in of.outputs.items()]
    label = ", ".join(ends) or of.label or "no class"
    text = f"{of.model}: {label}{_STATUS.get(of.status, '')}"
    if not of.rule or of.label is None:
        return text
    what, numbers = "strength", {k: _short(x) for k, x in of.strengths.items()}
    order = of.probabilities or of.strengths
    if of.probabilities:
        what, numbers = "probability", {k: f"{x:.3f}" for k, x in order.items()}
    others = sorted({*order} - {of.label}, key=lambda name: (-order[name], name))
    text += f" by rule {of.rule}, {what} {numbers[of.label]}"
    rest = some([f"{name} {numbers[name]}" for name in others], _MOST_NAMES)
    return f"{text}; {rest}" if rest else text


def _reasons(of: Explanation) -> Iterator[str]:
    """Yield the propositions of the winning rule, each with what it consists of."""
    room = _MOST_REASONS
    for position, reason in enumerate(of.because):
        rest = len(of.because) - position
        room -= 2 if reason.parts else 1
        if room < (rest > 1):
            yield f"and {counted(rest, 'more proposition')}"
            return
        degree = f" (degree {_short(reason.degree)})" if reason.degree < 1.0 else ""
        yield _reason(reason) + degree
        if reason.parts:
            adds = [
                f"{name} {of.row[name]} adds {amount:+.3g}"
                for name, amount in reason.parts.items()
            ]
            most = len(adds)
            while most > 1 and len(some(adds, most)) > _WIDTH - _LEAD - 2:
                most -= 1
            yield f"= {some(adds, most)}"


def _reason(reason: Reason) -> str:
    value, cut = reason.text, reason.cut_text
    if reason.parts:
        value, cut = _short(reason.value), _short(reason.cut or 0.0)
    text = f"{reason.proposition}: {value}"
    if reason.cut is None:
        return text
    distance = reason.value - reason.cut
    side = "above" if distance > 0.0 else "below"
    size = f"{_short(abs(distance))} {reason.unit}".rstrip()
    return f"{text}, {f'{size} {side}' if distance else 'at'} its cut {cut}"


def _short(value: float) -> str:
    """Return a number that was computed, which needs fewer digits than a table's."""
    text = f"{value:.4g}" if abs(value) < 1e4 else number(value)
    return "<1" if text == "1" and value < 1.0 else text


def _runner_up(of: Explanation) -> Iterator[str]:
    rule = of.runner_up
    if rule is not None:
        strength = _short(of.strengths[rule.label])
        back = f", kept back by {_reason(rule.reason)}" if rule.reason else ""
        yield f"rule {rule.rule} for {rule.label}, strength {strength}{back}"


def _changes(of: Explanation) -> Iterator[str]:
    change, alone = of.change, of.alone
    goal = "another class" if of.wanted is None else of.wanted
    if change is None:
        if not of.outputs:
            yield f"none is needed: the class is {goal} already"
    elif change.verdict == "NONE":
        yield f"no change that is allowed gives {goal}: proved on the whole domain"
    elif change.verdict == "OPEN":
        yield f"no change to {goal} is known: {change.why}"
    else:
        proof = "proved smallest"
        if change.verdict == "BOUNDED":
            low = f"no change below {_cost(change.low, of)} does it"
            proof = f"{low if change.low else 'not proved smallest'}; {change.why}"
        yield f"{_moves(change, of)}; {proof}"
    if alone is not None:
        proof = f"no input alone gives {goal}: proved"
        yield f"or alone {_moves(alone, of)}" if alone.moves else proof


def _moves(change: RowChange, of: Explanation) -> str:
    moves = [f"{move.input} {move.old} -> {move.new}" for move in change.moves]
    label = "no class" if change.label is None else change.label
    each = "each by at most " if len(moves) > 1 else ""
    return f"to {label}: {some(moves, _MOST_MOVES)}; {each}{_cost(change.cost, of)}"


def _cost(cost: float, of: Explanation) -> str:
    if of.unit == "cost":
        return f"cost {number(cost)}"
    return "a whole range" if cost == 1.0 else f"{100 * cost:.3g}% of its range"


def _fired(of: Explanation) -> Iterator[str]:
    for rule in of.fired[:_MOST_RULES]:
        shares = [
            f"{100 * part:.3g}%" if part >= 0.001 else "<0.1%"
            for part in rule.shares.values()
        ]
        shares = [
            f"{part} of {name}" for part, name in zip(shares, rule.shares, strict=True)
        ]
        degree = f"rule {rule.rule}, degree {_short(rule.degree)}"
        yield f"{degree}, {some(shares, _MOST_NAMES)}: {rule.sentence}"
    if rest := of.fired[_MOST_RULES:]:
        yield f"and {counted(len(rest), 'more rule')}"


def _slopes(of: Explanation) -> Iterator[str]:
    for output, slopes in [*of.slopes.items()][:_MOST_OUTPUTS]:
        texts = [f"{slope:+.4g} per unit of {name}" for name, slope in slopes.items()]
        if texts:
            yield f"{output}: {some(texts, _MOST_NAMES)}"
