"""A small evaluator of Structured Text: our own, for want of one by others.

The grammar is of others (tree-sitter-iec61131-3-st). What statements mean is ours, and
strict: names are declared and unlike in any case, types are never mixed, constants and
inputs are not assigned, places lie within their array, nothing is divided by zero.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

Scope = dict[str, Any]
Run = Callable[[Scope], None]
Get = Callable[[Scope], Any]

KINDS: dict[str, type] = {
    "LREAL": float,
    "REAL": np.float32,
    "INT": int,
    "DINT": int,
    "BOOL": bool,
}
TRUTHS = {"TRUE": True, "FALSE": False}
LIMITS: dict[str, float] = {"INT": 1 << 15, "DINT": 1 << 31}
ARITHMETIC = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}


def unbounded(function: Callable[..., float]) -> Callable[..., float]:
    """Return a function that is infinite where Python raises."""

    def quiet(*given: float) -> float:
        try:
            return function(*given)
        except OverflowError:
            return math.inf

    return quiet


FUNCTIONS: dict[str, Callable[..., float]] = {
    "ABS": abs,
    "EXP": unbounded(math.exp),
    "SQRT": math.sqrt,
    "SIN": math.sin,
    "COS": math.cos,
    "TAN": math.tan,
    "ATAN": math.atan,
    "EXPT": unbounded(math.pow),
}
COMPARISONS = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "=": operator.eq,
}


class Block:
    """A function block that can be called.

    Attributes:
        name: Its name.
        sections: The names declared in each section, such as `VAR_INPUT`.
    """

    def __init__(self, content: bytes) -> None:
        import tree_sitter
        import tree_sitter_iec61131_3_st as grammar

        language = tree_sitter.Language(grammar.language())
        root = tree_sitter.Parser(language).parse(content).root_node
        assert not root.has_error, "the grammar refuses the text"
        (block,) = [one for one in root.named_children if one.type != "comment"]
        assert block.type == "function_block_declaration"
        self.name = text(block.child_by_field_name("name"))
        self.sections: dict[str, list[str]] = {}
        self.types: dict[str, tuple[str, int, int] | str] = {}
        self.fixed: set[str] = set()
        self.start: Scope = {}
        for part in block.named_children:
            if part.type.startswith("var"):
                self._declare(part)
        self.body = [self._statement(one) for one in statements(block, "body")]

    def __call__(self, **inputs: float) -> Scope:
        """Return all variables after one call of a fresh instance."""
        scope = {
            n: v.copy() if isinstance(v, dict) else v for n, v in self.start.items()
        }
        assert list(inputs) == self.sections.get("VAR_INPUT", [])
        for name, value in inputs.items():
            scope[name] = KINDS[str(self.types[name])](value)
        with np.errstate(over="ignore", under="ignore"):
            for run in self.body:
                run(scope)
        return scope

    def _declare(self, part: Any) -> None:
        section = part.children[0].type
        is_constant = any(one.type == "var_qualifier_list" for one in part.children)
        for one in part.named_children:
            if one.type != "variable_declaration":
                continue
            name = text(one.child_by_field_name("names"))
            known = {other.casefold() for other in [*self.types, self.name]}
            assert name.casefold() not in known, f"{name} stands twice"
            self.sections.setdefault(section, []).append(name)
            kind = one.child_by_field_name("type")
            given = [
                text(value)
                for value in one.children_by_field_name("initial_value")
                if value.is_named and value.type != "comment"
            ]
            if kind.type == "array_type":
                lower, upper = map(
                    int, map(text, kind.child_by_field_name("range").named_children)
                )
                element = text(kind.child_by_field_name("element_type"))
                self.types[name] = (element, lower, upper)
                places = range(lower, upper + 1)
                assert not given or len(given) == len(places), name
                made: Callable[[Any], Any] = KINDS[element]
                if element == "BOOL":
                    made = TRUTHS.__getitem__
                values = given or ["FALSE" if element == "BOOL" else "0"] * len(places)
                self.start[name] = dict(zip(places, map(made, values), strict=True))
            else:
                self.types[name] = text(kind)
                self.start[name] = KINDS[text(kind)](0)
            if is_constant or section == "VAR_INPUT":
                assert given or section == "VAR_INPUT", f"{name} has no value"
                self.fixed.add(name)

    def _statement(self, node: Any) -> Run:
        if node.type == "assignment_statement":
            return self._assignment(node)
        if node.type == "if_statement":
            return self._choice(node)
        assert node.type == "for_statement", node.type
        return self._loop(node)

    def _assignment(self, node: Any) -> Run:
        target = node.child_by_field_name("left")
        value = self._expression(node.child_by_field_name("right"))
        if target.type == "identifier":
            name, kind = text(target), self.types[text(target)]
            assert isinstance(kind, str)

            def assign(scope: Scope) -> None:
                scope[name] = checked(value(scope), kind, name)

        else:
            name, index = self._indexed(target)
            element = str(self.types[name][0])

            def assign(scope: Scope) -> None:
                place = index(scope)
                assert place in scope[name], f"{name}[{place}]"
                scope[name][place] = checked(value(scope), element, name)

        assert name not in self.fixed, f"{name} cannot be assigned"
        return assign

    def _choice(self, node: Any) -> Run:
        arms = [
            (
                self._expression(node.child_by_field_name("condition")),
                [self._statement(one) for one in statements(node, "consequence")],
            )
        ]
        otherwise: list[Run] = []
        for part in node.named_children:
            if part.type == "elsif_clause":
                test = self._expression(part.child_by_field_name("condition"))
                arms.append(
                    (test, [self._statement(x) for x in statements(part, "body")])
                )
            elif part.type == "else_clause":
                otherwise = [self._statement(one) for one in statements(part, "body")]

        def choose(scope: Scope) -> None:
            chosen = otherwise
            for test, body in arms:
                found = test(scope)
                assert type(found) is bool
                if found:
                    chosen = body
                    break
            for run in chosen:
                run(scope)

        return choose

    def _loop(self, node: Any) -> Run:
        name = text(node.child_by_field_name("control"))
        first = self._expression(node.child_by_field_name("start"))
        last = self._expression(node.child_by_field_name("end"))
        body = [self._statement(one) for one in statements(node, "body")]
        assert self.types[name] == "DINT"

        def loop(scope: Scope) -> None:
            for value in range(first(scope), last(scope) + 1):
                scope[name] = value
                for run in body:
                    run(scope)
                assert scope[name] == value, f"{name} changes within its loop"

        return loop

    def _indexed(self, node: Any) -> tuple[str, Get]:
        assert node.type == "index_expression", node.type
        name = text(node.child_by_field_name("object"))
        assert isinstance(self.types[name], tuple)
        return name, self._expression(node.child_by_field_name("index"))

    def _expression(self, node: Any) -> Get:
        match node.type:
            case "identifier" if text(node) in ("TRUE", "FALSE"):
                truth = text(node) == "TRUE"
                return lambda scope: truth
            case "boolean_literal":
                truth = text(node) == "TRUE"
                return lambda scope: truth
            case "identifier":
                name = text(node)
                assert isinstance(self.types[name], str)
                return lambda scope: scope[name]
            case "integer_literal":
                whole = int(text(node))
                return lambda scope: whole
            case "typed_literal":
                kind = KINDS[text(node.child_by_field_name("type"))]
                number = kind(text(node.child_by_field_name("value")))
                return lambda scope: number
            case "parenthesized_expression":
                (inner,) = node.named_children
                return self._expression(inner)
            case "index_expression":
                name, index = self._indexed(node)
                return lambda scope: scope[name][index(scope)]
            case "call_expression":
                function = FUNCTIONS[text(node.child_by_field_name("function"))]
                given = node.child_by_field_name("arguments").named_children
                values = [self._expression(one) for one in given]

                def call(scope: Scope) -> Any:
                    numbers = [value(scope) for value in values]
                    (found,) = {type(number) for number in numbers}
                    return found(function(*numbers))

                return call
            case "unary_expression":
                return self._unary(node)
            case "binary_expression":
                return self._binary(node)
        raise AssertionError(f"{node.type}: {text(node)}")

    def _unary(self, node: Any) -> Get:
        value = self._expression(node.child_by_field_name("operand"))
        if text(node.child_by_field_name("operator")) == "-":
            return lambda scope: -value(scope)
        assert text(node.child_by_field_name("operator")) == "NOT"

        def inverse(scope: Scope) -> bool:
            found = value(scope)
            assert type(found) is bool
            return not found

        return inverse

    def _binary(self, node: Any) -> Get:
        sign = text(node.child_by_field_name("operator"))
        one = self._expression(node.child_by_field_name("left"))
        two = self._expression(node.child_by_field_name("right"))

        def both(scope: Scope) -> Any:
            a, b = one(scope), two(scope)
            assert type(a) is type(b), f"types are mixed: {text(node)}"
            if sign in COMPARISONS:
                return bool(COMPARISONS[sign](a, b))
            if sign in ("AND", "OR"):
                assert type(a) is bool
                return (a and b) if sign == "AND" else (a or b)
            assert type(a) is not bool
            assert sign != "/" or (b != 0 and type(b) is not int), text(node)
            return ARITHMETIC[sign](a, b)

        return both


def checked(value: Any, kind: Any, name: str) -> Any:
    """Return a value that has the type of what it is assigned to."""
    found = type(value)
    assert found is KINDS[kind], f"{name} is {kind}, not {found}"
    limit = LIMITS.get(kind, math.inf)
    assert limit == math.inf or -limit <= value < limit, name
    return value


def statements(node: Any, field: str) -> Iterator[Any]:
    """Yield the statements of a field."""
    for one in node.children_by_field_name(field):
        if one.is_named and one.type not in ("empty_statement", "comment"):
            yield one


def text(node: Any) -> str:
    """Return what a node stands for."""
    return str(node.text.decode("ascii"))
