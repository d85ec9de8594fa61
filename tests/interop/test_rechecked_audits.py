"""Audits of real files hold when they are checked again; with an edit they do not."""

from __future__ import annotations

import json
from collections.abc import Callable

import msgspec
import pytest

from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.locations import model_file
from fuzzytree.auditing.findings.records import AuditSelection, AuditSettings
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.checking.converting import load_content
from fuzzytree.errors import LossError
from fuzzytree.exporters import yaml
from fuzzytree.rechecking import recheck
from fuzzytree.rechecking.checks import digest_of
from tests.interop.audits import CORPORA, LEFT_OUT

Need = Callable[[str], str]

NUMBERS = "the numbers of rules in the file are not those of the system"


@pytest.mark.heavy
def test_audits_of_real_files_hold_and_their_numbers_cannot_be_edited(
    program: Need, library: Need
) -> None:
    program("fuzzylite")
    program("octave")
    library("fuzzylite")
    checked = 0
    # Many are there in three formats and two packages: one of each is enough.
    paths = {
        path.stem: (path, corpus) for corpus in CORPORA for _, path in corpus.files()
    }
    # `audit` decides its proofs again by itself: every third file is enough here.
    for path, corpus in [*paths.values()][::3]:
        try:
            content = yaml.write(corpus.read(path.read_bytes(), path.name).model)
        except LossError:
            continue
        model = load_content(content.content, "m.yaml")
        file = model_file("m.yaml", content.content)
        found = audit(
            Material(model, file=file),
            settings=AuditSettings(budget=3.0),
            selection=AuditSelection(skip=LEFT_OUT),
        )
        text = msgspec.json.encode(found)
        report = recheck(text, content.content, ("a.json", "m.yaml"))
        assert report.wrong == [], path.stem
        checked += 1
        facts = json.loads(text)
        facts["numbers"] = [*facts["numbers"], len(found.answers) + 1000]
        facts["digest"] = digest_of(facts)
        edited = json.dumps(facts).encode()
        wrong = recheck(edited, content.content, ("a.json", "m.yaml")).wrong
        assert wrong == [NUMBERS], path.stem
    assert checked > 16
