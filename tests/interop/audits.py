"""Audits of third-party rule bases and of the tree learned from the wines.

`python -m tests.interop.audits > docs/reference/audits.md` writes the page.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from fuzzytree import LearningSettings, learn
from fuzzytree.api.verbs import audited_rows
from fuzzytree.auditing.decide.states import Computed, Declined, Proved
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.records import (
    Audit,
    AuditAnswer,
    AuditSelection,
    AuditSettings,
)
from fuzzytree.auditing.findings.subject import Material, view
from fuzzytree.model.contracts import Document
from tests.interop.corpus_fcl import FCL
from tests.interop.corpus_fis import FIS
from tests.interop.corpus_fll import FLL

WINE = Path(__file__).parents[2] / "examples" / "wine" / "wine.csv"
CORPORA = (FCL, FIS, FLL)
LEFT_OUT = ("FT6", "FT7")
"""Codes that need rows or runtimes: docs/reference/corpus.md compares engines."""

SETTINGS = AuditSettings(budget=600.0)

INTRODUCTION = """\
# Audits of real rule bases

`fuzzytree audit` audits two trees learned from the 178 wines, with these rows, and
every FCL, FIS and FLL file that Debian's packages `fuzzylite` and
`octave-fuzzy-logic-toolkit` and the Python package `pyfuzzylite` ship.
`python -m tests.interop.audits > docs/reference/audits.md` writes this page, and
`tests/interop/test_audits.py` compares it with new results. The files are read where
those packages install them.

- *rules*: of the file. *audited*: those with an exact counterpart; see the codes
  `FTD01` and following for the others. Membership functions that are not polynomial are
  enclosed by two linear bounds about 0.001 apart: FTD02 counts them.
- *findings*: the count of each code. `fuzzytree explain CODE` explains it. *declined*:
  the count of each reason, for a rule or a term each.
- The domain of a third-party file is the ranges that it declares. Codes about other
  representations (FT6) and rows (FT7) are left out: [third-party files](corpus.md)
  compares engines.
- Every audit on this page is complete.

