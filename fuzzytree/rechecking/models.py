"""A model from its YAML file, and its rules as an audit numbers them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from fuzzytree.rechecking.curves import (
    ANYTHING,
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


Way = tuple[Proposition, ...]


class Rule(NamedTuple):
    """A rule: what must hold, and the class or the text of what it concludes.

    `name` is what answers call it; `number` is its number in the file, from 1;
    `outputs` is what a rule of a system concludes.
    """

    when: Way
    then: str
    name: str = ""
    number: int = 0
    outputs: tuple[Is, ...] = ()


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
    of: str = ""  # before its name in a text of two models

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
        paths: The path to each leaf of a tree.
        silent: The names of rules of a system that never fire, as their text says.
        absent: The numbers in the file of rules that are not audited, by name.
        reasons: Why rules of a system are left out, by name.
        labels: Every term of an input, by its variable.
        labels_in_use: The variables and terms that the file's rules use.
        places: The lines and columns of rules and terms in the file.
    """

    def __init__(self, content: bytes, name: str, left_out: Iterable[str] = ()) -> None:
        try:
            top = read_yaml(content, name)
        except CannotRunError as error:
            if name.lower().endswith((".yaml", ".yml")):
                raise
            text = "only YAML is checked again; `fuzzytree convert` makes it"
            raise CannotRunError(f"{name}: {text}") from error
        kind = top.get("kind") if isinstance(top, dict) else None
        if str(kind) not in LAYOUTS:
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
        needed, optional, always = LAYOUTS[kind]
        meaning = top.get("semantics", {})
        if top.get("format") != "fuzzytree/1" or not always.items() <= meaning.items():
            raise CannotRunError("its meaning is not known")
        keys(top, f"format, kind, name, semantics, {needed}", optional)
        self.name, self.facts = str(top["name"]), top
        self.raw: Rules | None = None
        self.paths: list[Steps] = []
        self.silent: list[str] = []
        self.absent: dict[str, int] = {}
        self.reasons: dict[str, str] = {}
        self.places = [*_places(top.get("rules", top.get("leaves")))]
        for block in top.get("blocks", []):
            self.places += _places(block["rules"])
        self.term_places: dict[tuple[str, str], Place] = {}
        for entry in (
            e for k in ("variables", "outputs", "sets") for e in top.get(k, [])
        ):
            terms, name = (
                entry.get("terms", []),
                entry.get("name", entry.get("variable")),
            )
            for term, place in zip(terms, _places(terms), strict=False):
                self.term_places.setdefault((name, term["name"]), place)
        self.variables = _by_name(map(_variable, top.get("variables", [])))
        variables = self.variables.values()
        self.labels = [(v.name, term) for v in variables for term in v.curves]
        if kind == "system":
            keys(meaning, ", ".join(always))
            self._read_system(top, left_out)
            return
        keys(
            meaning,
            f"and, uncovered, missing, {', '.join(always)}",
            "label type, sharpness, floor",
        )
        self.missing = _class(meaning["missing"])
        self.uncovered = _class(meaning["uncovered"])
        if meaning["and"] not in ("minimum", "product"):
            raise CannotRunError("its AND is not known")
        self.is_product = meaning["and"] == "product"
        self.form = f"{top['terms']} rules" if "terms" in top else "rules"
        if kind == "tree":
            self._read_tree(top)
        else:
            self.rules = self._rules(map(_rule, top["rules"]), self.variables)
        self.labels_in_use = _labels(self.rules.rules)
        refuse_twice(top["classes"])
        if not {rule.then for rule in self.rules.rules} <= {*top["classes"]}:
            raise CannotRunError("a class that is not declared")

    def _rules(self, rules: Iterable[Rule], variables: dict[str, Variable]) -> Rules:
        every = tuple(
            rule._replace(name=f"rule {number}", number=number)
            for number, rule in enumerate(rules, 1)
        )
        labels = {(v.name, term) for v in variables.values() for term in v.curves}
        if not every or not _labels(every) <= labels:
            raise CannotRunError("rules of unknown terms, or none")
        return Rules(variables, every, self.is_product, self.uncovered)

    # --- trees

    def _read_tree(self, top: Facts) -> None:
        self.form, nodes, leaves = "tree", top.get("nodes", []), top["leaves"]
        for leaf in leaves:
            keys(leaf, "leaf, class", "pattern, support, counts, probabilities")
        for node in nodes:
            keys(node, "node, ask, cuts, branches", "interval owners")
            ways = range(1, len(node["branches"]) + 1)
            owners = node.setdefault("interval owners", [*ways])
            is_whole = sorted(node["cuts"]) == node["cuts"] and {*owners} == {*ways}
            if not is_whole or len(owners) != len(node["cuts"]) + 1:
                raise CannotRunError("intervals that lead nowhere")
        ends: list[tuple[str, Steps]] = [("node 1" if nodes else "leaf 1", ())]
        order: dict[str, list[Facts]] = {"node": [], "leaf": []}
        while ends:
            to, path = ends.pop()
            kind, number = to.split(" ")
            order[kind].append((nodes if kind == "node" else leaves)[int(number) - 1])
            is_once = order[kind][-1][kind] == int(number) == len(order[kind])
            if not is_once:  # each is reached once, in order
                raise CannotRunError("nodes or leaves that lead nowhere")
            if kind == "leaf":
                self.paths.append(path)
                continue
            node = order[kind][-1]
            for place in reversed(range(len(node["branches"]))):
                ends.append((node["branches"][place]["go to"], (*path, (node, place))))
        if (len(order["node"]), len(order["leaf"])) != (len(nodes), len(leaves)):
            raise CannotRunError("nodes or leaves that are never reached")
        self.leaves: list[str] = [leaf["class"] for leaf in leaves]
        self.rules = self._rules(self._of_leaves("is"), self.variables)
        sets = {of["variable"]: _curves(of["terms"]) for of in top.get("sets", [])}
        if sets:
            variables = self.variables.items()
            raw = {n: v._replace(curves=sets.get(n, {})) for n, v in variables}
            self.raw = self._rules(self._of_leaves("sets"), raw)

    def _of_leaves(self, key: str) -> Iterator[Rule]:
        for path, label in zip(self.paths, self.leaves, strict=True):
            when = [(node["ask"], node["branches"][way][key]) for node, way in path]
            yield Rule(tuple(Proposition(n, tuple(terms)) for n, terms in when), label)

    def leaf_at(self, point: Point) -> int:
        """Return the number of the leaf of a tree that a point reaches."""
        for number, path in enumerate(self.paths, 1):
            if all(self._leads(point, node, place) for node, place in path):
                return number
        raise LookupError("no leaf")

    def _leads(self, point: Point, node: Facts, place: int) -> bool:
        x = self.variables[node["ask"]].at(point)
        owners: list[int] = node["interval owners"]
        cuts: list[float] = node["cuts"]
        return owners[sum(x > cut for cut in cuts)] == place + 1

    # --- systems: a rule of `a and (b or c)` becomes two rules of an audit, its ways

    def _read_system(self, top: Facts, left_out: set[str]) -> None:
        self.form, self.missing, self.uncovered = "system", None, None
        refuse_twice([*self.variables, *(output["name"] for output in top["outputs"])])
        owners: list[tuple[str, Facts, Facts, Condition | None]] = []
        for place, block in enumerate(top["blocks"], 1):
            keys(block, "rules, activation", "and, or, implication, name")
            end = f" of block {place}" if len(top["blocks"]) > 1 else ""
            for index, rule in enumerate(block["rules"], 1):
                keys(rule, "if, then", "weight, name")
                owner = f"rule {index}{end}", block, rule, read_condition(rule["if"])
                owners.append(owner)
        every = [(o[1].get("and", ""), part) for o in owners for part in parts(o[3])]
        self.labels_in_use = {
            (p.variable, p.term or "") for _, p in every if isinstance(p, Is)
        }
        norms = [norm for norm, p in every if isinstance(p, Joint) and p.word == "and"]
        self.is_product = norms.count("product") > norms.count("minimum")
        rules: list[Rule] = []
        for number, (name, block, rule, condition) in enumerate(owners, 1):
            weight, ways = number_of(rule.get("weight", 1)), list[Way]()
            then = read_conclusions(rule["then"])
            words = (
                " ".join((c.variable, "is", *c.hedges, c.term or "")) for c in then
            )
            text = " and ".join(words)
            try:
                ways = self.ways(condition, block) if weight else []
            except UndecidedError as error:
                self.reasons[name] = str(error)
            is_left_out = name in left_out or name in self.reasons
            if is_left_out or not ways:
                self.absent[name] = number
                self.silent += [] if is_left_out else [name]
                continue
            for place, way in enumerate(ways, 1):
                whole = f"way {place} of {name}" if len(ways) > 1 else name
                when = self._with_weight(way, weight)
                rules.append(Rule(when, text, whole, number, then))
        curves = {name: {**v.curves} for name, v in self.variables.items()}
        for name, term in _labels(rules):
            plain, *hedges = term.split("\0")
            curve = curves[name][plain] if plain else ANYTHING
            curves[name][term] = curve._replace(hedges=tuple(hedges))
        variables = {n: v._replace(curves=curves[n]) for n, v in self.variables.items()}
        self.rules = Rules(variables, tuple(rules), self.is_product, None)

    def put_before_names(self, of: str) -> None:
        """Distinguish the rules and variables from those of another model."""
        self.variables = {n: v._replace(of=of) for n, v in self.variables.items()}
        rules, curves = self.rules.rules, self.rules.variables.items()
        self.rules = self.rules._replace(
            rules=tuple(rule._replace(name=of + rule.name) for rule in rules),
            variables={name: v._replace(of=of) for name, v in curves},
        )

    @property
    def is_whole(self) -> bool:
        """Whether no rule of a system is left out."""
        return {*self.absent} == {*self.silent}

    def _with_weight(
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
    ) -> list[Way]:
        """Return the ways in which a condition holds, or does not; none if never."""
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
            single = self._one_proposition(condition, block, negated=negated)
            if single is not None:
                return [(single,)]
            is_fit = block.get("or") == "maximum" and not (negated and self.is_product)
        if not is_fit:
            norms = f"AND is {block.get('and')} and OR is {block.get('or')}"
            raise UndecidedError(f"not a minimum, product or maximum: {norms}")
        is_union = (word == "or") is not negated
        result: list[Way] = [] if is_union else [()]
        for part in inner:
            ways = self.ways(part, block, negated=negated)
            if is_union:
                result += ways
            else:
                result = [start + way for start in result for way in ways]
            if not self.is_product:  # a minimum does not change by repetition
                result = [tuple(dict.fromkeys(way)) for way in result]
            result = [*dict.fromkeys(result)]
            if len(result) > MOST_WAYS:
                raise UndecidedError("a condition that holds in too many ways")
        return result

    def _ways_of_proposition(self, proposition: Is, *, negated: bool) -> list[Way]:
        hedges = proposition.hedges
        while hedges[:1] == ("not",):
            negated, hedges = not negated, hedges[1:]
        if hedges[:1] == ("any",):
            return [] if negated else [()]
        variable = self.variables.get(proposition.variable)
        if proposition.others:
            raise CannotRunError("several terms in a proposition of a system")
        if variable is None or proposition.term not in variable.curves:
            raise UndecidedError("it uses an output")
        term = "\0".join((proposition.term, *hedges))
        return [(Proposition(proposition.variable, (term,), negated),)]

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


