"""Pieces of C: numbers, tables, names and comments, each safe whatever a model says.

Text of a model enters C only through `remark` (comments) and `constants` (names of
enumerators), so that nothing in it can be mistaken for code.
"""

from __future__ import annotations

import math
import string
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fuzzytree.exporters.program_text import NumberType, one_line
from fuzzytree.model import DIGITS, LETTERS, NameMap

_WIDTH = 88
_LONGEST_PREFIX = 20  # C99 promises that 31 letters of a global name count
_LONGEST_CONSTANT = 63  # and 63 of others


@dataclass(frozen=True, slots=True)
class CNumbers(NumberType):
    """A number type of C, with what stands behind a constant."""

    suffix: str

    def text(self, value: float) -> str:
        """Return a number of the type as a constant; for infinite ones see math.h.

        Example:
            >>> DOUBLE.text(0.1), SINGLE.text(-2.0)
            ('0x1.999999999999ap-4', '-0x1p+1f')
        """
        if not math.isfinite(value):
            sign = "-" if value < 0 else ""
            return "NAN" if math.isnan(value) else f"{sign}HUGE_VAL"
        digits, exponent = float(value).hex().split("p")
        if "." in digits:
            digits = digits.rstrip("0").rstrip(".")
        return f"{digits}p{exponent}{self.suffix}"

    def shown(self, value: float) -> str:
        """Return a number with the fewest decimal digits that give it back."""
        return str(self.kind(value))


DOUBLE = CNumbers("double", np.float64, "")
SINGLE = CNumbers("float", np.float32, "f")


USE = """\
 *
 * Compile this file; where its functions are called, include it behind
 * #define NAME_HEADER, which leaves the declarations. With -DNAME_SELFTEST it is a
 * program that compares its answers with the expected ones; it returns 0 if all equal.
 */

"""

DECLARE = "#ifndef NAME_DECLARED\n#define NAME_DECLARED\n\n"

DEFINE = "\n#endif\n\n#ifndef NAME_HEADER\n\n"

_LIMITS = """\
#include <float.h>
#include <stdint.h>

#if FLT_RADIX != 2 || LIMITS
#error "KIND is no IEEE number here"
#endif
"""

_ARITHMETIC = """\
/* Each operation must be rounded once, to KIND. */
#if defined(FLT_EVAL_METHOD)
#if !(EVALUATION)
#error "numbers have other digits here: on x86 compile with -msse2 -mfpmath=sse"
#endif
#elif !defined(__TINYC__) || defined(__i386__)
#error "float.h of C99 must define FLT_EVAL_METHOD"
#endif
#if defined(__FAST_MATH__)
#error "compile without -ffast-math"
#endif
#if defined(_MSC_VER)
#pragma fp_contract(off)
#elif defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__) && defined(FUSES) && !defined(__STRICT_ANSI__)
#if !defined(NAME_NOT_FUSED)
#error "compile with -std=c99, or with -ffp-contract=off -DNAME_NOT_FUSED"
#endif
#endif
"""


def checks(numbers: CNumbers, *, is_arithmetic: bool) -> str:
    """Return what refuses to compile where numbers are not those of IEEE."""
    limits, exact = "DBL_MANT_DIG != 53 || DBL_MAX_EXP != 1024", "FLT_EVAL_METHOD == 0"
    fuses = "__FP_FAST_FMA"
    if numbers is SINGLE:
        limits = "FLT_MANT_DIG != 24 || FLT_MAX_EXP != 128"
        fuses = "__FP_FAST_FMAF"
    else:
        exact += " || FLT_EVAL_METHOD == 1"
    text = _LIMITS.replace("LIMITS", limits)
    if is_arithmetic:
        text += _ARITHMETIC.replace("EVALUATION", exact)
    return text.replace("KIND", numbers.name).replace("FUSES", fuses)


def fill(template: str, prefix: str) -> str:
    """Return a template with a prefix for `name_`, and its capitals for `NAME_`."""
    capital = template.replace("NAME_", f"{prefix.upper()}_")
    return capital.replace("name_", f"{prefix}_")


