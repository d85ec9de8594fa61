"""A model as SMT-LIB 2 text: a function for each term and each rule.

    (define-fun |force is low| ((x Real)) Real ...)
    (define-fun |rule 2| () Real ; if force is high and slip is none then soft
      (min (|force is high| |force|) (|slip is none| |slip|)))

It is linear under the minimum (QF_LRA) and polynomial under the product (QF_NRA). All
numbers are exact: a double that is no short decimal is a constant such as `|0.3|`. A
curve that is no line is a constant between two functions of lines, so what is
unsatisfiable with them is so with the curve, and what is satisfiable may not be.
"""

from __future__ import annotations

import itertools
import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction

from fuzzytree.rechecking.curves import (
    ONE,
    ZERO,
    Curve,
    Knot,
    bounds,
    is_straight,
    turns,
)
from fuzzytree.rechecking.models import Model, Proposition, Rule, Rules, Variable

Ends = tuple[Fraction, Fraction]
Knots = tuple[Knot, ...]
CELLS, PARTS = 24, 8
"""Into so many cells a curve is cut, and each of them to find its error."""
_DIGITS = 12  # of a double that is a constant of its own
_LARGEST = Fraction(sys.float_info.max)
_GRID = 2**12  # bounds of such a curve are rounded outwards to parts of this
_RESERVED = re.compile(
    "abs|acos|and|arctan|as|asin|assert|atan|concat|const|cos|default|distinct|div|e|"
    "euler|exists|exp|extract|false|forall|if|iff|implies|is_int|ite|let|log|map|max|"
    "min|mod|not|or|par|pi|rem|repeat|root|select|sin|sqrt|store|tan|to_int|to_real|"
    "true|union|x|xor"
)
_PRELUDE = """
(define-fun min ((a Real) (b Real)) Real (ite (<= a b) a b))
(define-fun max ((a Real) (b Real)) Real (ite (>= a b) a b))""".strip()

MOST_WHOLE = 64
"""The most whole numbers that are listed one by one."""


def lines_of(curve: Curve, low: Fraction, high: Fraction) -> tuple[Knots, Knots]:
    """Return functions of lines below and above a curve; the same one if it is lines.

    Between `low` and `high` they are near to it.
    """
    if is_straight(curve):
        return curve.numbers, curve.numbers
    part = (high - low) / CELLS
    bits = part.numerator.bit_length() - part.denominator.bit_length()
    step = Fraction(2) ** bits
    step = step if step <= part else step / 2
    start, end = math.floor(low / step) + 1, math.ceil(high / step)
    cells = [low, *(k * step for k in range(start, end)), high]
    both = [_line_ends(curve, a, b) for a, b in itertools.pairwise(cells)]
    under, over = (
        tuple(
            Knot(x, before, before if x == high else after, after)
            for x, before, after in zip(
                cells,
                [outside, *(pair[side][1] for pair in both)],
                [*(pair[side][0] for pair in both), outside],
                strict=True,
            )
        )
        for side, outside in ((0, ZERO), (1, curve.top))
    )
    return under, over


def _line_ends(curve: Curve, low: Fraction, high: Fraction) -> tuple[Ends, Ends]:
    """Return the ends of lines below and above a curve on an interval."""
    whole = bounds(curve, low, high)
    if whole[0] == whole[1]:
        return whole, whole
    p, q = (_on_grid(bounds(curve, x, x)[0]) for x in (low, high))
    under = over = ZERO
    for k in range(PARTS):
        a, b = (Fraction(k + n, PARTS) for n in (0, 1))
        least, most = bounds(curve, low + (high - low) * a, low + (high - low) * b)
        ends = p + (q - p) * a, p + (q - p) * b
        under, over = min(under, least - max(ends)), max(over, most - min(ends))
    off = Fraction(1, _GRID)
    below, above = _on_grid(p + under) - off, _on_grid(p + over) + off
    return (below, below + q - p), (above, above + q - p)


def _on_grid(x: Fraction) -> Fraction:
    return Fraction(round(x * _GRID), _GRID)


def all_of(formulas: Iterable[str]) -> str:
    """Return that all formulas are true."""
    return _connect("and", formulas, "true")


def any_of(formulas: Iterable[str]) -> str:
    """Return that some formula is true."""
    return _connect("or", formulas, "false")


