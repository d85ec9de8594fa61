"""The rules of a rule base as statements: steps of its program, and the decision."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from fuzzytree.exporters.st_text import Numbers, remark, table
from fuzzytree.model.rulebase import RuleBase, sentence
from fuzzytree.semantics.programs.evaluate import still_results
from fuzzytree.semantics.programs.membership import BELOW_ONE
from fuzzytree.semantics.programs.rule_program import from_rules
from fuzzytree.semantics.programs.steps import Step

_SIGNS: Mapping[str, str] = {
    "add": "+",
    "subtract": "-",
    "multiply": "*",
    "divide": "/",
    "less": "<",
    "at_most": "<=",
    "equal": "=",
    "and": "AND",
    "or": "OR",
}
_COMPARED = {"minimum": "<", "maximum": ">"}


class RuleSteps:
    """Statements that compute `strengths`, where all values are finite.

    Attributes:
        declared: The type of each variable that they set, by name.
        tables: The lines of the tables that they look into.
    """

    def __init__(
        self, rules: RuleBase, values: Mapping[str, str], numbers: Numbers
    ) -> None:
        """Prepare the statements.

        Args:
            rules: The rule base.
            values: The name of each variable's value.
            numbers: The number type.
        """
        self.rules = rules
        self.values = values
        self.numbers = numbers
        # Combinations are computed before, where it is known what is missing.
        plain = tuple(replace(variable, parts=()) for variable in rules.variables)
        self.program = from_rules(replace(rules, variables=plain, columns=()))
        self.still = still_results(self.program)
        self.declared: dict[str, str] = {}
        self.tables: list[str] = []
        self._names: dict[tuple[float, ...], str] = {}
        self._numbers: dict[int, int] = {}

    def statements(self) -> Iterator[str]:
        """Yield the steps that each rule needs first, and then its strength."""
        done: set[int] = set()
        for number, shown in enumerate(self.program.of("strength"), 1):
            # What is shown is the strength where all values are known, else NaN.
            place = self.program.steps[shown].arguments[1]
            rule = self.rules.rules[number - 1]
            yield f"    (* {number}. {remark(sentence(rule))} *)\n"
            for step in self._needed(place, done):
                for line in self._statement(step):
                    yield f"    {line}\n"
            yield f"    strengths[{number}] := {self._value(place)};\n"

    def _needed(self, place: int, done: set[int]) -> list[int]:
        """Return the steps that a step needs and that are not done, in order."""
        found: set[int] = set()
        todo = [place]
        while todo:
            one = todo.pop()
            if one not in done and self.still[one] is None:
                done.add(one)
                found.add(one)
                todo += self.program.steps[one].arguments
        return sorted(found)

    def _value(self, place: int) -> str:
        found = self.still[place]
        step = self.program.steps[place]
        if isinstance(found, bool):
            return "TRUE" if found else "FALSE"
        if isinstance(found, float):
            return self.numbers.literal(self._number(found))
        if step.operation == "input":
            return self.values[step.name]
        number = self._numbers.setdefault(place, len(self._numbers) + 1)
        return f"{self._letter(step)}{number}"

    def _number(self, value: float) -> float:
        if value == BELOW_ONE:
            return self.numbers.below_one
        return self.numbers.nearest(value)

    def _letter(self, step: Step) -> str:
        """Return the first letter of a step's variable: v, b of truths, n of places."""
        if step.operation == "below":
            return "n"
        return "b" if step.kind == "truth" else "v"

    def _statement(self, place: int) -> Iterator[str]:
        step = self.program.steps[place]
        operation = step.operation
        if operation == "input":
            return
        name = self._value(place)
        kinds = {"n": "DINT", "b": "BOOL", "v": self.numbers.name}
        self.declared[name] = kinds[name[0]]
        given = [self._value(argument) for argument in step.arguments]
        if operation in _SIGNS:
            yield f"{name} := {given[0]} {_SIGNS[operation]} {given[1]};"
        elif operation in _COMPARED:
            a, b = given  # a if they are equal, as in the reference: -0 or 0
            test = f"{b} {_COMPARED[operation]} {a}"
            yield f"IF {test} THEN {name} := {b}; ELSE {name} := {a}; END_IF;"
        elif operation == "where":
            test, a, b = given
            yield f"IF {test} THEN {name} := {a}; ELSE {name} := {b}; END_IF;"
        elif operation == "negate":
            yield f"{name} := -{given[0]};"
        elif operation == "below":
            places, last = self._table(step), len(step.table) - 1
            yield f"{name} := 0;"
            yield f"FOR k := 0 TO {last} DO"
            yield f"    IF {places}[k] < {given[0]} THEN {name} := k + 1; END_IF;"
            yield "END_FOR;"
        elif operation == "pick" and given[0].startswith("n"):
            yield f"{name} := {self._table(step)}[{given[0]}];"
        else:  # what else there is answers which rule wins, and that is done below
            raise AssertionError(operation)

    def _table(self, step: Step) -> str:
        if step.table not in self._names:
            name = f"t{len(self._names)}"
            self._names[step.table] = name
            digits = [self.numbers.digits(self._number(x)) for x in step.table]
            about = "points of a shape, or their degrees"
            self.tables += table(name, self.numbers.name, digits, about)
        return self._names[step.table]


def decision(rules: RuleBase, numbers: Numbers) -> Iterator[str]:
    """Yield statements that find the first of the strongest rules."""
    zero = numbers.literal(0.0)
    uncovered = rules.semantics.uncovered
    none = -1 if uncovered is None else rules.classes.index(uncovered)
    yield "    rule := 1;\n"
    yield "    status := 0;\n"
    yield f"    FOR k := 2 TO {len(rules.rules)} DO\n"
    yield "        IF strengths[k] > strengths[rule] THEN\n"
    yield "            rule := k;\n"
    yield "            status := 0;\n"
    yield "        ELSIF strengths[k] = strengths[rule] THEN\n"
    yield "            status := 1;\n"
    yield "        END_IF;\n"
    yield "    END_FOR;\n"
    yield "    class_number := rule_class[rule - 1];\n"
    yield f"    IF strengths[rule] = {zero} THEN\n"
    yield "        rule := 0;\n"
    yield "        status := 2;\n"
    yield f"        class_number := {none};\n"
    yield "    END_IF;\n"