"""


class Case(NamedTuple):
    """A rule base and its audit."""

    file: str
    kind: str
    rules: int
    audited: int
    audit: Audit


def wines() -> Iterator[Case]:
    """Yield the audits of trees that are learnt from the wines, with their rows."""
    for name, tree in (
        (
            "plain",
            learn(WINE, target="cultivar", settings=LearningSettings(mode="paper")),
        ),
        ("combined", learn(WINE, target="cultivar")),
    ):
        rows = audited_rows(WINE, tree, target="cultivar")
        found = audit(
            Material(tree, rows=rows),
            settings=SETTINGS,
            selection=AuditSelection(skip=LEFT_OUT[:1]),
        )
        count = len(tree.leaves)
        yield Case(f"wine, {name} features", "tree", count, count, found)


def others() -> Iterator[Case]:
    """Yield the audit of every third-party file."""
    for corpus in CORPORA:
        for name, path in corpus.files():
            model = corpus.read(path.read_bytes(), path.name).model
            yield _case(name, corpus.kind, model)


def _case(name: str, kind: str, model: Document) -> Case:
    found = audit(
        Material(model), settings=SETTINGS, selection=AuditSelection(skip=LEFT_OUT)
    )
    audited = set(view(model, found.domain).numbers)
    count = len(getattr(model, "rules", ()))
    return Case(name, kind, count, len(audited), found)


def reasons(found: Audit) -> Iterator[str]:
    """Yield the code of every answer that was declined."""
    for one in found.answers:
        if isinstance(one.state, Declined):
            yield one.state.code


def table(found: Sequence[Case]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "| file | format | rules | audited | findings | declined |"
    yield "|---|---|---|---|---|---|"
    for case in found:
        codes = [one.code for one in case.audit.findings]
        cells = (
            *(case.file, case.kind, str(case.rules), str(case.audited)),
            *(_counts(codes), _counts([*reasons(case.audit)])),
        )
        yield f"| {' | '.join(cells)} |"


def _counts(codes: Sequence[str]) -> str:
    counts = Counter(codes)
    return ", ".join(f"{code}: {counts[code]}" for code in sorted(counts))


class Verified(NamedTuple):
    """A finding that was checked by hand.

    Attributes:
        file: Where it was found.
        begins: How its sentence begins.
        words: What the text of the file says.
    """

    file: str
    begins: str
    words: str


BY_HAND = (
    Verified(
        "fuzzylite mamdani/AllTerms.fll",
        "term 'H' of 'AllInputTerms' has 2 peaks",
        "The file says `H Discrete 2 0 2.25 1 2.5 0.5 2.75 1 3 0`: the points go up, "
        "halfway down, up again. The engine shows all kinds of terms, so it is meant.",
    ),
    Verified(
        "fuzzylite mamdani/AllTerms.fll",
        "rule 4 and rule 5 conflict: both reach 0.6667",
        "`D` is a triangle that falls from 1 at 1 to 0 at 1.5, `E` a trapezoid that "
        "rises from 1 to 1.25: 2 (1.5 - x) = 4 (x - 1) at x = 7/6, where both are 2/3.",
    ),
    Verified(
        "fuzzylite mamdani/Laundry.fll",
        "rule 3 and rule 4 conflict: both reach 0.5176",
        "One says less detergent than usual, the other more. `low` falls along "
        "0.8 (5 - x) / 3, `high` rises along 0.2 + 0.3 (x - 2): both are 0.5176 at a "
        "dirt of 3.0588, which is 52/17.",
    ),
    Verified(
        "fuzzylite mamdani/SimpleDimmer.fll",
        "no rule has a strength of 0.1 where 'Ambient' is 0.975 to 1",
        "`Ambient` has the range 0 to 1, `DARK` is `Triangle 0 0.25 0.5` and `BRIGHT` "
        "is `Triangle 0.5 0.75 1`, which falls along 4 (1 - x): it is below 0.1 from "
        "0.975 on. At 0 and at 1 themselves every degree is 0, and the answer is the "
        "default, which the file sets to nan.",
    ),
    Verified(
        "fuzzylite hybrid/tipper.fll",
        "rule 2 of block 1 and rule 2 of block 2 have the same antecedent",
        "The file has one rule base twice, for an output of Mamdani's kind and for "
        "one of Sugeno's, so that both can be compared: nothing to mend.",
    ),
    Verified(
        "pyfuzzylite mamdani/matlab/shower.fll",
        "term 'soft' of 'flow' lies outside of the domain for the most part",
        "The range of `flow` is -1 to 1, and `soft` is `Trapezoid -3 -3 -0.8 0` of "
        "area 2.6, of which 0.6 are within the range: most of the term is never used.",
    ),
)


def by_hand(found: Sequence[Case]) -> Iterator[str]:
    """Yield the findings that were checked by hand, with the evidence.

    Raises:
        LookupError: If one of them is not found.
    """
    known = {case.file: case.audit for case in found}
    for one in BY_HAND:
        same = [
            answer
            for answer in known[one.file].findings
            if answer.sentence.startswith(one.begins)
        ]
        if not same:
            raise LookupError(f"{one.file}: no finding begins with {one.begins!r}")
        answer = same[0]
        where = ", ".join(
            f"{span.variable} from {span.low!r} to {span.high!r}"
            for span in answer.region
        )
        yield f"- `{one.file}`, {answer.code} ({_state(answer)}):"
        yield f"  {answer.sentence}{f' ({where})' if where else ''}."
        yield f"  {one.words}"


def _state(answer: AuditAnswer) -> str:
    """Return the state; which proofs are decided again in time is the machine's."""
    if isinstance(answer.state, Proved | Computed):
        return "PROVED or COMPUTED"
    return str(answer.state.__struct_config__.tag)


def of_tree(case: Case) -> Iterator[str]:
    """Yield every finding about a tree, and what its rows say of each rule."""
    for one in case.audit.answers:
        if one.is_finding or (one.code == "FT701" and one.rules):
            yield f"- {one.code} ({_state(one)}): {one.sentence}"


def counts(found: Sequence[Case]) -> Iterator[str]:
    """Yield how many files were audited whole, in part, or not at all."""
    whole = sum(case.audited == case.rules for case in found)
    none = sum(case.audited == 0 for case in found)
    clean = sum(case.audited > 0 and not case.audit.findings for case in found)
    rules, audited = sum(case.rules for case in found), sum(c.audited for c in found)
    yield f"{len(found)} third-party files: {audited} of {rules} rules are audited,"
    yield f"all of them in {whole} files and none in {none}. {clean} files with audited"
    yield "rules have no finding."


def page(ours: Sequence[Case], files: Sequence[Case]) -> str:
    """Return the page."""
    lines = [
        *("## All of them", "", *counts(files), "", *table([*ours, *files]), ""),
        *("## Checked by hand", ""),
        "These findings were compared with the text of the files.",
        *("", *by_hand([*ours, *files]), ""),
        *("## The tree of wines with plain features", ""),
        *of_tree(ours[0]),
    ]
    return INTRODUCTION + "\n".join(lines).rstrip() + "\n"


def main() -> None:
    """Print the page."""
    sys.stdout.write(page([*wines()], [*others()]))


if __name__ == "__main__":
    main()