def prefix_of(name: str) -> str:
    """Return the beginning of all names of a file, made from that of a model.

    Example:
        >>> prefix_of("Größe 2"), prefix_of("2nd")
        ('grosse_2', 'model_2nd')
    """
    small = name.lower()
    if not small[:1].isalpha():
        small = f"model_{small}"
    letters = string.ascii_lowercase
    rest = letters + DIGITS + "_"
    result = NameMap.of([small], first=letters, rest=rest, longest=_LONGEST_PREFIX)
    return result[small].rstrip("_")


def constants(prefix: str, names: Sequence[str]) -> list[str]:
    """Return a constant's name for each name: unlike each other, and 63 letters long.

    Example:
        >>> constants("GRIP_CLASS_", ["soft hand", "Soft-hand", "1st"])
        ['GRIP_CLASS_SOFT_HAND', 'GRIP_CLASS_SOFT_HAND_2', 'GRIP_CLASS_1ST']
    """
    every = LETTERS + DIGITS + "_"
    longest = _LONGEST_CONSTANT - len(prefix)
    result = NameMap.of(names, first=every, longest=longest, ignores_case=True)
    return [prefix + result[name].upper() for name in names]


def remark(text: str) -> str:
    r"""Return text that may stand in a comment: one line of ASCII that cannot end it.

    Example:
        >>> remark("a */ b ??/ é\n")
        'a * / b ? ?/ \\xe9\\n'
    """
    return one_line(text, ("*/", "/*", "??"))


def bits_of(values: Sequence[float], numbers: CNumbers = DOUBLE) -> str:
    """Return the bits of some numbers as constants; all NaN are one."""
    size = np.dtype(numbers.kind).itemsize
    array = np.array(values, numbers.kind)
    if np.isnan(array).any():
        array[np.isnan(array)] = np.nan
    bits = array.view(f"u{size}").tolist()
    words = [f"UINT{8 * size}_C({one:#0{2 * size + 2}x})" for one in bits]
    return f"{{{', '.join(words) or '0'}}}"


def integer_type(largest: int) -> str:
    """Return the smallest type of whole numbers from 0 on.

    Example:
        >>> integer_type(255), integer_type(256)
        ('uint8_t', 'uint16_t')
    """
    return next(f"uint{b}_t" for b in (8, 16, 32) if largest < 1 << b)


def place_type(largest: int) -> str:
    """Return a quick type of whole numbers from 0 on."""
    return f"uint_fast{16 if largest < 1 << 16 else 32}_t"


def whole_table(name: str, values: Sequence[int], about: str) -> Iterator[str]:
    """Yield a table of whole numbers of the smallest type, with a comment before."""
    yield f"/* {about} */\n"
    kind = integer_type(max(values))
    yield f"static const {kind} {name}[{len(values)}] = {{\n"
    yield from whole_lines(values)
    yield "};\n"


def real_table(
    name: str, values: Sequence[float], about: str, numbers: CNumbers
) -> Iterator[str]:
    """Yield a table of numbers, with a comment before."""
    yield f"/* {about} */\n"
    yield f"static const {numbers.name} {name}[{len(values)}] = {{\n"
    yield from real_lines(values, numbers)
    yield "};\n"


def whole_lines(values: Iterable[int]) -> Iterator[str]:
    """Yield lines of whole numbers."""
    yield from _wrapped(f"{value}," for value in values)


def real_lines(values: Iterable[float], numbers: CNumbers) -> Iterator[str]:
    """Yield lines of numbers, each with its decimal digits beside it."""
    yield from _wrapped(f"{numbers.text(v)}, /* {numbers.shown(v)} */" for v in values)


def _wrapped(entries: Iterable[str]) -> Iterator[str]:
    line = "   "
    for entry in entries:
        if len(line) + 1 + len(entry) > _WIDTH and line.strip():
            yield f"{line}\n"
            line = "   "
        line += f" {entry}"
    if line.strip():
        yield f"{line}\n"
