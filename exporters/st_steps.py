"""The steps of a fuzzy system as statements, with loops over samples.

Controllers may stop where a number is NaN, so none is ever made. A step that can be NaN
has a truth beside it (`o` and its number): whether it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.exporters.program_text import StepText, class_number, strengths_of
from fuzzytree.exporters.st_text import Declaration, StNumbers, remark, table
from fuzzytree.model import RuleBase, sentence
from fuzzytree.semantics import BELOW_ONE, Program, Step, still_results

_SIGNS: Mapping[str, str] = {**StepText.signs, "equal": "=", "and": "AND", "or": "OR"}
_COMPARED = {"minimum": "<", "maximum": ">", "lowest": "<", "highest": ">"}
_FUNCTIONS: Mapping[str, str] = {
    "absolute": "ABS",
    "square_root": "SQRT",
    "exponential": "EXP",
    "sine": "SIN",
    "cosine": "COS",
    "tangent": "TAN",
    "arc_tangent": "ATAN",
    "power": "EXPT",
}
_REDUCED = ("total", "last", "highest", "lowest")
KNOWN = frozenset(
    {*_SIGNS, *_COMPARED, *_FUNCTIONS, *_REDUCED, "input", "where", "not"}
    | {"negate", "running", "is_finite"}
)
"""Operations that have statements."""


class StSteps:
    """Statements of a program.

    Attributes:
        declared: The variables that they set, by name.
        tables: The tables that they look into.
    """

    about = "a value for each sample"  # of its tables

    def __init__(
        self, program: Program, inputs: Mapping[str, str], numbers: StNumbers
    ) -> None:
        """Prepare the statements."""
        self.program, self.inputs, self.numbers = program, inputs, numbers
        self.still = still_results(program)
        self.declared: dict[str, Declaration] = {}
        self.tables: list[Declaration] = []
        self._tables: dict[str, str] = {}

    def value(self, place: int) -> str:
        """Return a step's result; of samples, the one of number k."""
        result, step = self.still[place], self.program.steps[place]
        if isinstance(result, list):
            return f"{self.table(result)}[k]"
        if isinstance(result, bool):
            return "TRUE" if result else "FALSE"
        if result is not None:
            return self.numbers.literal(self.rounded(result))
        if step.operation == "input":
            return self.inputs[step.name]
        return self.variable(place, step)

    def variable(self, place: int, step: Step) -> str:
        """Return the variable of a step's result."""
        letter = "b" if step.kind == "truth" else "v"
        return f"{letter}{place}[k]" if step.samples else f"{letter}{place}"

    def rounded(self, value: float) -> float:
        """Return a constant in the type of the file; 0 where it is NaN."""
        return 0.0 if math.isnan(value) else self.numbers.nearest(value)

    def assignment(
        self, name: str, operation: str, operands: Sequence[str]
    ) -> Iterator[str]:
        """Yield what sets a variable to the result of an operation without samples."""
        if operation in _COMPARED:
            a, b = operands
            test = f"{a} {_COMPARED[operation]} {b}"
            yield f"IF {test} THEN {name} := {a}; ELSE {name} := {b}; END_IF;"
        elif operation == "where":
            test, a, b = operands
            yield f"IF {test} THEN {name} := {a}; ELSE {name} := {b}; END_IF;"
        elif operation in _FUNCTIONS:
            yield f"{name} := {_FUNCTIONS[operation]}({', '.join(operands)});"
        elif operation == "negate":
            yield f"{name} := -{operands[0]};"
        elif operation == "not":
            yield f"{name} := NOT {operands[0]};"
        elif operation == "is_finite":
            largest = self.numbers.literal(self.numbers.largest)
            yield f"{name} := ABS({operands[0]}) <= {largest};"
        else:
            yield f"{name} := {operands[0]} {_SIGNS[operation]} {operands[1]};"

    def table(self, values: Sequence[float] | Sequence[bool]) -> str:
        """Return the name of a table."""
        kind, entries = "BOOL", ["TRUE" if one else "FALSE" for one in values]
        if not isinstance(values[0], bool):
            kind = self.numbers.name
            entries = [self.numbers.digits(self.rounded(value)) for value in values]
        key = f"{kind} {' '.join(entries)}"
        if key not in self._tables:
            self._tables[key] = f"t{len(self._tables)}"
            self.tables.append(table(self._tables[key], kind, entries, self.about))
        return self._tables[key]


