"""What a model means, in fractions: paths, rules, strengths, predictions.

A fuzzy system is audited as rules. A rule of `a and (b or c)` becomes two rules of an
audit, its ways; under minimum or product it holds as far as the best of them. The
classes of the rules are the texts of their conclusions.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Literal, NamedTuple

from fuzzytree.auditing.recheck.audit_records import Audit, Declined, Label
from fuzzytree.auditing.recheck.enclosing import Between, bounds, hedged, joined
from fuzzytree.auditing.recheck.model_records import (
    And,
    Block,
    Branch,
    Conclusion,
    Condition,
    Is,
    Model,
    Node,
    Not,
    Or,
    Proposition,
    Rule,
    Rules,
    Scaled,
    Semantics,
    System,
    Term,
    Tree,
    Variable,
)
from fuzzytree.auditing.recheck.outcomes import (
    DoesNotHoldError,
    UndecidedError,
    require,
)
from fuzzytree.auditing.recheck.polynomials import ONE, ZERO, degree

Point = Mapping[str, Fraction]


def value_of(variable: Variable, point: Point) -> Fraction:
    """Return the value of an input or a combination at a point."""
    if not variable.parts:
        return point[variable.name]
    parts = variable.parts
    terms = (Fraction(p.weight) * (point[p.input] - Fraction(p.centre)) for p in parts)
    return sum(terms, start=ZERO)


def strengths(rules: Rules, point: Point) -> list[Fraction]:
    """Return the strength of every rule at a point."""
    variables = {v.name: v for v in rules.variables}
    shapes = {(v.name, t.name): t.function for v in rules.variables for t in v.terms}
    propositions = dict.fromkeys(
        proposition for rule in rules.rules for proposition in rule.when
    )
    degrees: dict[Proposition, Fraction] = {}
    for proposition in propositions:
        x = value_of(variables[proposition.variable], point)
        highest = max(
            degree(shapes[proposition.variable, term], x) for term in proposition.terms
        )
        degrees[proposition] = 1 - highest if proposition.negated else highest
    result = [
        [degrees[proposition] for proposition in rule.when] for rule in rules.rules
    ]
    if rules.semantics.conjunction == "product":
        return [math.prod(one, start=ONE) for one in result]
    return [min(one, default=ONE) for one in result]


def answer_of(model: Model, point: Point) -> str | None:
    """Return the class that a model gives a point; None is no class."""
    if isinstance(model, Rules):
        result = strengths(model, point)
        best = max(result)
        if best == 0:
            return model.semantics.uncovered
        return model.rules[result.index(best)].then
    return model.leaves[leaf_of(model, point) - 1].label


def leaf_of(tree: Tree, point: Point) -> int:
    """Return the number of the leaf that a point reaches."""
    variables = {v.name: v for v in tree.variables}
    branch = Branch((), (), 1, None) if tree.nodes else Branch((), (), None, 1)
    while branch.node is not None:
        node = tree.nodes[branch.node - 1]
        x = value_of(variables[node.variable], point)
        branch = node.branches[node.owners[sum(x > cut for cut in node.cuts)]]
    return branch.leaf or 0


# --- trees

Steps = tuple[tuple[Node, Branch], ...]


def paths(tree: Tree) -> Iterator[tuple[int, Steps]]:
    """Yield each leaf's number and the path to it, in the order of the leaves."""
    todo: list[tuple[int | None, int | None, Steps]]
    todo = [(1, None, ()) if tree.nodes else (None, 1, ())]
    while todo:
        node, leaf, path = todo.pop()
        if node is None:
            yield leaf or 0, path
            continue
        used = tree.nodes[node - 1]
        todo += [(b.node, b.leaf, (*path, (used, b))) for b in reversed(used.branches)]


