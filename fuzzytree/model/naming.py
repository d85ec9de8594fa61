"""Names that a target accepts, and the way back to the names of the model.

A name that is accepted as it is stays. Any other is made of the same letters as far as
they are accepted, and is unlike all others. What happens to a character: accents are
taken off (`é` is `e`), ligatures and letters of Greek and Cyrillic become their Latin
names (`ß` is `ss`, `λ` is `lamda`), other letters and symbols their number (`度` is
`u5ea6`); blanks and ASCII signs become the filler.
"""

from __future__ import annotations

import json
import string
import unicodedata
from collections.abc import Collection, Iterable, Iterator, Mapping

import msgspec

LETTERS = string.ascii_letters
DIGITS = string.digits

_MOST_SHOWN = 12  # names in a remark, unless more inputs were changed

_SPELT = {
    "ß": "ss",
    "æ": "ae",
    "œ": "oe",
    "ø": "o",
    "đ": "d",
    "ð": "d",
    "ł": "l",
    "þ": "th",
    "\u0131": "i",
}


def as_names(names: str | Iterable[str]) -> tuple[str, ...]:
    """Return names as a tuple; a text is one name, and no sequence of letters.

    Example:
        >>> as_names("slip"), as_names(["force", "slip"])
        (('slip',), ('force', 'slip'))
    """
    return (names,) if isinstance(names, str) else tuple(names)


def counted(count: int, noun: str, nouns: str | None = None) -> str:
    """Return a count with its noun.

    Example:
        >>> counted(1, "rule"), counted(2, "box", "boxes")
        ('1 rule', '2 boxes')
    """
    return f"{count} {noun if count == 1 else nouns or noun + 's'}"


def number_text(number: float) -> str:
    """Return a value of an input in six digits, as sentences show it."""
    return f"{number:.6g}"


def printable(text: str) -> str:
    r"""Return a text for a terminal; what that might obey is written as an escape.

    Example:
        >>> print(printable("a" + chr(27) + "[2J"))
        a\x1b[2J
    """
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in text
    )


def printable_lines(text: str) -> str:
    """Return lines for a terminal; each is made printable, and keeps its end."""
    return "\n".join(map(printable, text.split("\n")))


def printable_json(text: str) -> str:
    r"""Return JSON that says the same, with an escape where a terminal might obey.

    Example:
        >>> print(printable_json('["' + chr(0x9B) + '2J"]'))
        ["\u009b2J"]
    """
    if text.replace("\n", " ").isprintable():
        return text
    return "".join(
        c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text
    )


class NameMap(msgspec.Struct, frozen=True):
    """A map from the names of a model to names of a target, each to its own.

    Attributes:
        accepted: The target's name for each of the model's, in their order.
    """

    accepted: dict[str, str]

    @staticmethod
    def of(
        names: Iterable[str],
        *,
        first: str = LETTERS + "_",
        rest: str = LETTERS + DIGITS + "_",
        filler: str = "_",
        reserved: Iterable[str] = (),
        longest: int | None = None,
        taken: Iterable[str] = (),
        ignores_case: bool = False,
    ) -> NameMap:
        """Return a map for some names; a name that stands twice has one entry.

        Names that are accepted as they are keep themselves, wherever they stand; of
        those that would become alike the first gets the plain name, the others a
        number, as in `petal_length_2`.

        Args:
            names: The model's names.
            first: The characters with which a name may start.
            rest: The characters of which the rest may be; with all digits.
            filler: What stands for other characters, among `rest`; may be empty.
            reserved: Words that are no names, in upper or lower case.
            longest: The largest number of characters of a name; 8 at least.
            taken: Names that others have already.
            ignores_case: Whether names that differ only in case count as alike.

        Example:
            >>> names = NameMap.of(["fore arm", "fore-arm", "if"], reserved=["IF"])
            >>> list(names.accepted.values())
            ['fore_arm', 'fore_arm_2', 'if_']
            >>> list(NameMap.of(["Größe (µm)", "β"]).accepted.values())
            ['Grosse_mum', 'beta']
        """
        allowed = _Allowed(first, rest, filler, longest or 0, ignores_case)
        words = {word.casefold() for word in reserved}
        used = {allowed.key(name) for name in taken}
        originals = list(dict.fromkeys(names))
        result: dict[str, str] = {}
        for name in originals:
            if allowed.takes(name) and name.casefold() not in words:
                key = allowed.key(name)
                if key not in used:
                    used.add(key)
                    result[name] = name
        counts: dict[str, int] = {}
        for name in originals:
            if name in result:
                continue
            plain = allowed.adapted(name)
            if plain.casefold() in words and not allowed.is_too_long(plain + filler):
                plain += filler
            unique, count = plain, counts.get(plain, 1)
            while allowed.key(unique) in used or unique.casefold() in words:
                count += 1
                end = f"{filler}{count}"
                room = longest - len(end) if longest else len(plain)
                unique = plain[:room] + end
            counts[plain] = count
            result[name] = unique
            used.add(allowed.key(unique))
        return NameMap({name: result[name] for name in originals})

    def __getitem__(self, name: str) -> str:
        """Return the target's name for one of the model's."""
        return self.accepted[name]

    @property
    def changed(self) -> dict[str, str]:
        """The names that are not what they were, in order."""
        return {name: one for name, one in self.accepted.items() if name != one}


