"""C99: a tree or rule base as one file of tables, for microcontrollers and others.

The file needs no library, no memory beyond the stack, and no recursion. In double, its
predictions and strengths have the reference's bits; in float, those of `native
float32`.
With a macro it is a program that tests itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Literal, cast

from fuzzytree.exporters.c_fixed import Q15, Q31, FixedSteps
from fuzzytree.exporters.c_rules import probability_code, rules_code
from fuzzytree.exporters.c_selftest import selftest_code
from fuzzytree.exporters.c_steps import HELPERS, WORDS
from fuzzytree.exporters.c_systems import SystemFile, system_file
from fuzzytree.exporters.c_tables import CModel
from fuzzytree.exporters.c_text import (
    DECLARE,
    DEFINE,
    DOUBLE,
    SINGLE,
    USE,
    CNumbers,
    checks,
    constants,
    fill,
    integer_type,
    place_type,
    prefix_of,
    real_lines,
    real_table,
    remark,
    whole_lines,
    whole_table,
)
from fuzzytree.exporters.program_text import (
    class_number,
    rated_rules,
    source_of,
    title_of,
)
from fuzzytree.model import (
    Band,
    Document,
    Format,
    FuzzySystem,
    Loss,
    Model,
    Option,
    Points,
    RuleBase,
    SystemOutput,
    Term,
    Variable,
    Written,
    fingerprint,
    narrowing_refusal,
    refusal,
    stand_ins,
)
from fuzzytree.numerics import losses
from fuzzytree.semantics import pointed, shape_of

_NUMBERS = {"float64": DOUBLE, "float32": SINGLE, "q15": Q15, "q31": Q31}

_TYPES = """
#ifdef __cplusplus
extern "C" {
#endif

/* How an answer came about. */
enum name_status {
    NAME_DECIDED = 0,
    NAME_TIE = 1, /* the first of equally strong rules */
    NAME_UNCOVERED = 2, /* no rule fires */
    NAME_MISSING = 3 /* a value is infinite, or not a number */
};

typedef struct {
    int label; /* an enum name_class */
    long rule; /* the number of the RULE, from 1; 0 for none */
    int status; /* an enum name_status */
} name_answer;

/* Return the answer for NAME_INPUTS values. */
name_answer name_decide(const name_real *x);
"""

_PROBABILITIES_TYPE = """
/* Fill in NAME_CLASSES probabilities, given an answer of name_strengths and what it
 * filled in; they are no numbers where no rule decides. */
void name_probabilities(
    name_answer found, const name_real *strengths, double *probabilities);
"""

_STRENGTHS_TYPE = """
/* Fire every rule, fill in NAME_RULES strengths (no numbers if a value is missing), and
 * return the answer, which is that of name_decide. */
name_answer name_strengths(const name_real *x, name_real *strengths);
"""


def write_c(
    model: Document,
    /,
    *,
    allow_loss: bool = False,
    dtype: Literal["float64", "float32", "q15", "q31"] = "float64",
    name: str | None = None,
    activations: bool = False,
    probabilities: bool = False,
    tables: bool = False,
    tolerance: float | None = None,
    selftest: bool = True,
) -> Written:
    """Return a model as the text of a C file, in ASCII.

    The file offers `NAME_decide(x)`, which returns class, rule (or leaf) and status;
    for a rule base also `NAME_strengths(x, strengths)`; for a fuzzy system
    `NAME_infer(x, outputs)` instead, which returns the status.

    Args:
        model: A tree, a rule base or a fuzzy system.
        allow_loss: Whether to round what float32 cannot represent.
        dtype: The type of all numbers: double, or float. Of a fuzzy system in float,
            the file says how far each output may be from exact numbers.
        name: The beginning of all names in the file; that of the model unless given.
        activations: Of a fuzzy system: whether the degree of activation of every rule
            stands behind the outputs.
        probabilities: Of a rule base that has them: whether the file also offers
            `NAME_probabilities(answer, strengths, probabilities)`.
        tables: Of a fuzzy system: whether curves of outputs are tables of all samples,
            which is some three times as quick, and larger; else they are where that
            is smaller.
        tolerance: Of fixed point: the largest error of a degree where points stand for
            a curve of an input; such curves are refused unless given.
        selftest: Whether the file also holds a program that tests it, which is what
            takes most of the time to write.

    Raises:
        LossError: If float32 cannot represent a number of the model, unless allowed.
        ValueError: If an option is not one of the above, or the name not one of C.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> text = write_c(random_tree(0), name="grip").content.decode()
        >>> "grip_answer grip_decide(const grip_real *x)" in text
        True
    """
    source = source_of(write_c, model, locals())
    if dtype not in _NUMBERS:
        raise ValueError(f"C has {', '.join(_NUMBERS)}, not {dtype!r}")
    rated = rated_rules(model, "c") if probabilities else None
    prefix = beginning(model.name, name)
    if tolerance is not None and dtype not in ("q15", "q31"):
        raise ValueError("a tolerance is that of fixed point: dtype=q15 or q31")
    if isinstance(model, FuzzySystem):
        file, lost = _system_file(
            model, dtype, activations=activations, tables=tables, tolerance=tolerance
        )
        if lost and not allow_loss:
            raise refusal(model.name, f"c {dtype}", lost)
        body = "".join(file.text(selftest=selftest))
        text = "".join(_heading(model, source)) + fill(body, prefix)
        return Written(text.encode("ascii"), lost, tuple(file.remarks()))
    if activations:
        raise ValueError("activations are those of fuzzy systems")
    if tables:
        raise ValueError("tables are those of fuzzy systems")
    if dtype not in ("float64", "float32"):
        raise ValueError("fixed point is for fuzzy systems; trees and rules are floats")
    lost = losses(model, dtype)
    if lost and not allow_loss:
        raise narrowing_refusal(model.name, "c float32", lost)
    code = CFile(model, _NUMBERS[dtype], prefix, rated=rated, source=source)
    return Written("".join(code.text(selftest=selftest)).encode("ascii"), lost)


def fixed_point(system: Document, options: Mapping[str, Option]) -> FixedSteps:
    """Return a system as `write_c` has it in fixed point: units and worst errors.

    Raises:
        ValueError: As `write_c`.
    """
    return _fixed_steps(
        cast("FuzzySystem", system),
        str(options["dtype"]),
        activations=bool(options.get("activations")),
        tables=bool(options.get("tables")),
        tolerance=cast("float | None", options.get("tolerance")),
    )


@lru_cache(maxsize=4)
def _fixed_steps(
    system: FuzzySystem,
    dtype: str,
    *,
    activations: bool,
    tables: bool,
    tolerance: float | None,
) -> FixedSteps:
    """Keep what takes seconds, for what runs a file and what compares it."""
    file, _ = _system_file(
        system, dtype, activations=activations, tables=tables, tolerance=tolerance
    )
    return cast("FixedSteps", file.steps)  # of a type of whole numbers


def _system_file(
    system: FuzzySystem,
    dtype: str,
    *,
    activations: bool,
    tables: bool,
    tolerance: float | None,
) -> tuple[SystemFile, tuple[Loss, ...]]:
    lost: tuple[Loss, ...] = ()
    if tolerance is not None:
        system, lost = pointed(system, tolerance, keeps=_has_lines)
    curves = {loss.where: loss.bound or 0.0 for loss in lost}
    numbers = _NUMBERS[dtype]
    file = system_file(
        system, numbers, activations=activations, tables=tables, curves=curves
    )
    return file, lost


def beginning(own: str, name: str | None) -> str:
    """Return the beginning of all names in a file.

    Raises:
        ValueError: If the name is given and cannot begin names in C.
    """
    prefix = prefix_of(own if name is None else name)
    if name is not None and prefix != name:
        raise ValueError(
            f"the name {name!r} cannot begin the names of C; {prefix!r} can"
        )
    return prefix


def _has_lines(variable: Variable | SystemOutput, term: Term) -> bool:
    """Return whether whole numbers have a term's degrees: of lines, or in a table."""
    is_straight = isinstance(shape_of(term.function), Points | Band)
    return isinstance(variable, SystemOutput) or is_straight


class CFile(CModel):
    """A file in the making."""

    def __init__(
        self,
        model: Model,
        numbers: CNumbers,
        prefix: str,
        *,
        rated: RuleBase | None = None,
        source: str | None = None,
    ) -> None:
        super().__init__(model, numbers)
        self.prefix = prefix
        self.source = source or fingerprint(model)
        self.rated = rated

    def text(self, *, selftest: bool) -> Iterator[str]:
        """Yield the file."""
        mixed = any(variable.parts for variable in self.model.variables)
        yield from self.declarations()
        yield from self.definitions(is_arithmetic=mixed or self.tables is not None)
        if selftest:
            yield from map(self._fill, selftest_code(self))
        yield "\n#endif\n"

    def declarations(self) -> Iterator[str]:
        """Yield the heading and what users of the file see, open at the end."""
        yield from _heading(self.model, self.source, self.outline)
        yield self._fill(USE) + self._fill(DECLARE)
        yield from self._declarations()

    def definitions(self, *, is_arithmetic: bool) -> Iterator[str]:
        """Yield the tables and functions of the model."""
        yield from map(self._fill, self._definitions(is_arithmetic=is_arithmetic))

    def _definitions(self, *, is_arithmetic: bool) -> Iterator[str]:
        yield DEFINE + checks(self.numbers, is_arithmetic=is_arithmetic)
        model, semantics = self.model, self.model.semantics
        defaults = {"MISSING": semantics.missing}
        if self.tables is not None:
            defaults["UNCOVERED"] = semantics.uncovered
        yield "\n/* The class where a value is missing, or no rule fires. */\n"
        for word, label in defaults.items():
            yield f"#define NAME_WHEN_{word} {class_number(label, model)}\n"
        yield from axes_code(model.variables, self.line, self.numbers)
        is_new = has_own_values(model.variables)
        axes = _TAKE_COMBINED if is_new else _TAKE
        if self.tables is None:
            yield from tree_code(self, axes)
        else:
            is_product = semantics.conjunction == "product"
            yield from rules_code(
                self.tables, self.numbers, axes, is_product=is_product
            )
        if self.rated is not None:
            yield from probability_code(self.rated)

    def _fill(self, template: str) -> str:
        return fill(template, self.prefix)

    def _declarations(self) -> Iterator[str]:
        model, rules = self.model, bool(self.model.rules)
        count = len(model.rule_labels)
        is_new = has_own_values(model.variables)
        yield self._fill(f"typedef {self.numbers.name} name_real;\n\n")
        for what, size in (
            ("INPUTS", len(model.inputs)),
            ("VARIABLES", len(model.variables) if is_new else None),
            ("CLASSES", len(model.classes)),
            ("RULES" if rules else "LEAVES", count),
        ):
            if size is not None:
                yield self._fill(f"#define NAME_{what} {size}u\n")
        yield self._fill("\nenum name_class {\n    NAME_NO_CLASS = -1")
        labels = constants(self._fill("NAME_CLASS_"), model.classes)
        for place, label in enumerate(labels):
            yield f",\n    {label} = {place} /* {remark(model.classes[place])} */"
        yield "\n};\n"
        for variable in model.variables:
            yield from self._categories(variable)
        yield self._fill(_TYPES).replace("RULE,", "rule," if rules else "leaf,")
        yield self._fill(_STRENGTHS_TYPE) if rules else ""
        yield self._fill(_PROBABILITIES_TYPE) if self.rated else ""
        yield "\n#ifdef __cplusplus\n}\n#endif\n"

    def _categories(self, variable: Variable) -> Iterator[str]:
        """Yield the positions of an input's categories."""
        if variable.categories:
            [kind] = constants("", [variable.name])
            prefix = self._fill(f"NAME_{kind}_")
            yield self._fill(f"\nenum name_{kind.lower()} {{")
            yield f" /* x[{self.line[variable.name]}] */"
            names = constants(prefix, variable.categories)
            for place, name in enumerate(names):
                comma = "," if place else ""
                text = remark(variable.categories[place])
                yield f"{comma}\n    {name} = {place} /* {text} */"
            yield "\n};\n"


def has_own_values(variables: Sequence[Variable]) -> bool:
    """Return whether the values of variables are others than those of the inputs."""
    return any(v.parts or v.missing is not None for v in variables)


def _heading(model: Document, source: str, lines: Iterable[str] = ()) -> Iterator[str]:
    title = title_of(model, f'"{remark(model.name)}"')
    yield f"/* {title}. Written by fuzzytree.\n"
    yield f" * Fingerprint: {source}\n *\n * Inputs, in order:\n"
    inputs = [one for one in model.variables if not one.parts]
    for place, variable in enumerate(inputs):
        yield f" *   x[{place}] {_described(variable)}\n"
    if model.outputs:
        yield " * Outputs, in order:\n"
        for place, output in enumerate(model.outputs):
            yield f" *   outputs[{place}] {_described(output)}\n"
        yield f" * Rules: {len(model.rules)}\n"
        return
    for variable in model.variables:
        if variable.parts:
            parts = " + ".join(
                f"{p.weight!r} ({remark(p.input)} - {p.centre!r})"
                for p in variable.parts
            )
            yield f" * {remark(variable.name)}: {parts}\n"
    yield " *\n"
    yield from (f" * {remark(line)}\n" for line in lines)


def _described(one: Variable | SystemOutput) -> str:
    text = f"{one.name} ({one.unit})" if one.unit else one.name
    if isinstance(one, Variable) and one.categories:
        text += ": the position of a category, from 0"
    if isinstance(one, Variable) and one.missing is not None:
        text += f"; {one.missing!r} stands for a missing value"
    return remark(text)


_FINITE = f"""
/* Look at the exponent, without a library: it is full in infinities and no numbers. */\
{HELPERS["is_finite"]}"""

_INPUTS = """
static int name_has_all(const name_real *x)
{
    unsigned place = NAME_INPUTS;
    while (place > 0)
        if (!name_is_finite(x[--place]))
            return 0;
    return 1;
}
"""

_FILL = """
/* Put what stands for a missing or infinite value in its place. */
static void name_fill(const name_real *x, name_real *value)
{
    unsigned place;
    for (place = 0; place < NAME_INPUTS; place++) {
        value[place] = x[place];
        if (name_is_replaced[place] && !name_is_finite(x[place]))
            value[place] = name_stand_in[place];
    }
}
"""

_FILLED_INPUTS = """
static int name_has_all(const name_real *x, name_real *value)
{
    unsigned place = NAME_INPUTS;
    name_fill(x, value);
    while (place > 0)
        if (!name_is_finite(value[--place]))
            return 0;
    return 1;
}
"""

_COPY = """\
    for (place = 0; place < NAME_INPUTS; place++)
        value[place] = x[place];
"""

_COMBINED = """
/* Inputs, then combinations: weight * (input - centre), summed in order. */
static int name_has_all(const name_real *x, name_real *value)
{
    unsigned place, part = 0, end;
COPY
    for (place = 0; place < NAME_VARIABLES - NAME_INPUTS; place++) {
        name_real one = value[name_part[part]] - name_centre[part];
        name_real total = name_weight[part] * one;
        for (end = name_part_end[place], part++; part < end; part++) {
            one = value[name_part[part]] - name_centre[part];
            total = total + name_weight[part] * one;
        }
        value[NAME_INPUTS + place] = total;
    }
    place = NAME_VARIABLES;
    while (place > 0)
        if (!name_is_finite(value[--place]))
            return 0;
    return 1;
}
"""

_NO_INPUTS = """
static int name_has_all(const name_real *x)
{
    (void)x;
    return 1;
}
"""

_TAKE = """\
    const name_real *value = x;
    if (!name_has_all(x))
        return answer;
"""

_TAKE_COMBINED = """\
    name_real value[NAME_VARIABLES];
    if (!name_has_all(x, value))
        return answer;
"""


def axes_code(
    variables: Sequence[Variable],
    line: Mapping[str, int],
    numbers: CNumbers,
) -> Iterator[str]:
    """Yield the check that all values are finite, and the combinations."""
    if not variables:
        yield _NO_INPUTS
        return
    text = _FINITE
    for mark, word in WORDS[numbers.name].items():
        text = text.replace(mark, word)
    mixed = [variable for variable in variables if variable.parts]
    stand = stand_ins(variables)
    copy = _COPY
    if stand:
        columns = [v.name for v in variables if not v.parts]
        about = "What stands for a missing value."
        values = numbers.rounded([stand.get(name, 0.0) for name in columns])
        yield from real_table("name_stand_in", values, about, numbers)
        is_replaced = [int(name in stand) for name in columns]
        yield from whole_table("name_is_replaced", is_replaced, "Whether it does.")
        text, copy = text + _FILL, "    name_fill(x, value);\n"
    if not mixed:
        yield text + (_FILLED_INPUTS if stand else _INPUTS) + "\n"
        return
    parts = [part for variable in mixed for part in variable.parts]
    ends: list[int] = []
    for variable in mixed:
        ends.append((ends[-1] if ends else 0) + len(variable.parts))
    weights = numbers.rounded([part.weight for part in parts], is_divisor=True)
    centres = numbers.rounded([part.centre for part in parts])
    yield from real_table("name_weight", weights, "Of combinations.", numbers)
    yield from real_table("name_centre", centres, "Of combinations.", numbers)
    inputs = [line[part.input] for part in parts]
    yield from whole_table("name_part", inputs, "Their inputs.")
    yield from whole_table("name_part_end", ends, "Behind each combination.")
    yield text + _COMBINED.replace("COPY\n", copy) + "\n"


_WALK = """
name_answer name_decide(const name_real *x)
{
    name_answer answer = {NAME_WHEN_MISSING, 0, NAME_MISSING};
    PLACE_TYPE place = 0;
TAKE_AXES
    do
        place = name_tree.next[
            2 * place + (value[name_tree.line[place]] > name_tree.cut[place])];
    while (place < NAME_QUESTIONS);
    answer.label = name_tree.label[place - NAME_QUESTIONS];
    answer.rule = (long)(place - NAME_QUESTIONS) + 1;
    answer.status = NAME_DECIDED;
    return answer;
}
"""

_TABLES = """\
/* Is the value at `line` above the cut? No and yes lead to the next two: a test, or
 * NAME_QUESTIONS + leaf - 1. And the class of each leaf. */
static const struct {
"""

_ONE_LEAF = """
name_answer name_decide(const name_real *x)
{
    name_answer answer = {NAME_WHEN_MISSING, 0, NAME_MISSING};
TAKE_AXES
    answer.label = LABEL;
    answer.rule = 1;
    answer.status = NAME_DECIDED;
    return answer;
}
"""


def tree_code(file: CModel, axes: str) -> Iterator[str]:
    """Yield the tables of a tree and the function that walks through them."""
    tests, numbers = file.tests, file.numbers
    numbered = {label: place for place, label in enumerate(file.model.classes)}
    labels = [numbered[label] for label in file.model.rule_labels]
    if not tests:
        plain = axes.replace("    const name_real *value = x;\n", "")
        text = _ONE_LEAF.replace("LABEL", str(labels[0]))
        yield text.replace("TAKE_AXES\n", plain)
        return
    ends = [place for test in tests for place in (test.no, test.yes)]
    lines = [file.line[test.variable] for test in tests]
    cuts = numbers.rounded([test.cut for test in tests])
    yield f"#define NAME_QUESTIONS {len(tests)}u\n\n"
    yield _TABLES
    for name, values in (("line", lines), ("next", ends), ("label", labels)):
        yield f"    {integer_type(max(values))} {name}[{len(values)}];\n"
    yield f"    {numbers.name} cut[{len(cuts)}];\n"
    yield "} name_tree = {\n"
    for values in (lines, ends, labels):
        yield from ("    {\n", *whole_lines(values), "    },\n")
    yield from ("    {\n", *real_lines(cuts, numbers), "    }\n};\n")
    kind = place_type(2 * len(tests) + len(labels))
    walk = _WALK.replace("PLACE_TYPE", kind).replace("TAKE_AXES\n", axes)
    yield walk


FORMAT = Format(
    name="c",
    suffixes=(".c",),
    write=write_c,
    dtype="float64",
)