def rules_of(tree: Tree, kind: Literal["relative", "raw"]) -> Rules:
    """Return the rules of a tree: rule k is the path to leaf k."""
    groups = {v.name: v.terms for v in tree.variables}
    if kind == "raw":
        groups = {group.variable: group.terms for group in tree.sets}
    variables = tuple(v._replace(terms=groups.get(v.name, ())) for v in tree.variables)
    rules = [
        Rule(
            tuple(
                Proposition(
                    node.variable, way.terms if kind == "relative" else way.sets
                )
                for node, way in path
            ),
            tree.leaves[number - 1].label,
            tree.leaves[number - 1].support,
        )
        for number, path in paths(tree)
    ]
    head = (tree.name, tree.classes, variables, tuple(rules), tree.semantics)
    return Rules(*head, kind, tree.columns)


MOST_WAYS = 64
Way = tuple[Proposition, ...]


class Owner(NamedTuple):
    """The rule of the system that a way belongs to."""

    number: int
    name: str
    block: Block
    when: Condition | None
    then: tuple[Conclusion, ...]
    weight: Fraction


class View:
    """The rules of a system as its audit numbers them.

    Attributes:
        rules: A rule for each way.
        owners: Whose way each rule is.
        ways: The numbers of the rules that are ways of each owner.
        names: What answers call each rule.
        silent: The names of the rules that never fire, as their text says.
        labels: The terms of the audit.
    """

    def __init__(self, system: System, audit: Audit) -> None:
        self.system = system
        answers = [one for one in audit.answers if one.code.startswith("FTD")]
        answers = [one for one in answers if isinstance(one.state, Declined)]
        self.left_out = {(one.subject, *one.terms) for one in answers}
        self.inputs = {one.name: one for one in system.inputs}
        self.conjunction = _conjunction(system)
        self.is_plain = True
        self.owners: list[Owner] = []
        self.names: list[str] = []
        self.silent: list[str] = []
        items: list[Rule] = []
        self.ways: dict[Owner, range] = {}
        for owner in _owners(system):
            ways, name = self._ways_of(owner), owner.name
            if ways:
                self.ways[owner] = range(len(items) + 1, len(items) + len(ways) + 1)
            items += [Rule(way, _text(owner.then)) for way in ways]
            self.owners += [owner] * len(ways)
            several = [f"way {n} of {name}" for n in range(1, len(ways) + 1)]
            self.names += several if len(ways) > 1 else [name] * len(ways)
        self.labels = [
            Label(one.name, label.name)
            for one in system.inputs
            for label in one.terms
            if not self._is_left_out(one.name, label.name)
        ]
        kept = dict.fromkeys(proposition for rule in items for proposition in rule.when)
        self.rules = Rules(
            system.name,
            tuple(dict.fromkeys(rule.then for rule in items)),
            tuple(_variable(one, kept) for one in system.inputs),
            tuple(items),
            Semantics(self.conjunction, None, None),
        )
        self.shapes = {
            (v.name, t.name): t.function for v in self.rules.variables for t in v.terms
        }

    def _is_left_out(self, variable: str, term: str) -> bool:
        subject = f"term {term!r} of {variable!r}"
        return (subject, Label(variable, term)) in self.left_out

    def _ways_of(self, owner: Owner) -> list[Way]:
        """Return the ways of a rule; none if it is left out, or never fires."""
        is_left_out = (owner.name,) in self.left_out
        try:
            ways = [] if not owner.weight else self._ways(owner.when, owner.block)
        except UndecidedError:
            ways = [()]
            self.is_plain &= is_left_out
        else:
            proposition = [
                (c.variable, term) for way in ways for c in way for term in c.terms
            ]
            is_easy = owner.weight == 1 and all(
                not self._is_left_out(*pair) and "\0" not in pair[1]
                for pair in proposition
            )
            text = f"{owner.name} is left out, and can be audited"
            require(not (is_left_out and is_easy), text)
        if is_left_out:
            return []
        if not ways:
            self.silent.append(owner.name)
        return ways

    def _ways(
        self, condition: Condition | None, block: Block, *, negated: bool = False
    ) -> list[Way]:
        """Return the ways in which a condition holds, or does not; none if never."""
        match condition:
            case None:
                return [()]
            case Is():
                return self._ways_of_proposition(condition, negated=negated)
            case Not(part=part):
                return self._ways(part, block, negated=not negated)
            case And(parts=(part,)) | Or(parts=(part,)):
                return self._ways(part, block, negated=negated)
            case And(parts=parts):
                is_fit = block.conjunction == "minimum" or not negated
                is_fit &= negated or block.conjunction == self.conjunction
                is_union = negated
            case Or(parts=parts):
                one = self._one_proposition(parts, block, negated=negated)
                if one is not None:
                    return [(one,)]
                is_fit = block.disjunction == "maximum"
                is_fit &= not negated or self.conjunction == "minimum"
                is_union = not negated
        if not is_fit:
            raise UndecidedError("a condition that does not hold by its ways")
        result: list[Way] = [] if is_union else [()]
        for part in parts:
            ways = self._ways(part, block, negated=negated)
            if is_union:
                result += ways
            else:
                result = [self._both(*pair) for pair in itertools.product(result, ways)]
            result = [*dict.fromkeys(result)]
            if len(result) > MOST_WAYS:
                raise UndecidedError("a condition that holds in too many ways")
        return result

    def _both(self, one: Way, other: Way) -> Way:
        both = (*one, *other)
        return tuple(dict.fromkeys(both)) if self.conjunction == "minimum" else both

    def _ways_of_proposition(self, proposition: Is, *, negated: bool) -> list[Way]:
        hedges = proposition.hedges
        while hedges[:1] == ("not",):
            negated, hedges = not negated, hedges[1:]
        if hedges[:1] == ("any",):
            return [] if negated else [()]
        known = self.inputs.get(proposition.variable)
        if known is None or proposition.label not in {one.name for one in known.terms}:
            raise UndecidedError("it uses an output")
        term = "\0".join((proposition.label or "", *hedges))
        return [(Proposition(proposition.variable, (term,), negated),)]

    def _one_proposition(
        self, parts: tuple[Condition, ...], block: Block, *, negated: bool
    ) -> Proposition | None:
        """Return `x is a or b` as one proposition, if it is that and a maximum."""
        every = [one for one in _walk(Or(parts)) if not isinstance(one, Or)]
        plain = [one for one in every if isinstance(one, Is) and one.label is not None]
        is_plain = plain == every and not any(one.hedges for one in plain)
        if block.disjunction != "maximum" or not is_plain:
            return None
        propositions = [
            self._ways_of_proposition(one, negated=False)[0][0] for one in plain
        ]
        if len({proposition.variable for proposition in propositions}) > 1:
            return None
        terms = dict.fromkeys(
            term for proposition in propositions for term in proposition.terms
        )
        return Proposition(propositions[0].variable, tuple(terms), negated)

    def questions(self) -> set[tuple[str, str]]:
        """Return the variable and term of every proposition of the rules."""
        rules = [rule for block in self.system.blocks for rule in block.rules]
        every = [one for rule in rules for one in _walk(rule.when)]
        return {(one.variable, one.label or "") for one in every if isinstance(one, Is)}

    def absent(self, name: str) -> list[int]:
        """Return the number, from 0, of a rule of which no way is taken over."""
        if any(owner.name == name for owner in self.owners):
            return []
        return [one.number for one in _owners(self.system) if one.name == name]

    def may_conflict(self, one: int, other: int) -> bool:
        """Return whether two rules say different things of one output."""
        thens = [self.owners[number - 1].then for number in (one, other)]
        entries = [{(c.output, _text((c,))) for c in then} for then in thens]
        shared = {c.output for c in thens[0]} & {c.output for c in thens[1]}
        return any(entry[0] in shared for entry in entries[0] ^ entries[1])

    def strengths(self, point: Point, numbers: Iterable[int]) -> dict[int, Between]:
        """Return between which numbers the strengths of some rules lie.

        Raises:
            DoesNotHoldError: If a rule's ways are not its own condition.
        """
        values = {v.name: value_of(v, point) for v in self.rules.variables}
        known: dict[Proposition, Between] = {}
        result: dict[int, Between] = {}
        for owner in dict.fromkeys(self.owners[number - 1] for number in numbers):
            ways = self.ways[owner]
            own = _times(owner.weight, self.condition(owner.when, owner.block, values))
            if not self.rules.rules[ways[0] - 1].when:
                result[ways[0]] = own  # of no propositions, or not of ways alone
                continue
            for number in ways:
                when = self.rules.rules[number - 1].when
                for proposition in {*when} - known.keys():
                    known[proposition] = self._degree(
                        proposition, values[proposition.variable]
                    )
                one = joined(self.conjunction, [known[c] for c in when])
                result[number] = _times(owner.weight, one)
            best = [max(result[number][end] for number in ways) for end in (0, 1)]
            if own[1] < best[0] or best[1] < own[0]:
                raise DoesNotHoldError(f"{owner.name} holds otherwise than its ways")
        return result

    def _degree(self, proposition: Proposition, x: Fraction) -> Between:
        every = [
            bounds(self.shapes[proposition.variable, t], x) for t in proposition.terms
        ]
        one = max(low for low, _ in every), max(high for _, high in every)
        return hedged("not", one) if proposition.negated else one

    def condition(
        self, condition: Condition | None, block: Block, values: Point
    ) -> Between:
        """Return between which numbers the degree of a condition lies.

        Raises:
            UndecidedError: If it uses an output.
        """
        match condition:
            case None:
                return ONE, ONE
            case Not(part=part):
                return hedged("not", self.condition(part, block, values))
            case Is(variable=variable, label=label, hedges=hedges):
                one = (ONE, ONE)
                if variable not in self.inputs:
                    raise UndecidedError("what is concluded of an output")
                for term in self.inputs[variable].terms:
                    if term.name == label:
                        whole = Scaled(term.function, term.height, ())
                        one = bounds(whole, values[variable])
                for hedge in reversed(hedges):
                    one = hedged(hedge, one)
                return one
            case And(parts=parts) | Or(parts=parts):
                is_or = isinstance(condition, Or)
                norm = block.disjunction if is_or else block.conjunction
                return joined(norm, [self.condition(p, block, values) for p in parts])


