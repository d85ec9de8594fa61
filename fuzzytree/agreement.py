"""What a check found, as frozen values."""

from __future__ import annotations

from typing import Literal

import msgspec

from fuzzytree.errors import DisagreementError

Basis = Literal["file", "proof", "all cells", "rows", "calls"]
Verdict = Literal["agrees", "DISAGREES", "differs by design"]


class Comparison(msgspec.Struct, frozen=True):
    """One carrier of a model held against another.

    Attributes:
        carrier: What was examined.
        against: What it was held against.
        basis: `file` compares content, `proof` covers every input, `all cells` every
            cell of the input space with its edges, `rows` the rows counted, `calls`
            ways of calling (no rows, one row, another memory order, a wrong width).
        rows: How many rows, points or calls.
        differing: In how many of them the two differ by more than is allowed.
        largest_difference: Of any two strengths; 0 where none were compared.
        allowed: The largest difference of a strength that the contract allows.
        origin: Where `allowed` comes from.
        flips: Rows in which the class differs.
        largest_flip_margin: The largest distance of the two strongest classes in a
            row that flipped; None without a flip or without strengths.
        verdict: The result.
        detail: What differed, worst first, in sentences.
    """

    carrier: str
    against: str
    basis: Basis
    rows: int
    verdict: Verdict
    differing: int = 0
    largest_difference: float = 0.0
    allowed: float = 0.0
    origin: str = "equal bits"
    flips: int = 0
    largest_flip_margin: float | None = None
    detail: tuple[str, ...] = ()


class Count(msgspec.Struct, frozen=True):
    """How a carrier answered the rows: nothing of this is hidden in a total."""

    carrier: str
    rows: int
    ties: int
    uncovered: int
    missing: int


class Agreement(msgspec.Struct, frozen=True):
    """The result of a check.

    Attributes:
        model: The model's name.
        fingerprint: The SHA-256 of its content.
        comparisons: Everything that was held against something.
        counts: Ties, uncovered and missing rows, for each carrier.
        skipped: What was not examined and why, in sentences.
        cells: The number of cells of the tree, or None for a rule base.
        probes: How many of the rows are probes; the others are data.
    """

    model: str
    fingerprint: str
    comparisons: tuple[Comparison, ...]
    counts: tuple[Count, ...] = ()
    skipped: tuple[str, ...] = ()
    cells: int | None = None
    probes: int = 0

    @property
    def ok(self) -> bool:
        """Whether nothing disagrees."""
        return all(c.verdict != "DISAGREES" for c in self.comparisons)

    def to_json(self) -> str:
        """Return the same facts for programs, as indented JSON."""
        raw = msgspec.json.encode({"ok": self.ok, **msgspec.to_builtins(self)})
        return msgspec.json.format(raw, indent=2).decode()

    def raise_if_not_ok(self) -> None:
        """Raise DisagreementError, naming what disagrees, unless all agrees."""
        wrong = [c for c in self.comparisons if c.verdict == "DISAGREES"]
        if wrong:
            lines = [f"{c.carrier} disagrees with {c.against}" for c in wrong]
            lines += [f"  {text}" for c in wrong for text in c.detail[:1]]
            raise DisagreementError("\n".join(lines))
