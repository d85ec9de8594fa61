"""What a check found, as frozen values."""

from __future__ import annotations

from typing import ClassVar, Literal

import msgspec

from fuzzytree.errors import DisagreementError
from fuzzytree.model.rulebase import Kind
from fuzzytree.model.values import Result

Basis = Literal["file", "proof", "all cells", "rows", "calls"]
Verdict = Literal["agrees", "rows only", "DISAGREES", "differs by design"]
"""`rows only`: the rows agree, and the content is not what this version writes."""


def version() -> str:
    """Return the version of fuzzytree, by which a result is known."""
    import importlib.metadata

    try:
        return importlib.metadata.version("fuzzytree-toolkit")
    except importlib.metadata.PackageNotFoundError:
        return "uninstalled"


class Comparison(msgspec.Struct, frozen=True):
    """One representation of a model compared with another.

    Attributes:
        representation: What was examined.
        against: What it was compared with.
        basis: `file` compares content, `proof` covers every input, `all cells` every
            cell of the input space with its edges, `rows` the rows counted, `calls`
            ways of calling (no rows, one row, another memory order, a wrong width).
        rows: How many rows, points or calls.
        differing: In how many of them the two differ by more than is allowed.
        largest_difference: Of any two strengths in rows that have a bound; 0 where none
            were compared.
        allowed: The largest difference of a strength that the contract allows.
        origin: Where `allowed` comes from.
        flips: Rows in which the class differs.
        largest_flip_margin: The largest distance of the two strongest classes in a
            row that flipped; None without a flip or without strengths.
        verdict: The result.
        detail: What differed, worst first, in sentences.
        row_numbers: Of the rows in `detail`, from 0 in the whole of the rows.
        unbounded: Rows in which the contract bounds no difference of strengths.
        largest_unbounded: The largest difference of any two strengths in them.
    """

    representation: str
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
    row_numbers: tuple[int, ...] = msgspec.field(name="told", default=())
    unbounded: int = 0
    largest_unbounded: float = 0.0


class Certified(msgspec.Struct, frozen=True):
    """What a number type can change about predictions, and what it changed.

    Attributes:
        representation: What was examined.
        dtype: The number type.
        sentence: What is certain about its decisions.
        delta: The certified largest error of a strength; None where there is none.
        origin: What delta is derived from, and for which values it holds.
        on: Which rows are counted below: the user's, or the probes if there are none.
        rows: How many they are.
        largest: The largest error of a strength in them that is certain, against
            exact arithmetic; None for a tree.
        in_band: In how many of them the margin is at most twice the bound, or a value
            of a tree within its rounding from a cut: there nothing is certain.
        flips: In how many of them the class differs from the exact one.
        largest_flip_margin: The largest exact margin of such a row; None without one.
        cover_lost: Rows that a rule covers exactly and none in this type.
        cover_gained: Rows that none covers exactly and one in this type.
        unbounded: Rows in which an error has no bound.
        verdict: Over all rows, the probes too: whether every error is within its
            bound, and every flip within the band.
        detail: What is not, worst first, in sentences.
    """

    representation: str
    dtype: str
    sentence: str
    delta: float | None
    origin: str
    on: Literal["data", "probes"]
    rows: int
    largest: float | None
    in_band: int
    flips: int
    largest_flip_margin: float | None
    cover_lost: int
    cover_gained: int
    unbounded: int
    verdict: Verdict
    detail: tuple[str, ...] = ()


class Count(msgspec.Struct, frozen=True):
    """How a representation answered the rows: nothing of this is hidden in a total."""

    representation: str
    rows: int
    ties: int
    uncovered: int
    missing: int