def _times(weight: Fraction, one: Between) -> Between:
    return weight * one[0], weight * one[1]


def _conjunction(system: System) -> Literal["minimum", "product"]:
    """Return the AND of most rules that have one, of minimum and product."""
    counts = {"minimum": 0, "product": 0}
    for block in system.blocks:
        norm = block.conjunction
        if norm in counts:
            parts = [[*_walk(rule.when)] for rule in block.rules]
            counts[norm] += sum(any(isinstance(p, And) for p in ps) for ps in parts)
    return "product" if counts["product"] > counts["minimum"] else "minimum"


def _walk(condition: Condition | None) -> Iterator[Condition]:
    """Yield a condition and all of its parts."""
    if condition is not None:
        yield condition
    if isinstance(condition, Not):
        yield from _walk(condition.part)
    for part in condition.parts if isinstance(condition, And | Or) else ():
        yield from _walk(part)


def _owners(system: System) -> Iterator[Owner]:
    """Yield every rule of a system."""
    number = itertools.count()
    for position, block in enumerate(system.blocks, 1):
        end = f" of block {position}" if len(system.blocks) > 1 else ""
        for index, rule in enumerate(block.rules, 1):
            weight, name = Fraction(rule.weight), f"rule {index}{end}"
            yield Owner(next(number), name, block, rule.when, rule.then, weight)


def _text(then: Iterable[Conclusion]) -> str:
    texts = (" ".join((c.output, "is", *c.hedges, c.label)) for c in then)
    return " and ".join(texts)


def _variable(one: Variable, propositions: dict[Proposition, None]) -> Variable:
    """Return an input with the terms of its propositions, hedged ones by both names."""
    curves = {label.name: label for label in one.terms}
    used = [t for c in propositions if c.variable == one.name for t in c.terms]
    terms: list[Term] = []
    for name in dict.fromkeys([*curves, *used]):
        label, *hedges = name.split("\0")
        shape = curves[label].function
        if curves[label].height != 1 or hedges:
            shape = Scaled(shape, curves[label].height, tuple(hedges))
        terms.append(Term(name, shape))
    return Variable(one.name, tuple(terms), one.unit, one.low, one.high, one.parts)