def may_conflict(a: Rule, b: Rule) -> bool:
    """Return whether two rules say different things of one output."""
    if not a.outputs:
        return a.then != b.then
    shared = {o.variable for o in a.outputs} & {o.variable for o in b.outputs}
    return any(o.variable in shared for o in {*a.outputs} ^ {*b.outputs})


def parts(condition: Condition | None) -> Iterator[Condition]:
    """Yield a condition and all of its parts."""
    if condition is not None:
        yield condition
    for part in condition.parts if isinstance(condition, Joint) else ():
        yield from parts(part)


def _labels(rules: Iterable[Rule]) -> set[tuple[str, str]]:
    return {(c.variable, t) for rule in rules for c in rule.when for t in c.terms}


# --- the layout of a file

LAYOUTS: dict[str, tuple[str, str, dict[str, str]]] = {
    "rule base": (
        "classes, rules",
        "variables, columns, terms",
        {
            "or": "maximum",
            "not": "1 - degree",
            "answer": "the class of the first of the strongest rules",
        },
    ),
    "tree": (
        "classes, leaves",
        "variables, columns, nodes, sets",
        {
            "cuts": "a value equal to a cut lies below it",
            "answer": "the class of the leaf that the nodes lead to",
        },
    ),
    "system": (
        "outputs, blocks",
        "variables, note",
        {
            "not": "1 - degree",
            "activated": "rules whose weighted degree is above 0",
            "missing": "a value that is missing or infinite makes every output nan",
        },
    ),
}
"""The keys of each kind of model, those that it may have, and what it always means."""