class Coverage(msgspec.Struct, frozen=True):
    """How far probes reach the rules of a fuzzy system, and rules its ranges.

    Attributes:
        rules: How many rules the system has.
        unfired: The numbers, from 1, of the rules that fire in no probe, though probes
            were aimed at each.
        rows: How many rows were drawn evenly from the ranges of the inputs.
        uncovered: In how many of them an output has no number of its own.
    """

    rules: int
    unfired: tuple[int, ...]
    rows: int
    uncovered: int

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a user should know of it; empty if all rules fire and cover enough."""
        result: list[str] = []
        if self.unfired:
            shown = ", ".join(map(str, self.unfired[:20]))
            more = len(self.unfired) - 20
            shown += f" and {more} more" if more > 0 else ""
            noun = "rule" if len(self.unfired) == 1 else "rules"
            result.append(f"no generated row fires {noun} {shown} of {self.rules}")
        if 2 * self.uncovered > self.rows:
            result.append(
                f"in {self.uncovered} of {self.rows} rows drawn evenly from the ranges "
                "of the inputs an output has no number, and its default answers"
            )
        return tuple(result)


MOST_PROBES, MOST_SYSTEM_PROBES = 20_000, 2_000
"""Of a tree or rules, and of a fuzzy system, whose rows cost more."""


TOLERANCE = 1e-6
"""The largest error of a degree in a file, unless its writer is told another one."""


class FileContent(msgspec.Struct, frozen=True):
    """What a file that was compared holds.

    Attributes:
        file: What the file is called.
        form: `tree`, `relative rules`, `raw rules`, `rules` or `system`.
        dtype: The number type in which it computes.
    """

    file: str
    form: str
    dtype: str


class Unchecked(msgspec.Struct, frozen=True):
    """A file whose answers were not compared, though its content was.

    Attributes:
        file: What the file is called.
        reason: Why.
    """

    file: str
    reason: str

    @property
    def sentence(self) -> str:
        """The same for people."""
        return f"{self.file}: its answers: {self.reason}"


class CheckSettings(msgspec.Struct, frozen=True, kw_only=True):
    """How far a check goes.

    Attributes:
        limit: The most probes; None is 20,000, and 2,000 for a fuzzy system.
        rows_only: Whether files whose rows agree are accepted with other content: a
            graph that this version would not write, or a system with other numbers.
        run_code: Whether a program (C, Python, JavaScript, SQL, PMML) is run even if
            its text is not what this version writes of the model.
        terms: Whether the file of a tree may hold `raw` rules, another function than
            the tree; tree and `relative` rules may always stand in it.
        tolerance: The largest error of a degree where a file has points in the place
            of a curve, as its writer was told.
    """

    limit: int | None = None
    rows_only: bool = False
    run_code: bool = False
    terms: Kind = "relative"
    tolerance: float = TOLERANCE


class Agreement(Result, msgspec.Struct, frozen=True):
    """The result of a check.

    Attributes:
        model: The model's name.
        fingerprint: The SHA-256 of its content.
        comparisons: All comparisons.
        counts: Ties, uncovered and missing rows, for each representation.
        skipped: What was not examined and why, in sentences.
        cells: The number of cells of the tree, or None for a rule base.
        probes: How many of the rows are probes; the others are data.
        certificates: What each number type that was run can change, and did.
        rows_only: Whether the verdict `rows only` is accepted.
        coverage: Of a fuzzy system: which rules probes fire, and what is uncovered.
        files: What each file holds.
        unchecked: The files whose answers were not compared; also in `skipped`.
    """

    FORMAT: ClassVar[str] = "fuzzytree-check/1"

    model: str
    fingerprint: str
    comparisons: tuple[Comparison, ...]
    counts: tuple[Count, ...] = ()
    skipped: tuple[str, ...] = ()
    cells: int | None = None
    probes: int = 0
    certificates: tuple[Certified, ...] = ()
    rows_only: bool = False
    coverage: Coverage | None = None
    files: tuple[FileContent, ...] = ()
    unchecked: tuple[Unchecked, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether nothing disagrees, and content agrees unless rows are enough."""
        return not self.wrong

    @property
    def wrong(self) -> tuple[Comparison | Certified, ...]:
        """What makes `ok` false."""
        bad = ("DISAGREES",) if self.rows_only else ("DISAGREES", "rows only")
        every: list[Comparison | Certified] = [*self.comparisons, *self.certificates]
        return tuple(one for one in every if one.verdict in bad)

    def __repr__(self) -> str:
        """Show how many comparisons there are, and how they end."""
        count = len(self.comparisons)
        verdict = "agrees" if self.ok else "DISAGREES"
        return f"Agreement({count} comparison{'s' * (count != 1)}, {verdict})"

    def to_json(self) -> str:
        """Return the same facts for programs, as indented JSON."""
        return _as_json(self)

    def raise_if_not_ok(self) -> None:
        """Raise DisagreementError, naming what disagrees, unless all agrees."""
        if self.wrong:
            lines = [*map(_fault, self.wrong)]
            lines += [f"  {text}" for one in self.wrong for text in one.detail[:1]]
            raise DisagreementError("\n".join(lines))


