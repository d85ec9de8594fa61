"""C99: one file from the raw frame to what lies on the sensor.

The sums are whole numbers, taken in one pass over the cells: powers of x by row, then
of y, without a table of weights. The features are the steps of their program, and the
model decides by the tables of `fuzzytree.exporters.c`. `sqrt` is all that is called
of a library, and only where an angle, a direction or a logarithm needs it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from fuzzytree.exporters import (
    DOUBLE,
    LIBRARY,
    CFile,
    CSteps,
    beginning,
    bits_of,
    fill,
    remark,
    whole_lines,
    whole_table,
)
from fuzzytree.model import Model, Written
from fuzzytree.tactile.features import FrameProgram, Sum, frame_program
from fuzzytree.tactile.features.aimed import proving_frames
from fuzzytree.tactile.features.plain import check_reject, plain_shown
from fuzzytree.tactile.sensor import Sensor, offsets

_PRESSES = 6  # in the self-test, beside aimed frames
_CELLS, _FEWEST = 40_000, 6  # of its frames
_LIBRARY = {"square_root": LIBRARY["square_root"]}

_TYPES = """
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define NAME_ROWS ROWSu
#define NAME_COLUMNS COLUMNSu

typedef CELL name_cell; /* what a cell reads, as it comes from the sensor */

enum name_state {
    NAME_STATE_OBJECT = 0,
    NAME_STATE_NOTHING = 1, /* nothing presses */
    NAME_STATE_UNKNOWN = 2 /* none of the known objects */
};

typedef struct {
    int label; /* an enum name_class; NAME_NO_CLASS unless it is an object */
    int state; /* an enum name_state */
    long rule; /* the number of the rule or leaf that decides, from 1; 0 for none */
} name_recognition;

/* Compute NAME_INPUTS features of a frame, all 0 where nothing presses; return whether
 * anything does. A frame is NAME_ROWS * NAME_COLUMNS cells, from the upper left on. */
int name_features(const name_cell *frame, name_real *x);

/* Return what a frame shows. */
name_recognition name_recognise(const name_cell *frame);

#ifdef __cplusplus
}
#endif
"""

_RECOGNISE = """
name_recognition name_recognise(const name_cell *frame)
{
    name_recognition found = {NAME_NO_CLASS, NAME_STATE_NOTHING, 0};
    name_answer answer;
    name_real x[NAME_INPUTS + 1];
STRENGTHS
    if (!name_features(frame, x))
        return found;
    found.state = NAME_STATE_UNKNOWN;
    answer = DECIDE;
    if (answer.status == NAME_MISSING || answer.label == NAME_NO_CLASS)
        return found;
WEAK
    found.label = answer.label;
    found.state = NAME_STATE_OBJECT;
    found.rule = answer.rule;
    return found;
}
"""

_WEAK = """\
    if (answer.rule > 0 && strengths[answer.rule - 1] < FLOOR)
        return found;
