"""Pieces of Structured Text: names, numbers, comments, declarations, a block."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fuzzytree.exporters.program_text import NumberType, one_line
from fuzzytree.model import NameMap

_WIDTH = 88
_LONGEST_NAME = 30

_WORDS = """
ABS ABSTRACT ACOS ACTION ADD AND AND_THEN ANY ARRAY ASIN AT ATAN ATAN2 BOOL BY
BYTE CASE CHAR CLASS CONCAT CONFIGURATION CONSTANT CONTINUE COS CTD CTU CTUD DATE
DATE_AND_TIME DELETE DINT DIV DO DT DWORD ELSE ELSIF END_ACTION END_CASE
END_CLASS END_CONFIGURATION END_FOR END_FUNCTION END_FUNCTION_BLOCK END_IF
END_INTERFACE END_METHOD END_NAMESPACE END_PROGRAM END_PROPERTY END_REPEAT
END_RESOURCE END_STEP END_STRUCT END_TRANSITION END_TYPE END_UNION END_VAR
END_WHILE EN ENO EQ EXIT EXP EXPT EXTENDS F_EDGE F_TRIG FALSE FINAL FIND FOR FROM
FUNCTION FUNCTION_BLOCK GE GOTO GT IF IMPLEMENTS INI INITIAL_STEP INSERT INT
INTERFACE INTERNAL INTERVAL JMP LABEL LDATE LDT LE LEFT LEN LIMIT LINT LN LOG
LREAL LT LTIME LTOD LWORD MAX METHOD MID MIN MOD MOVE MUL MUX NAMESPACE NE NIL
NON_RETAIN NOT NULL OF ON OR OR_ELSE OVERLAP OVERRIDE PERSISTENT POINTER PRIORITY
PRIVATE PROGRAM PROPERTY PROTECTED PUBLIC R_EDGE R_TRIG READ_ONLY READ_WRITE REAL
REF REF_TO REFERENCE REPEAT REPLACE RESOURCE RET RETAIN RETURN RIGHT ROL ROR RS
SEL SEMA SHL SHR SIN SINGLE SINT SIZEOF SQRT SR STEP STRING STRUCT SUB SUPER TAN
TASK THEN THIS TIME TIME_OF_DAY TO TOD TOF TON TP TRANSITION TRUE TRUNC TYPE
UDINT UINT ULINT UNION UNTIL USES USING USINT VAR VAR_ACCESS VAR_CONFIG
VAR_EXTERNAL VAR_GLOBAL VAR_IN_OUT VAR_INPUT VAR_OUTPUT VAR_STAT VAR_TEMP WCHAR
WHILE WITH WORD WSTRING XOR A B C D I L M N P Q R S V W X Y Z
"""

RESERVED = tuple(_WORDS.split())
"""Words of the standard, and of some dialects, that are no names; single letters are
instructions and addresses in old ones."""


class StNumbers(NumberType):
    """A number type of Structured Text."""

    __slots__ = ()

    def nearest(self, value: float) -> float:
        """Return the nearest number of the type: finite, and 0 only for 0."""
        clamped = max(-self.largest, min(value, self.largest))
        (result,) = self.rounded([clamped], is_divisor=value != 0.0)
        return result

    def at_most(self, value: float) -> float:
        """Return the largest finite number of the type up to a value.

        Example:
            >>> SINGLE.at_most(0.1) <= 0.1 < SINGLE.at_most(0.1) * 1.0000002
            True
        """
        result = self.kind(self.nearest(value))
        if float(result) > value and float(result) > -self.largest:
            result = np.nextafter(result, self.kind(-np.inf))
        return float(result)

    def digits(self, value: float) -> str:
        """Return a number of the type with the fewest digits that give it back.

        Example:
            >>> LONG.digits(1e-05), LONG.digits(-0.0), SINGLE.digits(float(0.1))
            ('1.0E-5', '-0.0', '0.1')
        """
        mantissa, _, exponent = str(self.kind(value)).partition("e")
        if "." not in mantissa:
            mantissa += ".0"
        return f"{mantissa}E{int(exponent)}" if exponent else mantissa

    def literal(self, value: float) -> str:
        """Return a number for an expression, with its type.

        Example:
            >>> LONG.literal(0.5), LONG.literal(-2.0)
            ('LREAL#0.5', '(-LREAL#2.0)')
        """
        text = self.digits(value)
        if text.startswith("-"):
            return f"(-{self.name}#{text[1:]})"
        return f"{self.name}#{text}"


LONG = StNumbers("LREAL", np.float64)
SINGLE = StNumbers("REAL", np.float32)


def identifiers(names: Iterable[str], taken: Iterable[str] = ()) -> NameMap:
    """Return names that the standard takes: ASCII, unlike in any case, no keywords.

    Example:
        >>> names = identifiers(["grip force", "IF", "v1", "x__y"], ["V1"])
        >>> list(names.accepted.values())
        ['grip_force', 'IF_2', 'v1_2', 'x_y']
    """
    given = list(names)
    odd = [
        name for name in given if "__" in name or name[:1] == "_" or name[-1:] == "_"
    ]
    return NameMap.of(
        given,
        first="abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ",
        longest=_LONGEST_NAME,
        taken=[*RESERVED, *taken, *odd],
        ignores_case=True,
    )


def remark(text: str) -> str:
    r"""Return text that may stand in a comment: one line of ASCII that cannot end it.

    Example:
        >>> print(remark("a *) (* é\n"))
        a * ) ( * \xe9\n
    """
    return one_line(text, ("(*", "*)", "/*", "*/"))


class Declaration(NamedTuple):
    """A variable that a block declares.

    Attributes:
        name: Its name.
        kind: Its type; of an array, that of an element.
        about: Remarks: the first one stands beside it, others below.
        bounds: The first and the last place of an array; None of a single value.
        entries: The initial values of an array, if it has some.
    """

    name: str
    kind: str
    about: tuple[str, ...] = ()
    bounds: tuple[int, int] | None = None
    entries: tuple[str, ...] = ()

    @property
    def type(self) -> str:
        """Its whole type."""
        if self.bounds is None:
            return self.kind
        return f"ARRAY [{self.bounds[0]}..{self.bounds[1]}] OF {self.kind}"

    def lines(self) -> Iterator[str]:
        """Yield its text."""
        comments = [f" (* {text} *)" for text in self.about] or [""]
        if not self.entries:
            yield f"    {self.name} : {self.type};{comments[0]}\n"
            yield from (f"       {comment}\n" for comment in comments[1:])
            return
        yield f"    {self.name} : {self.type} := [{comments[0]}\n"
        line = "       "
        for number, entry in enumerate(self.entries, 1):
            piece = f" {entry}{',' if number < len(self.entries) else ''}"
            if len(line) + len(piece) > _WIDTH:
                yield f"{line}\n"
                line = "       "
            line += piece
        yield f"{line}\n    ];\n"


def table(name: str, kind: str, entries: Sequence[str], about: str) -> Declaration:
    """Return the declaration of a table, from place 0, with a comment."""
    return Declaration(name, kind, (about,), (0, len(entries) - 1), tuple(entries))


class Block(NamedTuple):
    """A function block.

    Attributes:
        name: Its name.
        source: Remarks that say what it was written of.
        sections: Its declarations, by the words that open them: `VAR_INPUT`.
        body: The lines of its statements.
    """

    name: str
    source: tuple[str, ...]
    sections: Mapping[str, Sequence[Declaration]]
    body: Sequence[str]

    def remarks(self) -> Iterator[str]:
        """Yield what it was written of, and its interface."""
        yield from self.source
        for section, word in (("VAR_INPUT", "Input"), ("VAR_OUTPUT", "Output")):
            for one in self.sections[section]:
                yield f"{word} {one.name} ({one.type}): {'; '.join(one.about)}"
        yield "Nothing is kept from one call to the next."

    def text(self) -> str:
        """Return its text."""
        lines = [f"(* {text} *)\n" for text in self.remarks()]
        lines.append(f"FUNCTION_BLOCK {self.name}\n")
        for opening, declarations in self.sections.items():
            if declarations:
                lines.append(f"{opening}\n")
                for one in declarations:
                    lines += one.lines()
                lines.append("END_VAR\n")
        return "".join([*lines, "\n", *self.body, "END_FUNCTION_BLOCK\n"])


def known_inputs(names: Sequence[str], numbers: StNumbers) -> Iterator[str]:
    """Yield statements that say in `is_known` whether all inputs are finite."""
    largest = numbers.literal(numbers.largest)
    yield "is_known := TRUE;\n"
    for name in names:  # only a number that is NaN is not equal to itself
        yield f"IF NOT ({name} = {name}) THEN is_known := FALSE; END_IF;\n"
    if names:
        yield "IF is_known THEN\n"
        for name in names:
            test = f"ABS({name}) > {largest}"
            yield f"    IF {test} THEN is_known := FALSE; END_IF;\n"
        yield "END_IF;\n"