def _as_json(result: Agreement | TreeAgreement) -> str:
    """Return a result as indented JSON, with its format and verdict first."""
    head = {"format": result.FORMAT, "version": version(), "ok": result.ok}
    raw = msgspec.json.encode({**head, **msgspec.to_builtins(result)})
    return msgspec.json.format(raw, indent=2).decode()


def _fault(one: Comparison | Certified) -> str:
    if isinstance(one, Certified):
        return f"{one.representation} disagrees with exact arithmetic"
    if one.verdict == "rows only":
        return f"{one.representation} is not {one.against}; its rows agree"
    return f"{one.representation} disagrees with {one.against}"


Question = Literal["routes", "scores", "labels", "missing values", "programs"]
"""What is compared of two tree ensembles."""

TreeVerdict = Literal["PROVED", "DIFFER", "agree", "open", "not asked"]


class TreeAnswer(msgspec.Struct, frozen=True):
    """One question about two tree ensembles, and its answer.

    Attributes:
        question: `routes`: do rows arrive at leaves that belong together? `scores`: are
            the sums of leaves equal but for rounding? `labels`: are the classes equal?
            `missing values`: the same for rows with missing values. `programs`: what
            two programs answered for the rows that were run.
        rows: The number type of the rows.
        verdict: `PROVED` and `DIFFER` are certain for all rows, `DIFFER` by a row that
            both programs ran; `agree` holds for the rows that were run; `open` is not
            decided, and `not asked` is outside of what both accept.
        sentence: The answer in words.
        bound: The largest difference of two scores that rounding allows.
        row: A row that differs.
        answers: What the first and the second say of it.
    """

    question: Question
    rows: Literal["float32", "float64"]
    verdict: TreeVerdict
    sentence: str
    bound: float | None = None
    row: tuple[float | None, ...] | None = None
    answers: tuple[str, ...] = ()


class TreeAgreement(Result, msgspec.Struct, frozen=True):
    """Whether two tree ensembles are the same function; `row` has None for NaN.

    Attributes:
        first, second: What was compared.
        kinds: What each is.
        programs: What ran each.
        leaves: How many each has.
        answers: To all questions, for both number types of rows.
        columns: The names of columns, where they are known.
        remarks: What a program does that its file does not say.
    """

    FORMAT: ClassVar[str] = "fuzzytree-check-trees/1"

    first: str
    second: str
    kinds: tuple[str, str]
    programs: tuple[str, str]
    leaves: tuple[int, int]
    answers: tuple[TreeAnswer, ...]
    columns: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether no answer is that they differ."""
        return not self.wrong

    @property
    def wrong(self) -> tuple[TreeAnswer, ...]:
        """What makes `ok` false."""
        return tuple(each for each in self.answers if each.verdict == "DIFFER")

    def __repr__(self) -> str:
        """Show how many answers there are, and how they end."""
        verdict = "same" if self.ok else "DIFFER"
        return f"TreeAgreement({len(self.answers)} answers, {verdict})"

    def to_json(self) -> str:
        """Return the same facts for programs, as indented JSON."""
        return _as_json(self)

    def raise_if_not_ok(self) -> None:
        """Raise DisagreementError, naming what differs, unless nothing does."""
        if self.wrong:
            lines = [f"{each.question}: {each.sentence}" for each in self.wrong]
            raise DisagreementError("\n".join(lines))