"""

_MAIN = """
int main(void)
{
    unsigned place, line, wrong = 0, count = sizeof name_example / sizeof *name_example;
    for (place = 0; place < count; place++) {
        name_recognition found = name_recognise(name_frame[place]);
        name_real x[NAME_INPUTS + 1];
        int is_right = found.label == name_example[place].label
            && found.state == name_example[place].state
            && found.rule == name_example[place].rule;
        name_features(name_frame[place], x);
        for (line = 0; line < NAME_INPUTS; line++) {
            union { name_real value; uint64_t bits; } look;
            look.value = x[line];
            if (look.bits != name_example[place].x[line]) {
                is_right = 0;
                printf("frame %u: feature %u is %.17g\\n", place, line, x[line]);
            }
        }
        if (!is_right) {
            wrong++;
            printf("frame %u: class %d, state %d, rule %ld instead of %d, %d, %ld\\n",
                place, found.label, found.state, found.rule, name_example[place].label,
                name_example[place].state, name_example[place].rule);
        }
    }
    printf("%u of %u frames answered as expected\\n", count - wrong, count);
    return wrong != 0;
}
#endif
"""


def write_frames_c(
    model: Model, sensor: Sensor, *, name: str | None = None, reject: float = 0.0
) -> Written:
    """Return a C file, in ASCII, that takes raw frames.

    It offers `NAME_recognise(frame)`, which returns label, state and rule, and
    `NAME_features(frame, x)`; features and answers have the reference's bits. With
    -DNAME_SELFTEST it is a program that tests itself on aimed frames.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come.
        name: The beginning of all names in the file; that of the model unless given.
        reject: Of raw rules: what is weaker in the rule that decides is unknown.

    Raises:
        TableError: If an input of the model is no feature of a frame.
        InvalidModelError: If a feature is beyond the sensor.
        ValueError: If an option is not one of the above, or the name not one of C.

    Example:
        >>> import numpy as np
        >>> from fuzzytree import learn, table
        >>> areas = np.array([[4.0], [5.0], [16.0], [15.0]])
        >>> tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
        >>> text = write_frames_c(tree, Sensor(4, 4), name="grip").content.decode()
        >>> "grip_recognition grip_recognise(const grip_cell *frame)" in text
        True
    """
    prefix = beginning(model.name, name)
    check_reject(model, reject)
    made = frame_program(sensor, model.inputs)
    text = "".join(_text(made, model, prefix, reject))
    return Written(text.encode("ascii"))


def _text(
    made: FrameProgram, model: Model, prefix: str, reject: float
) -> Iterator[str]:
    sensor, file = made.sensor, CFile(model, DOUBLE, prefix)
    yield from file.declarations()
    kind = f"uint{sensor.bits}_t"
    types = _TYPES.replace("ROWSu", f"{sensor.rows}u").replace("CELL ", f"{kind} ")
    yield fill(types.replace("COLUMNSu", f"{sensor.columns}u"), prefix)
    yield from file.definitions(is_arithmetic=True)
    steps = CSteps(made.program, library=_LIBRARY)
    ends = [*_features(made, steps)]
    yield "\n#include <math.h>\n" if steps.needs_library else ""
    parts: list[Iterable[str]] = [steps.function_text(), _cells(sensor), _sums(made)]
    parts += [ends, [_recognise(reject)], _selftest(made, model, reject)]
    yield from (fill(text, prefix) for part in parts for text in part)
    yield "\n#endif\n"


def _recognise(reject: float) -> str:
    declared = "    name_real strengths[NAME_RULES];\n" if reject else ""
    decide = "name_strengths(x, strengths)" if reject else "name_decide(x)"
    weak = _WEAK.replace("FLOOR", DOUBLE.text(reject)) if reject else ""
    text = _RECOGNISE.replace("STRENGTHS\n", declared).replace("DECIDE", decide)
    return text.replace("WEAK\n", weak)


# --- sums


def _cells(sensor: Sensor) -> Iterator[str]:
    """Yield the function of the pressure on a cell."""
    taken = offsets(sensor)
    if taken:
        about = "The baseline of each cell; all that a masked one can read."
        yield "\n"
        yield from whole_table("name_offset", taken, about)
    yield "\n/* How much presses on a cell: 0 where nothing does. */\n"
    yield "static int32_t name_pressed(const name_cell *frame, unsigned place)\n{\n"
    yield "    int32_t value = frame[place];\n"
    if sensor.full != sensor.largest:
        yield f"    if (value > {sensor.full})\n        value = {sensor.full};\n"
    if taken:
        yield "    value -= name_offset[place];\n"
    is_plain = not taken and not sensor.threshold
    test = "value" if is_plain else f"value > {sensor.threshold} ? value : 0"
    yield f"    return {test};\n}}\n"


def _sums(made: FrameProgram) -> Iterator[str]:
    """Yield the function that fills in the sums, in the order of the program."""
    place = {one.name: line for line, one in enumerate(made.sums)}
    moments = [one.name for one in made.sums if one.name.startswith("sum ")]
    powers = {(int(name[4]), int(name[5])): place[name] for name in moments}
    parts = [one for one in made.sums if one.of == "cells" and one.name not in moments]
    kind = _whole_type(made)
    if parts:
        yield from _part_table(made.sensor, parts)
    yield "\n/* Take the sums from the cells: whole numbers, which are exact. */\n"
    yield "static void name_sums(const name_cell *frame, name_real *sum)\n{\n"
    yield from _pass(made, powers, kind)
    for name in ("area", "peak"):
        if name in place:
            yield f"    sum[{place[name]}] = (name_real){name};\n"
    for p, q in powers:
        yield f"    sum[{powers[p, q]}] = (name_real)sum_{p}{q};\n"
    if parts:
        first = place[parts[0].name]
        yield from _part_loop(len(parts), first, kind)
    yield "}\n"


def _whole_type(made: FrameProgram) -> str:
    """Return a type that holds each sum, and so all of its parts."""
    full = made.sensor.full
    largest = max(full * sum(map(abs, one.weights)) for one in made.sums)
    return "int32_t" if largest < 1 << 31 else "int64_t"


def _pass(
    made: FrameProgram, powers: dict[tuple[int, int], int], kind: str
) -> Iterator[str]:
    """Yield one pass over the cells: each row's sums of g x^p, times powers of y."""
    sensor = made.sensor
    others = [one.of for one in made.sums if one.of != "cells"]
    along = sorted({p for p, _ in powers})
    down = max(q for _, q in powers)
    yield "    unsigned row, column, place = 0;\n"
    yield "    unsigned area = 0;\n" if "count" in others else ""
    yield "    int32_t peak = 0;\n" if "peak" in others else ""
    for p, q in powers:
        yield f"    {kind} sum_{p}{q} = 0;\n"
    yield "    for (row = 0; row < NAME_ROWS; row++) {\n"
    if down:
        yield f"        const {kind} y = {sensor.rows // 2} - ({kind})row;\n"
    names = ", ".join(f"row_{p} = 0" for p in along)
    yield f"        {kind} {names};\n"
    yield "        for (column = 0; column < NAME_COLUMNS; column++) {\n"
    if along[-1]:
        middle = sensor.columns // 2
        yield f"            const {kind} x = ({kind})column - {middle};\n"
    yield f"            {kind} g = name_pressed(frame, place++);\n"
    yield "            if (g == 0)\n                continue;\n"
    yield "            area++;\n" if "count" in others else ""
    if "peak" in others:
        yield "            if (g > peak)\n                peak = (int32_t)g;\n"
    for p in range(along[-1] + 1):
        yield "            g *= x;\n" if p else ""
        yield f"            row_{p} += g;\n" if p in along else ""
    yield "        }\n"
    for q in range(down + 1):
        for p in along:
            if (p, q) in powers:
                yield f"        sum_{p}{q} += row_{p};\n"
        left = [
            p for p in along if any((p, k) in powers for k in range(q + 1, down + 1))
        ]
        for p in left:
            yield f"        row_{p} *= y;\n"
    yield "    }\n"