def refuse_twice(names: Sequence[str]) -> None:
    """Refuse a name that stands twice."""
    if len({*names}) < len(names):
        raise CannotRunError("a name stands twice")


def _by_name(variables: Iterable[Variable]) -> dict[str, Variable]:
    every = [*variables]
    refuse_twice([variable.name for variable in every])
    return {variable.name: variable for variable in every}


def _class(text: str) -> str | None:
    if text == "no class":
        return None
    if not text.startswith("class "):
        raise CannotRunError(f"not an answer: {text!r:.60}")
    return text.removeprefix("class ")


def _places(items: Any) -> list[Place]:
    """Return the places of the items of a list."""
    return items.places if isinstance(items, Items) else []


def _variable(facts: Facts) -> Variable:
    optional = "terms, unit, range, sum of, categories, missing as, numbers"
    keys(facts, "name", optional)
    ends = facts.get("range", {})
    if ends.keys() - {"from", "to", "outside"}:
        raise CannotRunError("a range with other ends")
    low, high = (
        float(number_of(ends[k])) if k in ends else None for k in ("from", "to")
    )
    return Variable(
        facts["name"],
        _curves(facts.get("terms", [])),
        facts.get("unit", ""),
        low,
        high,
        tuple(
            (part["input"], number_of(part["weight"]), number_of(part.get("centre", 0)))
            for part in facts.get("sum of", [])
        ),
        "outside" in ends,
        tuple(facts.get("categories", ())),
        number_of(facts["missing as"]) if "missing as" in facts else None,
        facts.get("numbers") == "whole",
    )


def _curves(terms: Sequence[Facts]) -> dict[str, Curve]:
    curves = {term["name"]: curve_of(term) for term in terms}
    if len(curves) < len(terms):
        raise CannotRunError("a name stands twice")
    return curves


def _rule(facts: Facts) -> Rule:
    keys(facts, "if, then", "support, counts, probabilities")
    conditions = [read_condition([text]) for text in facts["if"]]
    when = [c for c in conditions if isinstance(c, Is) and c.term]
    hedges = {c.hedges for c in when} - {(), ("not",)}
    if len(when) < len(conditions) or hedges:
        raise CannotRunError("a rule base has no such conditions")
    every = [
        Proposition(c.variable, (c.term or "", *c.others), bool(c.hedges)) for c in when
    ]
    return Rule(tuple(every), facts["then"])