def _connect(word: str, formulas: Iterable[str], empty: str) -> str:
    every = [*dict.fromkeys(formulas)]
    if len(every) < 2:
        return every[0] if every else empty
    return f"({word} {' '.join(every)})"


class Script:
    """The text of a model, or of two, for a solver.

    Attributes:
        is_exact: Whether no curve is enclosed by lines.
    """

    def __init__(self) -> None:
        self.is_exact, self.is_product = True, False
        self._lines: list[str] = []
        self._constants: dict[str, str] = {}
        self._symbols: dict[tuple[str, str], str] = {}
        self._terms: dict[tuple[str, str, str], str] = {}
        self._unknowns: dict[tuple[str, Curve], str] = {}
        self._ends: dict[str, Ends] = {}
        self._values: dict[str, Sequence[Fraction]] = {}

    def add(
        self,
        model: Model,
        ends: Mapping[str, Ends],
        values: Mapping[str, Sequence[Fraction]],
        *,
        has_rules: bool = True,
    ) -> None:
        """Add the inputs of a model, and its rules with their terms.

        Args:
            model: The model.
            ends: The values of each variable of which they are known.
            values: Further values of inputs, or the only ones of categories; those
                that the model declares unless given.
            has_rules: Whether all rules are added now, or only those of claims later.
        """
        self._values |= values
        self._ends |= ends
        self.is_product |= model.rules.is_product
        self._lines.append(f"; {model.name}: {len(model.rules.rules)} rules")
        for variable in model.variables.values():
            self._add_variable(variable)
        for rule in model.rules.rules if has_rules else ():
            self.add_rule(rule, model.rules)

    # --- words

    def number(self, value: Fraction) -> str:
        """Return a number, exactly."""
        size = abs(value)
        short = repr(float(min(size, _LARGEST)))
        if Fraction(short) == size and "e" not in short:
            text = short
        elif size.denominator == 1:
            text = f"{size}.0"
        else:
            text = f"(/ {size.numerator}.0 {size.denominator}.0)"
            if Fraction(float(short)) == size and len(short) <= _DIGITS:
                self._constants[short] = text
                text = f"|{short}|"
        return f"(- {text})" if value < 0 else text

    def symbol(self, name: str, kind: str = "rule") -> str:
        """Return a name as a symbol, another one for each name and kind of thing."""
        if (kind, name) not in self._symbols:
            text = "".join("!" if c in "|\\" or ord(c) < 32 else c for c in name)
            while _RESERVED.fullmatch(text) or f"|{text}|" in self._symbols.values():
                text += "'"
            self._symbols[kind, name] = f"|{text}|"
        return self._symbols[kind, name]

    # --- variables

    def _add_variable(self, variable: Variable) -> None:
        if not variable.parts and ("input", variable.name) in self._symbols:
            return  # of two models
        own = self.value(variable)
        if variable.parts:
            parts = (
                f"(* {self.number(w)} (- {self.symbol(n, 'input')} {self.number(c)}))"
                for n, w, c in variable.parts
            )
            self._lines.append(f"(define-fun {own} () Real (+ 0.0 {' '.join(parts)}))")
        else:
            unit = f" ; {_plain(variable.unit)}" if variable.unit else ""
            self._lines.append(f"(declare-const {own} Real){unit}")
        self._assert_values(variable, own)

    def value(self, variable: Variable) -> str:
        """Return the symbol of a variable's value; two models have the same inputs."""
        of = variable.of if variable.parts else ""
        return self.symbol(of + variable.name, "input")

    def _assert_values(self, variable: Variable, own: str) -> None:
        """Assert the values that an input can have."""
        formulas, names = list[str](), ""
        low, high = self._ends.get(variable.name, (None, None))
        if variable.categories:
            names = f" ; {_plain(', '.join(variable.categories))}"
        elif low is not None and high is not None:
            ends = f"(<= {self.number(low)} {own}) (<= {own} {self.number(high)})"
            formulas = [f"(and {ends})"]
            if variable.is_whole and high - low < MOST_WHOLE:
                whole = map(Fraction, range(math.ceil(low), math.floor(high) + 1))
                formulas = [f"(= {own} {self.number(value)})" for value in whole]
            elif variable.is_whole:  # a point between whole numbers refutes nothing
                self.is_exact = False
        values = [*map(Fraction, range(len(variable.categories)))]
        if variable.missing is not None and (values or formulas):
            values.append(variable.missing)
        for value in self._values.get(variable.name, values):
            formulas.append(f"(= {own} {self.number(value)})")
        if formulas:
            self._lines.append(f"(assert {any_of(formulas)}){names}")

    # --- degrees

    def degree(self, variable: Variable, term: str) -> str:
        """Return the degree of a term; its function is added at its first use."""
        key = variable.of, variable.name, term
        if key not in self._terms:
            curve, own = variable.curves[term], self.value(variable)
            name = f"{variable.of}{variable.name} is {_words(term)}"
            if is_straight(curve):
                self._define(name, lines_of(curve, ZERO, ONE)[0])
                self._terms[key] = f"({self.symbol(name)} {own})"
            else:  # of two models the same curve is one unknown
                place = own, curve
                if place not in self._unknowns:
                    text = self._enclose(variable, curve, name, own)
                    self._unknowns[place] = text
                self._terms[key] = self._unknowns[place]
        return self._terms[key]

    def _enclose(self, variable: Variable, curve: Curve, name: str, own: str) -> str:
        """Declare the degree of a curve that is no line, with what is known of it."""
        self.is_exact = False
        degree, height = self.symbol(name), self.number(curve.top)
        self._lines.append(f"(declare-const {degree} Real) ; a curve that is no line")
        is_positive = False
        if curve.is_known:
            ends = self._region(variable, curve)
            is_positive = variable.name in self._ends and bounds(curve, *ends)[0] > 0
            sides = (", at least", ", at most")
            for side, function in zip(sides, lines_of(curve, *ends), strict=True):
                self._define(name + side, function)
            low, high = (f"({self.symbol(name + side)} {own})" for side in sides)
            within = f"(<= {low} {degree}) (<= {degree} {high})"
            self._lines.append(f"(assert (and {within}))")
        within = f"({'<' if is_positive else '<='} 0.0 {degree}) (<= {degree} {height})"
        self._lines.append(f"(assert (and {within}))")
        return degree

    def _region(self, variable: Variable, curve: Curve) -> Ends:
        """Return where a curve that is no line is enclosed closely."""
        every = [*self._ends.get(variable.name, ())]
        if not every or every[0] == every[1]:
            every += turns(curve) or [ZERO]  # beyond, nothing is known
            wide = max(every) - min(every) or ONE
            every = [min(every) - 4 * wide, max(every) + 4 * wide]
        if variable.missing is not None:
            every.append(variable.missing)
        return min(every), max(every)

    def _define(self, name: str, function: Knots) -> None:
        head = f"(define-fun {self.symbol(name)} ((x Real)) Real"
        self._lines.append(f"{head}\n  {self._text(function)})")

    def _text(self, knots: Knots) -> str:
        """Return nested cases from the left to the right."""
        lines = [self.number(knots[0].before)]
        slopes = [ZERO]
        for a, b in itertools.pairwise(knots):
            slope = (b.before - a.after) / (b.x - a.x)
            by = f"(* {self.number(slope)} (- x {self.number(a.x)}))"
            text = f"(+ {self.number(a.after)} {by})" if a.after else by
            lines.append(text if slope else self.number(a.after))
            slopes.append(slope)
        text = self.number(knots[-1].after)
        slopes.append(ZERO)
        for place in reversed(range(len(knots))):
            x, before, at, after = knots[place]
            if before == at == after and slopes[place] == slopes[place + 1]:
                continue  # a bend of no angle only costs a solver steps
            end = self.number(x)
            if at not in (before, after):
                text = f"(ite (<= x {end}) {self.number(at)}\n  {text})"
            sign = "<=" if at == before else "<"
            text = f"(ite ({sign} x {end}) {lines[place]}\n  {text})"
        return text

    # --- rules

    def reaches(self, rule: Rule, rules: Rules, sign: str, level: Fraction) -> str:
        """Return that a rule's strength is `>` or `>=` a level.

        Under the minimum all of its degrees are, which solvers decide faster.
        """
        most = self.number(level)
        if rules.is_product:
            return f"({sign} {self.strength(rule, rules)} {most})"
        degrees = self._degrees(rule, rules)
        return all_of(f"({sign} {degree} {most})" for degree in degrees)

    def strength(self, rule: Rule, rules: Rules) -> str:
        """Return how far a rule applies."""
        text, *rest = self._degrees(rule, rules)
        for degree in rest:
            text = f"({'*' if rules.is_product else 'min'} {text} {degree})"
        return text

    def _degrees(self, rule: Rule, rules: Rules) -> list[str]:
        """Return how far each proposition of a rule applies."""
        result: list[str] = []
        for name, terms, is_negated, weight in rule.when:
            variable = rules.variables[name]
            text, *rest = (self.degree(variable, term) for term in terms)
            for degree in rest:
                text = f"(max {text} {degree})"
            text = f"(- 1.0 {text})" if is_negated else text
            text = text if weight == 1 else f"(* {self.number(weight)} {text})"
            result.append(text)
        return result or ["1.0"]

    def on_axes(self, rule: Rule, rules: Rules) -> dict[str, str]:
        """Return how far a rule's propositions of each variable apply."""
        names = dict.fromkeys(proposition.variable for proposition in rule.when)
        own = {n: tuple(p for p in rule.when if p.variable == n) for n in names}
        return {n: self.strength(Rule(own[n], ""), rules) for n in names}

    def add_rule(self, rule: Rule, rules: Rules) -> str:
        """Add a function that is the strength of a rule, once, and return it."""
        if ("rule", rule.name) in self._symbols:
            return self.symbol(rule.name)
        own, text = self.symbol(rule.name), self.strength(rule, rules)
        when = " and ".join(map(str, rule.when)).replace("\0", " ") or "anything"
        comment = _plain(f"if {when} then {rule.then}")
        self._lines.append(f"(define-fun {own} () Real ; {comment}\n  {text})")
        return own

    # --- where rules are 0

    def zero(self, rule: Rule, rules: Rules, points: frozenset[str]) -> str:
        """Return where a rule is 0 at a point and around it.

        `points`: the variables whose values have none beside them.
        """
        return any_of(
            self._zero(p, rules.variables[p.variable], p.variable in points)
            for p in rule.when
        )

    def _zero(
        self, proposition: Proposition, variable: Variable, is_point: bool
    ) -> str:
        if not proposition.weight:
            return "true"
        level, formulas = ONE if proposition.negated else ZERO, list[str]()
        for term in proposition.terms:
            curve = variable.curves[term]
            if is_point or not is_straight(curve):
                degree = self.degree(variable, term)
                formulas.append(f"(= {degree} {self.number(level)})")
            else:
                own = self.value(variable)
                formulas.append(any_of(self._flat(curve.numbers, level, own)))
        return any_of(formulas) if proposition.negated else all_of(formulas)

    def _flat(self, knots: Knots, level: Fraction, own: str) -> Iterator[str]:
        """Yield that a value is in an open interval where a function is at a level."""
        starts = [knots[0].before, *(knot.after for knot in knots)]
        ends = [*(knot.before for knot in knots), knots[-1].after]
        is_flat = [a == b == level for a, b in zip(starts, ends, strict=True)]
        above: list[str] = []
        for knot, is_before, is_after in zip(knots, is_flat, is_flat[1:], strict=False):
            is_on, x = is_before and knot.at == level, self.number(knot.x)
            if is_before and not (is_on and is_after):
                yield all_of([*above, f"(< {own} {x})"])
            if not is_on:
                above = [f"(< {x} {own})"]
        if is_flat[-1]:
            yield all_of(above)

    def text(self) -> str:
        """Return all but claims."""
        logic = "QF_NRA" if self.is_product else "QF_LRA"
        pairs = self._constants.items()
        constants = (f"(define-fun |{name}| () Real {text})" for name, text in pairs)
        head = [f"(set-logic {logic})", *constants, _PRELUDE]
        return "\n".join([*head, *self._lines]) + "\n"


def _words(term: str) -> str:
    """Return a term with its hedges in front."""
    name, *hedges = term.split("\0")
    return " ".join((*hedges, name)) or "anything"


def _plain(text: str) -> str:
    """Return a text for a comment, on one line."""
    return "".join(c if c.isprintable() else " " for c in text)