def _part_table(sensor: Sensor, parts: Sequence[Sum]) -> Iterator[str]:
    """Yield the first and last row, and the first and last column, of each part."""
    ends: list[int] = []
    for one in parts:
        inside = [place for place, weight in enumerate(one.weights) if weight]
        columns = [place % sensor.columns for place in inside]
        ends += [inside[0] // sensor.columns, inside[-1] // sensor.columns]
        ends += [min(columns), max(columns)]
    about = "First and last row, first and last column of blocks and cells."
    yield "\n"
    yield from whole_table("name_patch", ends, about)


def _part_loop(count: int, first: int, kind: str) -> Iterator[str]:
    yield f"    for (place = 0; place < {count}u; place++) {{\n"
    yield f"        {kind} total = 0;\n"
    for line, side, indent in ((0, "row", " " * 8), (2, "column", " " * 12)):
        start, end = (f"name_patch[4 * place + {one}]" for one in (line, line + 1))
        yield f"{indent}for ({side} = {start}; {side} <= {end}; {side}++)\n"
    yield "                total += name_pressed(frame, row * NAME_COLUMNS + column);\n"
    yield f"        sum[{first} + place] = (name_real)total;\n    }}\n"


# --- features


def _features(made: FrameProgram, steps: CSteps) -> Iterator[str]:
    """Yield the functions from the sums to the features."""
    *features, pressed = made.program.results
    yield "\n/* The features of the sums x; return whether anything presses. */\n"
    yield "static int name_of_sums(const name_real *x, name_real *found)\n{\n"
    yield from steps.body
    yield "" if features else "    (void)found;\n"
    for line, one in enumerate(features):
        yield f"    found[{line}] = {steps.value(one.step)};"
        yield f" /* {remark(one.name)} */\n"
    yield f"    return {steps.value(pressed.step)} > 0;\n}}\n"
    yield "\nint name_features(const name_cell *frame, name_real *x)\n{\n"
    yield f"    name_real sum[{len(made.sums)}];\n"
    yield "    name_sums(frame, sum);\n    return name_of_sums(sum, x);\n}\n"


# --- the self-test


def _selftest(made: FrameProgram, model: Model, reject: float) -> Iterator[str]:
    """Yield aimed frames with their answers, and a program that compares them."""
    frames = proving_frames(made, model, _PRESSES)
    size = made.sensor.rows * made.sensor.columns
    few = max(_FEWEST, _CELLS // size)  # a large sensor would make a file of megabytes
    frames = frames[:: -(-len(frames) // few)]
    yield "\n#ifdef NAME_SELFTEST\n#include <stdio.h>\n\n"
    yield f"static const name_cell name_frame[{len(frames)}][{size}] = {{\n"
    for frame in frames:
        yield "    {\n"
        yield from whole_lines(frame.reshape(-1).tolist())
        yield "    },\n"
    yield "};\n\n/* The bits of the features; class, state and rule. */\n"
    yield "static const struct {\n    uint64_t x[NAME_INPUTS + 1];\n"
    yield "    int label;\n    int state;\n    long rule;\n"
    yield f"}} name_example[{len(frames)}] = {{\n"
    for frame in frames:
        shown = plain_shown(made, model, frame, reject)
        values, ends = shown.features, f"{shown.code}, {shown.state}, {shown.rule}"
        yield f"    /* {', '.join(map(repr, values)) or 'no features'} */\n"
        yield f"    {{{bits_of(values)}, {ends}}},\n"
    yield "};\n" + _MAIN
