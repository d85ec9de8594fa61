"""Audits of files with curves between lines and weights hold on a grid."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.auditing.findings.records import AuditSelection
from fuzzytree.auditing.findings.subject import Material, view
from fuzzytree.model import FuzzySystem
from tests.auditing.findings.grids import check_on_grid
from tests.interop.audits import CORPORA, LEFT_OUT

Need = Callable[[str], str]

STEPS = {1: 301, 2: 25, 3: 9, 4: 5}
"""How many values of each input are tried, by the number of inputs."""


@pytest.mark.heavy
def test_what_is_told_of_real_files_holds_on_a_grid(
    program: Need, library: Need
) -> None:
    program("fuzzylite")
    program("octave")
    library("fuzzylite")
    checked = files = 0
    # Many are there in three formats and two packages: one of each is enough.
    paths = {
        path.stem: (path, corpus) for corpus in CORPORA for _, path in corpus.files()
    }
    for path, corpus in paths.values():
        system = corpus.read(path.read_bytes(), path.name).model
        assert isinstance(system, FuzzySystem)
        seen = view(system, domain_of(system))
        ways = {block.activation.method for block in system.blocks}
        is_small = seen.rules is not None and len(system.rules) <= 11
        if not (is_small and seen.inexact) or ways != {"general"}:
            continue
        files += 1
        found = audit(
            Material(system),
            selection=AuditSelection(select=["FT1", "FT2", "FT3"], skip=LEFT_OUT),
        )
        checked += check_on_grid(
            system, found, seen, STEPS.get(len(found.domain.sides), 3)
        )
    assert files > 10
    assert checked > 5 * files
