"""How a table is written: its delimiter, encoding and header, and its numbers."""

from __future__ import annotations

import functools
import re
import shlex
from collections.abc import Sequence

import msgspec

from fuzzytree.cells import number_of

_SEPARATORS = {",": ",", ".": r"\.", "'": "['\u2019]", " ": "[ \u00a0\u2009\u202f]"}
_LEAST_SHARE = 0.9  # of the texts of a column that are no usual numbers


class TableFormat(msgspec.Struct, frozen=True, kw_only=True):
    """How a table is written; the defaults fit most of those that programs write.

    Attributes:
        delimiter: Between the cells of a CSV file; the only one of `,` `;` and tab in
            its first line if empty.
        decimal: What stands before the decimals of a number: `.` or `,`.
        thousands: What groups the digits of a number: nothing, or one of `,` `.` `'`
            and a blank of any kind.
        percent: Whether `104%` is the number 1.04.
        encoding: Of a CSV file; UTF-8, or what its first bytes say, if empty.
        header: Whether the first row has the names of the columns; they are `column 1`,
            `column 2`, ... if not.
        sheet: The sheet of an Excel file; the only one with cells if empty.

    Raises:
        ValueError: If no number is written so.

    Example:
        >>> TableFormat(decimal=",", header=False).words()
        ['--decimal', ',', '--no-header']
    """

    delimiter: str = ""
    decimal: str = "."
    thousands: str = ""
    percent: bool = False
    encoding: str = ""
    header: bool = True
    sheet: str = ""

    def __post_init__(self) -> None:
        """Check the characters of numbers."""
        if self.decimal not in (".", ","):
            raise ValueError(f"decimal {self.decimal!r}: must be '.' or ','")
        known = [one for one in ("", *_SEPARATORS) if one != self.decimal]
        if self.thousands not in known:
            text = " or ".join(map(repr, known[1:]))
            raise ValueError(f"thousands {self.thousands!r}: must be {text}")

    def words(self) -> list[str]:
        """Return the options of the command line that are not as usual."""
        usual, words = TableFormat(), list[str]()
        for name in self.__struct_fields__:
            value = getattr(self, name)
            if value != getattr(usual, name):
                words.append(f"--{name}" if value else f"--no-{name}")
                words += [] if isinstance(value, bool) else [value]
        return words

    @property
    def is_plain(self) -> bool:
        """Whether numbers are written as usual."""
        return self.decimal == "." and not (self.thousands or self.percent)

    @functools.cache  # noqa: B019  # of a value, and there are few
    def pattern(self) -> re.Pattern[str]:
        """Return what a number is."""
        whole, decimals = "[0-9]+", f"{_SEPARATORS[self.decimal]}[0-9]"
        if self.thousands:
            group = f"{_SEPARATORS[self.thousands]}[0-9]{{3}}"
            whole = f"(?:[1-9][0-9]{{0,2}}(?:{group})+|{whole})"
        end = "[eE][+-]?[0-9]+" + ("|[ \u00a0\u202f]?%" if self.percent else "")
        number = f"[+-]?(?:{whole}(?:{decimals}*)?|{decimals}+)(?:{end})?"
        return re.compile(rf"\s*{number}\s*")

    def plain(self, text: str) -> str | None:
        """Return a number as it is usually written, and another text as it is.

        A number with a point, where decimals stand behind a comma, has None.

        Example:
            >>> [*map(TableFormat(decimal=",").plain, ["0,5", "a", "1.065"])]
            ['0.5', 'a', None]
        """
        if self.pattern().fullmatch(text):
            text = re.sub(_SEPARATORS.get(self.thousands, r"\s"), "", text)
            text = re.sub(_SEPARATORS[self.decimal], ".", re.sub(r"\s", "", text))
            return text.replace("%", "e-2")
        return None if "." in text and number_of(text) is not None else text


def number_hint(texts: Sequence[str]) -> str:
    """Return that nearly all texts are numbers, and what reads them; or nothing.

    Example:
        >>> print(number_hint(["0,48", "1,5"]))
        numbers such as '0,48'; pass --decimal ,
        >>> print(number_hint(["1,065"]))
        numbers such as '1,065'; pass --thousands , or --decimal ,
    """
    others = [text for text in texts if number_of(text) is None]
    is_percent = any(text.rstrip().endswith("%") for text in texts)
    forms: dict[TableFormat, list[str]] = {}
    for marks in ("." if is_percent else ".,", ",", ",.", ". ", ", ", ".'", ",'"):
        decimal, thousands = marks[0], marks[1:]
        form = TableFormat(decimal=decimal, thousands=thousands, percent=is_percent)
        forms[form] = [*filter(form.pattern().fullmatch, others)]
    most = max(map(len, forms.values()))
    if most < max(1, _LEAST_SHARE * len(others), 0.1 * len(texts)):
        return ""
    best = [form for form, numbers in forms.items() if len(numbers) == most]
    is_both = best[0].thousands == best[1 % len(best)].decimal == ","
    options = [shlex.join(form.words()) for form in best[: 1 + is_both]]
    return f"numbers such as {forms[best[0]][0]!r}; pass {' or '.join(options)}"
