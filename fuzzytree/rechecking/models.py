"""A model from its YAML file, and its rules as an audit numbers them."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import PurePath
from typing import Any, NamedTuple

from fuzzytree.rechecking.curves import (
    ONE,
    ZERO,
    Curve,
    Facts,
    curve_of,
    keys,
    number_of,
)
from fuzzytree.rechecking.outcomes import CannotRunError, UndecidedError
from fuzzytree.rechecking.sentences_of_rules import (
    Condition,
    Is,
    Joint,
    read_conclusions,
    read_condition,
)
from fuzzytree.rechecking.yaml import Items, read_yaml

MOST_WAYS = 64
Place = tuple[int, int]  # line and column, from 1
Point = Mapping[str, Fraction]


class Proposition(NamedTuple):
    """`variable is a or b`, or its negation; times a weight."""

    variable: str
    terms: tuple[str, ...]
    negated: bool = False
    weight: Fraction = ONE

    def __str__(self) -> str:
        """Return it as answers show it."""
        verb = "is not" if self.negated else "is"
        return f"{self.variable} {verb} {' or '.join(self.terms)}"


class Rule(NamedTuple):
    """A rule: what must hold, and the class or the text of what it concludes."""

    when: tuple[Proposition, ...]
    then: str


class Variable(NamedTuple):
    """An input, or a combination of inputs: of each its name, weight and centre."""

    name: str
    curves: dict[str, Curve]
    unit: str
    low: float | None
    high: float | None
    parts: tuple[tuple[str, Fraction, Fraction], ...]
    is_clipped: bool = False
    categories: tuple[str, ...] = ()
    missing: Fraction | None = None
    is_whole: bool = False

    def at(self, point: Point) -> Fraction:
        """Return its value at a point."""
        if not self.parts:
            return point[self.name]
        return sum((w * (point[name] - c) for name, w, c in self.parts), start=ZERO)


class Rules(NamedTuple):
    """Rules with all that they mean."""

    variables: dict[str, Variable]
    rules: tuple[Rule, ...]
    is_product: bool
    uncovered: str | None


Steps = tuple[tuple[Facts, int], ...]
"""A path in a tree: nodes, and the position of the branch that is taken."""


class Model:
    """A rule base, a tree or a fuzzy system, as its audit sees it.

    Attributes:
        facts: What the file holds.
        form: What an audit calls it.
        rules: The rules; of a tree the relative ones, of a system its ways.
        raw: The raw rules of a tree.
        nodes: The nodes of a tree, from the root.
        paths: The path to each leaf of a tree.
        names: What answers call each rule.
        numbers: The number in the file of each rule, from 1.
        silent: The names of rules of a system that never fire, as their text says.
        absent: The numbers in the file of rules that are not audited, by name.
        reasons: Why rules of a system are left out, by name.
        labels: Every term of an input, by its variable.
        asked: The variables and terms that the file's rules use.
        places: The lines and columns of rules and terms in the file.
    """

    def __init__(self, content: bytes, name: str, left_out: Iterable[str] = ()) -> None:
        try:
            top = read_yaml(content, name)
        except CannotRunError as error:
            if name.lower().endswith((".yaml", ".yml")):
                raise
            there = shlex.quote(str(PurePath(name).with_suffix(".yaml")))
            raise CannotRunError(
                f"{name}: only YAML is checked again; convert it, and audit and check "
                f"{there}: fuzzytree convert {shlex.quote(name)} {there}"
            ) from error
        kind = top.get("kind") if isinstance(top, dict) else None
        if str(kind) not in MEANINGS:
            text = f"rule bases, trees and systems are checked, not {kind!r:.60}"
            raise CannotRunError(f"{name}: {text}")
        try:
            self._read(top, str(kind), {*left_out})
        except CannotRunError as error:
            raise CannotRunError(f"{name}: {error}") from error
        except (TypeError, LookupError, ArithmeticError, AttributeError, ValueError):
            text = f"{name}: not a {kind} that fuzzytree writes"
            raise CannotRunError(text) from None

    def _read(self, top: Facts, kind: str, left_out: set[str]) -> None:
        meaning = top.get("semantics", {})
        if top.get("format") != "fuzzytree/1" or not (
            MEANINGS[kind].items() <= meaning.items()
        ):
            raise CannotRunError("its meaning is not known")
        keys(top, f"format, kind, name, semantics, {NEEDED[kind]}", OPTIONAL[kind])
        self.name, self.kind, self.facts = str(top["name"]), kind, top
        self.raw: Rules | None = None
        self.nodes: list[Facts] = []
        self.paths: list[Steps] = []
        self.silent: list[str] = []
        self.absent: dict[str, int] = {}
        self.is_whole, self.reasons = True, dict[str, str]()
        self.places: list[Place] = [*_places(top.get("rules", top.get("leaves")))]
        for block in top.get("blocks", []):
            self.places += _places(block["rules"])
        self.term_places: dict[tuple[str, str], Place] = {}
        for one in (
            o for k in ("variables", "outputs", "sets") for o in top.get(k, [])
        ):
            terms, of = one.get("terms", []), one.get("name", one.get("variable"))
            for term, place in zip(terms, _places(terms), strict=False):
                self.term_places.setdefault((of, term["name"]), place)
        variables = [_variable(one) for one in top.get("variables", [])]
        self.variables = {one.name: one for one in variables}
        once([one.name for one in variables])
        self.labels = [(v.name, term) for v in variables for term in v.curves]
        if kind == "system":
            self._read_system(top, left_out)
            return
        self.missing = _class(meaning["missing"])
        self.uncovered = _class(meaning["uncovered"])
        keys(
            meaning,
            f"and, uncovered, missing, {', '.join(MEANINGS[kind])}",
            "label type, sharpness, floor",
        )
        if meaning["and"] not in ("minimum", "product"):
            raise CannotRunError("its AND is not known")
        self.is_product = meaning["and"] == "product"
        self.form = f"{top['terms']} rules" if "terms" in top else "rules"
        if kind == "tree":
            self._read_tree(top)
        else:
            rules = [_rule(one) for one in top["rules"]]
            self.rules = self._rules(rules, self.variables)
        self.numbers = [*range(1, len(self.rules.rules) + 1)]
        self.names = [f"rule {number}" for number in self.numbers]
        self.asked = _used(self.rules)
        self.lengths = [len(rule.when) for rule in self.rules.rules]
        once(top["classes"])
        self.class_count = len(top["classes"])
        if not {rule.then for rule in self.rules.rules} <= {*top["classes"]}:
            raise CannotRunError("a class that is not declared")

    def _rules(self, rules: Sequence[Rule], variables: Mapping[str, Variable]) -> Rules:
        known = {(v.name, term) for v in variables.values() for term in v.curves}
        used = {(c.variable, t) for rule in rules for c in rule.when for t in c.terms}
        if not rules or not used <= known:
            raise CannotRunError("rules of unknown terms, or none")
        return Rules({**variables}, tuple(rules), self.is_product, self.uncovered)

    # --- trees

    def _read_tree(self, top: Facts) -> None:
        self.form, self.nodes = "tree", top.get("nodes", [])
        leaves, count = top["leaves"], 0
        for number, leaf in enumerate(leaves, 1):
            keys(leaf, "leaf, class", "pattern, support, probabilities")
            count += leaf["leaf"] == number
        for number, node in enumerate(self.nodes, 1):
            keys(node, "node, ask, cuts, branches", "interval owners")
            ways = range(1, len(node["branches"]) + 1)
            node["interval owners"] = node.get("interval owners", [*ways])
            is_whole = {*node["interval owners"]} == {*ways} and node["node"] == number
            is_whole &= sorted(node["cuts"]) == node["cuts"]
            is_whole &= len(node["interval owners"]) == len(node["cuts"]) + 1
            count += is_whole
        if count != len(leaves) + len(self.nodes):
            raise CannotRunError("nodes, leaves or intervals that lead nowhere")
        ends: list[tuple[int, Steps]] = [(1 if self.nodes else -1, ())]
        met: list[int] = []
        while ends:
            number, path = ends.pop()
            met.append(number)
            if len(met) > len(self.nodes) + len(leaves):
                break
            if number < 0:
                self.paths.append(path)
                continue
            node = self.nodes[number - 1]
            for place in reversed(range(len(node["branches"]))):
                kind, to = node["branches"][place]["go to"].split(" ")
                sign = {"leaf": -1, "node": 1}[kind]
                ends.append((sign * int(to), (*path, (node, place))))
        order = [*range(1, len(self.nodes) + 1)]
        is_once = [n for n in met if n > 0] == order
        if not is_once or [-n for n in met if n < 0] != [*range(1, len(leaves) + 1)]:
            raise CannotRunError("nodes, leaves or intervals that lead nowhere")
        self.leaves: list[str] = [leaf["class"] for leaf in leaves]
        self.rules = self._rules([*self._of_leaves("is")], self.variables)
        sets = {one["variable"]: _curves(one["terms"]) for one in top.get("sets", [])}
        fitted = {
            one.name: one._replace(curves=sets.get(one.name, {}))
            for one in self.variables.values()
        }
        if sets:
            self.raw = self._rules([*self._of_leaves("sets")], fitted)

    def _of_leaves(self, key: str) -> Iterator[Rule]:
        for path, label in zip(self.paths, self.leaves, strict=True):
            when = [(node["ask"], node["branches"][way][key]) for node, way in path]
            yield Rule(
                tuple(Proposition(name, tuple(terms)) for name, terms in when), label
            )

    def leaf_at(self, point: Point) -> int:
        """Return the number of the leaf of a tree that a point reaches."""
        number = 1 if self.nodes else -1
        while number > 0:
            node = self.nodes[number - 1]
            x = self.variables[node["ask"]].at(point)
            owner = node["interval owners"][sum(x > cut for cut in node["cuts"])]
            kind, to = node["branches"][owner - 1]["go to"].split(" ")
            number = int(to) if kind == "node" else -int(to)
        return -number

    # --- systems: a rule of `a and (b or c)` becomes two rules of an audit, its ways

    def _read_system(self, top: Facts, left_out: set[str]) -> None:
        self.form, self.missing, self.uncovered = "system", None, None
        keys(top["semantics"], ", ".join(MEANINGS["system"]))
        self.outputs = [one["name"] for one in top["outputs"]]
        once([*self.variables, *self.outputs])
        owners: list[tuple[str, Facts, Facts, Condition | None]] = []
        counts = {"minimum": 0, "product": 0}
        for place, block in enumerate(top["blocks"], 1):
            keys(block, "rules, activation", "and, or, implication, name")
            end = f" of block {place}" if len(top["blocks"]) > 1 else ""
            for index, rule in enumerate(block["rules"], 1):
                keys(rule, "if, then", "weight, name")
                condition = read_condition(rule["if"])
                owners.append((f"rule {index}{end}", block, rule, condition))
                if block.get("and") in counts:
                    has_and = any(
                        isinstance(o, Joint) and o.word == "and"
                        for o in parts(condition)
                    )
                    counts[block["and"]] += has_and
        self.is_product = counts["product"] > counts["minimum"]
        rules: list[Rule] = []
        self.lengths = list[int]()
        self.names, self.numbers = list[str](), list[int]()
        self.thens: list[tuple[Is, ...]] = []
        self.asked = {
            (one.variable, one.term or "")
            for *_, condition in owners
            for one in parts(condition)
            if isinstance(one, Is)
        }
        for number, (name, block, rule, condition) in enumerate(owners, 1):
            weight, then = (
                number_of(rule.get("weight", 1)),
                read_conclusions(rule["then"]),
            )
            text = " and ".join(
                " ".join((c.variable, "is", *c.hedges, c.term or "")) for c in then
            )
            try:
                ways = self.ways(condition, block) if weight else []
            except UndecidedError as error:
                ways = []
                self.is_whole = False
                self.reasons[name] = str(error)
                left_out.add(name)
            if name in left_out:
                self.is_whole = False
                ways = []
            elif not ways:
                self.silent.append(name)
            if not ways:
                self.absent[name] = number
            for place, way in enumerate(ways, 1):
                rules.append(Rule(self._weighted(way, Fraction(weight)), text))
                self.lengths.append(len(way))
                several = len(ways) > 1
                self.names.append(f"way {place} of {name}" if several else name)
                self.numbers.append(number)
                self.thens.append(then)
        hedged = {
            v.name: v._replace(curves={**v.curves}) for v in self.variables.values()
        }
        for proposition in (c for rule in rules for c in rule.when):
            for term in proposition.terms:
                plain, *hedges = term.split("\0")
                curves = hedged[proposition.variable].curves
                whole = Curve("band", (None,) * 4) if not plain else curves[plain]
                curves[term] = whole._replace(hedges=tuple(hedges))
        self.rules = Rules(hedged, tuple(rules), self.is_product, None)
        self.class_count = len({rule.then for rule in rules})

    def _weighted(
        self, way: tuple[Proposition, ...], weight: Fraction
    ) -> tuple[Proposition, ...]:
        """Return propositions with a weight: all of a minimum, one of a product."""
        if weight == 1:
            return way
        way = way or (Proposition(next(iter(self.variables)), ("",)),)
        if self.is_product:
            return (way[0]._replace(weight=weight), *way[1:])
        return tuple(proposition._replace(weight=weight) for proposition in way)

    def ways(
        self, condition: Condition | None, block: Facts, *, negated: bool = False
    ) -> list[tuple[Proposition, ...]]:
        """Return the ways in which a condition holds, or does not; none if never.

        Raises:
            UndecidedError: If it does not hold by its ways.
        """
        if condition is None:
            return [()]
        if isinstance(condition, Is):
            return self._ways_of_proposition(condition, negated=negated)
        word, inner = condition
        if word == "not" or len(inner) == 1:
            return self.ways(inner[0], block, negated=negated is not (word == "not"))
        norm = "product" if self.is_product else "minimum"
        if word == "and":
            is_fit = block.get("and") == "minimum" or not negated
            is_fit &= negated or block.get("and") == norm
        else:
            one = self._one_proposition(condition, block, negated=negated)
            if one is not None:
                return [(one,)]
            is_fit = block.get("or") == "maximum" and not (negated and self.is_product)
        if not is_fit:
            norms = f"AND is {block.get('and')} and OR is {block.get('or')}"
            raise UndecidedError(f"not a minimum, product or maximum: {norms}")
        is_union = (word == "or") is not negated
        result: list[tuple[Proposition, ...]] = [] if is_union else [()]
        for part in inner:
            ways = self.ways(part, block, negated=negated)
            if is_union:
                result += ways
            else:
                result = [one + way for one in result for way in ways]
            if not self.is_product:  # a minimum does not change by repetition
                result = [tuple(dict.fromkeys(way)) for way in result]
            result = [*dict.fromkeys(result)]
            if len(result) > MOST_WAYS:
                raise UndecidedError("a condition that holds in too many ways")
        return result

    def _ways_of_proposition(
        self, one: Is, *, negated: bool
    ) -> list[tuple[Proposition, ...]]:
        hedges = one.hedges
        while hedges[:1] == ("not",):
            negated, hedges = not negated, hedges[1:]
        if hedges[:1] == ("any",):
            return [] if negated else [()]
        known = self.variables.get(one.variable)
        if one.others:
            raise CannotRunError("several terms in a proposition of a system")
        if known is None or one.term not in known.curves:
            raise UndecidedError("it uses an output")
        term = "\0".join((one.term, *hedges))
        return [(Proposition(one.variable, (term,), negated),)]

    def _one_proposition(
        self, whole: Joint, block: Facts, *, negated: bool
    ) -> Proposition | None:
        """Return `x is a or b` as one proposition, if it is that and a maximum."""
        every = [
            o for o in parts(whole) if not (isinstance(o, Joint) and o.word == "or")
        ]
        names = {(o.variable, bool(o.hedges)) for o in every if isinstance(o, Is)}
        is_plain = all(isinstance(o, Is) and o.term for o in every)
        if block.get("or") != "maximum" or not is_plain or len(names) != 1:
            return None
        ((name, is_hedged),) = names
        terms = dict.fromkeys(o.term or "" for o in every if isinstance(o, Is))
        if is_hedged or name not in self.variables:
            return None
        return Proposition(name, tuple(terms), negated)

    def may_conflict(self, one: int, other: int) -> bool:
        """Return whether two rules of a system say different things of one output."""
        if self.form != "system":
            return True
        thens = self.thens[one - 1], self.thens[other - 1]
        shared = set.intersection(*({c.variable for c in then} for then in thens))
        return any(c.variable in shared for c in {*thens[0]} ^ {*thens[1]})


def parts(condition: Condition | None) -> Iterator[Condition]:
    """Yield a condition and all of its parts."""
    if condition is not None:
        yield condition
    for part in condition.parts if isinstance(condition, Joint) else ():
        yield from parts(part)


def _used(rules: Rules) -> set[tuple[str, str]]:
    return {(c.variable, t) for rule in rules.rules for c in rule.when for t in c.terms}


# --- the layout of a file

MEANINGS: dict[str, dict[str, str]] = {
    "rule base": {
        "or": "maximum",
        "not": "1 - degree",
        "answer": "the class of the first of the strongest rules",
    },
    "tree": {
        "cuts": "a value equal to a cut lies below it",
        "answer": "the class of the leaf that the nodes lead to",
    },
    "system": {
        "not": "1 - degree",
        "activated": "rules whose weighted degree is above 0",
        "missing": "a value that is missing or infinite makes every output nan",
    },
}
"""What models of each kind always mean."""
NEEDED = {
    "rule base": "classes, rules",
    "tree": "classes, leaves",
    "system": "outputs, blocks",
}
OPTIONAL = {
    "rule base": "variables, columns, terms",
    "tree": "variables, columns, nodes, sets",
    "system": "variables, note",
}


def once(names: Sequence[str]) -> None:
    """Refuse a name that stands twice.

    Raises:
        CannotRunError: If one does.
    """
    if len({*names}) < len(names):
        raise CannotRunError("a name stands twice")


def _class(text: str) -> str | None:
    if text == "no class":
        return None
    if not text.startswith("class "):
        raise CannotRunError(f"not an answer: {text!r:.60}")
    return text.removeprefix("class ")


def _places(items: Any) -> list[Place]:
    """Return the places of a list that has a line for each item."""
    return items.places if isinstance(items, Items) else []


def _variable(one: Facts) -> Variable:
    keys(one, "name", "terms, unit, range, sum of, categories, missing as, numbers")
    ends = one.get("range", {})
    if ends.keys() - {"from", "to", "outside"}:
        raise CannotRunError("a range with other ends")
    low, high = (None if k not in ends else number_of(ends[k]) for k in ("from", "to"))
    inputs = [
        (
            p["input"],
            Fraction(number_of(p["weight"])),
            Fraction(number_of(p.get("centre", 0))),
        )
        for p in one.get("sum of", [])
    ]
    curves = _curves(one.get("terms", []))
    unit, is_clipped = one.get("unit", ""), "outside" in ends
    missing = Fraction(number_of(one["missing as"])) if "missing as" in one else None
    names, parts = tuple(one.get("categories", ())), tuple(inputs)
    rest = is_clipped, names, missing, one.get("numbers") == "whole"
    return Variable(one["name"], curves, unit, low, high, parts, *rest)


def _curves(terms: Iterable[Facts]) -> dict[str, Curve]:
    terms = [{**one} for one in terms]
    names = [one.pop("name") for one in terms]
    once(names)
    return dict(zip(names, map(curve_of, terms), strict=True))


def _rule(one: Facts) -> Rule:
    keys(one, "if, then", "support, probabilities")
    conditions = [read_condition([text]) for text in one["if"]]
    when = [c for c in conditions if isinstance(c, Is) and c.term]
    hedges = {c.hedges for c in when} - {(), ("not",)}
    if len(when) < len(conditions) or hedges:
        raise CannotRunError("a rule base has no such conditions")
    every = [
        Proposition(c.variable, (c.term or "", *c.others), bool(c.hedges)) for c in when
    ]
    return Rule(tuple(every), one["then"])