class SystemSteps(StSteps):
    """Statements of a system, where all inputs are finite."""

    def __init__(
        self, program: Program, inputs: Mapping[str, str], numbers: StNumbers
    ) -> None:
        """Prepare the statements."""
        super().__init__(program, inputs, numbers)
        self.odd = self._odd_steps()

    def lacking(self) -> list[str]:
        """Return what the program needs and the language has not."""
        moving = [
            step
            for step, result in zip(self.program.steps, self.still, strict=True)
            if result is None
        ]
        missing = sorted({step.operation for step in moving} - KNOWN)
        for place, result in enumerate(self.still):
            numbers = result if isinstance(result, list) else [result]
            is_infinite = any(one is not None and math.isinf(one) for one in numbers)
            if is_infinite and not self._is_outside(place):
                return [*missing, "infinite numbers"]
        return missing

    def _is_outside(self, place: int) -> bool:
        """Return whether a number only stands for samples that are not chosen.

        Then the step that follows takes the lowest or highest of the chosen, and the
        largest number of the type does as well as an infinite one.
        """
        choices = self._users(place)
        reducers = [user for choice in choices for user in self._users(choice)]
        steps = self.program.steps
        return all(
            steps[choice].operation == "where" and steps[choice].samples
            for choice in choices
        ) and all(steps[user].operation in ("lowest", "highest") for user in reducers)

    def _users(self, place: int) -> list[int]:
        """Return the steps that use a step and that are computed when it runs."""
        return [
            user
            for user, step in enumerate(self.program.steps)
            if place in step.arguments and self.still[user] is None
        ]

    def statements(self) -> Iterator[str]:
        """Yield the statements of all steps."""
        for place, step in enumerate(self.program.steps):
            if self.still[place] is None and step.operation != "input":
                for line in self._statement(place, step):
                    yield f"    {line}\n"

    def is_odd(self, place: int) -> str:
        """Return whether a step's result is NaN, as an expression."""
        result = self.still[place]
        if isinstance(result, float):
            return "TRUE" if math.isnan(result) else "FALSE"
        if place not in self.odd:
            return "FALSE"
        return f"o{place}[k]" if self.program.steps[place].samples else f"o{place}"

    def _odd_steps(self) -> set[int]:
        """Return the steps that can be NaN where every input is a number."""
        result: set[int] = set()
        for place, step in enumerate(self.program.steps):
            still = self.still[place]
            if still is not None:
                numbers = still if isinstance(still, list) else [still]
                is_odd = any(map(math.isnan, numbers))
            elif step.kind == "truth":
                is_odd = False
            else:
                is_odd = any(argument in result for argument in step.arguments)
                is_odd = is_odd or step.operation == "square_root"
                is_odd = is_odd or (
                    step.operation == "divide" and not self._is_safe(step.arguments[1])
                )
            if is_odd:
                result.add(place)
        return result

    def _is_safe(self, divisor: int) -> bool:
        """Return whether a divisor is a constant, and not 0."""
        still = self.still[divisor]
        if still is None:
            return False
        numbers = still if isinstance(still, list) else [still]
        return all(numbers)

    def _statement(self, place: int, step: Step) -> Iterator[str]:
        name, odd = self.value(place), self.is_odd(place)
        self._declare(name, step)
        if place in self.odd:
            self._declare(odd, step)
        if step.operation in _REDUCED or step.operation == "running":
            yield from self._over_samples(place, step)
            return
        lines = self._one(place, step)
        if not step.samples:
            yield from lines
            return
        yield f"FOR k := 0 TO {step.samples - 1} DO"
        for line in lines:
            yield f"    {line}"
        yield "END_FOR;"

    def _declare(self, name: str, step: Step) -> None:
        kind = self.numbers.name if name.startswith("v") else "BOOL"
        plain = name.removesuffix("[k]")
        bounds = None if plain == name else (0, step.samples - 1)
        self.declared[plain] = Declaration(plain, kind, bounds=bounds)

    def _one(self, place: int, step: Step) -> Iterator[str]:
        """Yield what sets one result."""
        name, operation = self.value(place), step.operation
        operands = [self.value(argument) for argument in step.arguments]
        odd = self.is_odd(place)
        if operation == "where":
            yield from self.assignment(name, operation, operands)
            if place in self.odd:
                odds = [operands[0], *map(self.is_odd, step.arguments[1:])]
                yield from self.assignment(odd, operation, odds)
            return
        flags = [self.is_odd(a) for a in step.arguments if a in self.odd]
        odds = list(dict.fromkeys(flags))
        if step.kind == "truth":
            yield from self.assignment(name, operation, operands)
            for one in odds:  # NaN is neither less than a number nor equal to one
                yield f"IF {one} THEN {name} := FALSE; END_IF;"
            return
        if place not in self.odd:
            yield from self.assignment(name, operation, operands)
            return
        tests = list(odds)
        if operation == "divide" and not self._is_safe(step.arguments[1]):
            tests.append(f"({operands[1]} = {self.numbers.literal(0.0)})")
        elif operation == "square_root":
            tests.append(f"({operands[0]} < {self.numbers.literal(0.0)})")
        yield f"{odd} := {' OR '.join(tests)};"
        yield f"IF {odd} THEN"
        yield f"    {name} := {self.numbers.literal(0.0)};"
        yield "ELSE"
        for line in self.assignment(name, operation, operands):
            yield f"    {line}"
        yield "END_IF;"

    def _over_samples(self, place: int, step: Step) -> Iterator[str]:
        """Yield what makes one number of many samples, or sums up to each."""
        (argument,) = step.arguments
        count = self.program.steps[argument].samples
        operands, name = self.value(argument), self.value(place)
        first, plain = operands.replace("[k]", "[0]"), name.removesuffix("[k]")
        if argument in self.odd:
            odd, one = self.is_odd(place), self.is_odd(argument)
            yield from self._any_odd(odd, one, count, is_running=step.samples > 0)
        if step.operation == "last":
            yield f"{plain} := {operands.replace('[k]', f'[{count - 1}]')};"
        elif step.operation == "total":
            yield from self._total(plain, operands, count)
        elif step.operation == "running":
            yield f"{plain}[0] := {first};"
            yield f"FOR k := 1 TO {count - 1} DO"
            yield f"    {name} := {plain}[k - 1] + {operands};"
            yield "END_FOR;"
        else:
            sign = _COMPARED[step.operation]
            yield f"{plain} := {first};"
            yield f"FOR k := 1 TO {count - 1} DO"
            test = f"NOT ({plain} {sign} {operands})"
            yield f"    IF {test} THEN {plain} := {operands}; END_IF;"
            yield "END_FOR;"

    def _any_odd(
        self, odd: str, one: str, count: int, *, is_running: bool
    ) -> Iterator[str]:
        """Yield whether any sample is NaN, or any up to each."""
        if is_running:
            yield f"{odd.replace('[k]', '[0]')} := {one.replace('[k]', '[0]')};"
            yield f"FOR k := 1 TO {count - 1} DO"
            yield f"    {odd} := {odd.replace('[k]', '[k - 1]')} OR {one};"
        else:
            yield f"{odd} := FALSE;"
            yield f"FOR k := 0 TO {count - 1} DO"
            yield f"    {odd} := {odd} OR {one};"
        yield "END_FOR;"

    def _total(self, plain: str, operands: str, count: int) -> Iterator[str]:
        """Yield the sum by halves: the second half is added to the first."""
        size = 1 << (count - 1).bit_length()
        kind, known = self.numbers.name, self.declared.get("halves")
        last = max(size - 1, known.bounds[1] if known and known.bounds else 0)
        self.declared["halves"] = Declaration("halves", kind, bounds=(0, last))
        yield f"FOR k := 0 TO {count - 1} DO"
        yield f"    halves[k] := {operands};"
        yield "END_FOR;"
        if size > count:
            yield f"FOR k := {count} TO {size - 1} DO"
            yield f"    halves[k] := {self.numbers.literal(0.0)};"
            yield "END_FOR;"
        while size > 1:
            size //= 2
            yield f"FOR k := 0 TO {size - 1} DO"
            yield f"    halves[k] := halves[k] + halves[k + {size}];"
            yield "END_FOR;"
        yield f"{plain} := halves[0];"