def unlike(name: str, taken: Collection[str]) -> str:
    """Return a name as it is, or with the first number that makes it unlike others.

    Example:
        >>> unlike("class", ["class", "class 2"])
        'class 3'
    """
    result, count = name, 1
    while result in taken:
        count += 1
        result = f"{name} {count}"
    return result


def numbered(name: str, taken: dict[str, int]) -> str:
    """Return a name like `unlike`, and remember it: quick for any number of names.

    `taken` has the names so far, each with how often it was used.

    Example:
        >>> taken = {}
        >>> [numbered("low", taken) for _ in range(3)]
        ['low', 'low 2', 'low 3']
    """
    result, count = name, taken.get(name, 0)
    while result in taken:
        count += 1
        result = f"{name} {count}"
    taken[name] = max(count, 1)
    taken.setdefault(result, 1)
    return result


def changes_text(changed: Mapping[str, str], inputs: Iterable[str]) -> str:
    """Return the names that are others in a file, in words; empty if there are none.

    All inputs are shown, as the caller of the file uses them; with the other names at
    most a dozen.

    Example:
        >>> changes_text({"tip %": "tip"}, [])
        "names were changed: 'tip %' is tip"
    """
    if not changed:
        return ""
    first = [name for name in inputs if name in changed]
    names = list(dict.fromkeys([*first, *changed]))
    shown = names[: max(len(first), _MOST_SHOWN)]
    pairs = ", ".join(f"{name!r} is {changed[name]}" for name in shown)
    more = f", and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
    return f"names were changed: {pairs}{more}"


class _Allowed(msgspec.Struct, frozen=True):
    """What a name may be."""

    first: str
    rest: str
    filler: str
    longest: int
    ignores_case: bool

    def key(self, name: str) -> str:
        """Return what makes two names alike."""
        return name.casefold() if self.ignores_case else name

    def takes(self, name: str) -> bool:
        """Return whether a name is accepted as it is."""
        return (
            bool(name)
            and name[0] in self.first
            and all(character in self.rest for character in name)
            and not self.is_too_long(name)
        )

    def is_too_long(self, name: str) -> bool:
        return bool(self.longest) and len(name) > self.longest

    def adapted(self, name: str) -> str:
        """Return an accepted name that reads like another."""
        text = "".join(self._kept(name))
        if self.filler:
            parts = [part for part in text.split(self.filler) if part]
            text = self.filler.join(parts)
        if not text or text[0] not in self.first:
            start = "x" if "x" in self.first else self.first[0]
            text = start + (self.filler if text else "") + text
        return text[: self.longest] if self.longest else text

    def _kept(self, name: str) -> Iterator[str]:
        for character in name:
            if character in self.rest:
                yield character
                continue
            for one in _plain(character):
                yield one if one in self.rest else self.filler


def _plain(character: str) -> str:
    """Return ASCII in the place of a character."""
    if character.isascii():
        return character
    lower = character.lower()
    if lower in _SPELT:
        spelt = _SPELT[lower]
        return spelt if character == lower else spelt.capitalize()
    result: list[str] = []
    for one in unicodedata.normalize("NFKD", character):
        if one.isascii():
            result.append(one)
        elif not unicodedata.combining(one):
            result.append(_letter_name(one))
    return "".join(result) or f"u{ord(character):04x}"


def _letter_name(character: str) -> str:
    words = unicodedata.name(character, "").split()
    if len(words) == 4 and words[0] in ("GREEK", "CYRILLIC") and words[2] == "LETTER":
        name = words[3].lower()
        return name.capitalize() if words[1] == "CAPITAL" else name
    return f"u{ord(character):04x}"