class RuleSteps(StSteps):
    """Statements that compute `strengths`, where all values are finite."""

    about = "points of a shape, or their degrees"

    def __init__(
        self, rules: RuleBase, values: Mapping[str, str], numbers: StNumbers
    ) -> None:
        """Prepare the statements."""
        program, self._strengths = strengths_of(rules)
        super().__init__(program, values, numbers)
        self.rules = rules
        self._numbers: dict[int, int] = {}

    def statements(self) -> Iterator[str]:
        """Yield the steps that each rule needs first, and then its strength."""
        done: set[int] = set()
        for number, place in enumerate(self._strengths, 1):
            rule = self.rules.rules[number - 1]
            yield f"    (* {number}. {remark(sentence(rule))} *)\n"
            for step in self._needed(place, done):
                for line in self._statement(step):
                    yield f"    {line}\n"
            yield f"    strengths[{number}] := {self.value(place)};\n"

    def _needed(self, place: int, done: set[int]) -> list[int]:
        """Return the steps that a step needs and that are not done, in order."""
        result: set[int] = set()
        todo = [place]
        while todo:
            one = todo.pop()
            if one not in done and self.still[one] is None:
                done.add(one)
                result.add(one)
                todo += self.program.steps[one].arguments
        return sorted(result)

    def rounded(self, value: float) -> float:
        """Return a constant in the type of the file; what is below 1 stays so."""
        return self.numbers.below_one if value == BELOW_ONE else super().rounded(value)

    def variable(self, place: int, step: Step) -> str:
        """Return the variable of a step's result: v, b of truths, n of places."""
        number = self._numbers.setdefault(place, len(self._numbers) + 1)
        if step.operation == "below":
            return f"n{number}"
        return f"{'b' if step.kind == 'truth' else 'v'}{number}"

    def _statement(self, place: int) -> Iterator[str]:
        step = self.program.steps[place]
        if step.operation == "input":
            return
        name = self.value(place)
        kinds = {"n": "DINT", "b": "BOOL", "v": self.numbers.name}
        self.declared[name] = Declaration(name, kinds[name[0]])
        operands = [self.value(argument) for argument in step.arguments]
        if step.operation == "below":
            places, last = self.table(step.table), len(step.table) - 1
            yield f"{name} := 0;"
            yield f"FOR k := 0 TO {last} DO"
            yield f"    IF {places}[k] < {operands[0]} THEN {name} := k + 1; END_IF;"
            yield "END_FOR;"
        elif step.operation == "pick":
            yield f"{name} := {self.table(step.table)}[{operands[0]}];"
        elif step.operation in _COMPARED:
            # The first one if they are equal, as in the reference: -0 or 0.
            yield from self.assignment(name, step.operation, operands[::-1])
        else:
            yield from self.assignment(name, step.operation, operands)


def decision(rules: RuleBase, numbers: StNumbers) -> Iterator[str]:
    """Yield statements that find the first of the strongest rules."""
    zero = numbers.literal(0.0)
    none = class_number(rules.semantics.uncovered, rules)
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
