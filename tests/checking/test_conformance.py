"""Every format keeps its promises, and the suite that says so notices broken ones."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from fuzzytree.errors import DisagreementError, LossError, ReadError
from fuzzytree.exporters.table import TABLE, find_format
from fuzzytree.model.contracts import Document, Format, Loss, Reading, Written
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.testing import check_exporter

ROOT = Path(__file__).resolve().parents[2]
YAML = find_format("yaml")
WRITERS = """
import hashlib
from fuzzytree.errors import LossError
from fuzzytree.exporters import all_formats
from fuzzytree.model import kind_of
from fuzzytree.testing import exporter_models
models = list(exporter_models(rounds=0))
for form in all_formats():
    for title, model in models:
        if kind_of(model) in form.carries:
            try:
                content = form.write(model, allow_loss=True).content
            except LossError as error:
                content = str(error).encode()
            print(form.name, title, hashlib.sha256(content).hexdigest())
"""


SLOW = ("c", "fcl", "fis", "fml", "onnx")
"""Formats that take seconds: a compiler, sessions, many curves of points."""


@pytest.mark.one_in(4)
@pytest.mark.parametrize("name", [name for name in TABLE if name not in SLOW])
def test_every_format_of_the_table_keeps_its_promises(name: str) -> None:
    check_exporter(name, rounds=0)


@pytest.mark.heavy
@pytest.mark.parametrize("name", TABLE)
def test_random_models_change_nothing_about_that(name: str) -> None:
    check_exporter(name, rounds=1 if name in SLOW else 5)


@pytest.mark.heavy
def test_another_process_with_another_hash_seed_writes_the_same_bytes() -> None:
    def lines(seed: str) -> list[str]:
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, "-c", WRITERS],
            env=environment, text=True, capture_output=True, check=True,
        )  # fmt: skip
        return done.stdout.splitlines()

    assert lines("1") == lines("2")


# --- formats with one planted fault each


def _writing(change: Callable[[Document, Written], Written]) -> Format:
    """Return YAML, with something done to whatever is written."""

    def write(model: Document, /, *, allow_loss: bool = False) -> Written:
        return change(model, YAML.write(model, allow_loss=allow_loss))

    return replace(YAML, write=write)


def _reading(change: Callable[[bytes, str], Reading]) -> Format:
    return replace(YAML, read=change)


def _read(content: bytes, name: str) -> Reading:
    assert YAML.read is not None
    return YAML.read(content, name)


def _counting() -> Format:
    counts = iter(range(10**9))

    def change(_: Document, written: Written) -> Written:
        return replace(written, content=written.content + b"# %d\n" % next(counts))

    return _writing(change)


def _losing_in_silence() -> Format:
    def change(model: Document, written: Written) -> Written:
        if not isinstance(model, RuleBase):
            return written
        return YAML.write(replace(model, rules=model.rules[:1]))

    return _writing(change)


def _renaming_in_silence() -> Format:
    def change(model: Document, written: Written) -> Written:
        return YAML.write(replace(model, name="model")) if model.name else written

    return _writing(change)


def _losing_without_asking() -> Format:
    return _writing(lambda _, one: replace(one, losses=(Loss("all", "lost"),)))


def _breaking_its_offer() -> Format:
    def write(model: Document, /, *, allow_loss: bool = False) -> Written:
        raise LossError("no; pass allow_loss=True to write it all the same")

    return replace(YAML, write=write)


def _hiding_losses() -> Format:
    def write(model: Document, /, *, allow_loss: bool = False) -> Written:
        if not allow_loss:
            raise LossError("something is lost; pass allow_loss=True")
        written = YAML.write(model)
        return replace(written, losses=(Loss("rule 7", "is left out"),))

    return replace(YAML, write=write)


def _raising(error: Exception) -> Format:
    def write(model: Document, /, *, allow_loss: bool = False) -> Written:
        raise error

    return replace(YAML, write=write)


def _reading_badly() -> Format:
    def read(content: bytes, name: str) -> Reading:
        if b"\0" in content:
            raise KeyError("nul")
        return _read(content, name)

    return _reading(read)


def _reading_without_a_name() -> Format:
    def read(content: bytes, name: str) -> Reading:
        try:
            return _read(content, name)
        except ReadError as error:
            raise ReadError("cannot be read") from error

    return _reading(read)


def _reading_carriage_returns_as_another() -> Format:
    def read(content: bytes, name: str) -> Reading:
        result = _read(content, name)
        if b"\r\n" in content:
            return replace(result, model=replace(result.model, name="other"))
        return result

    return _reading(read)


def _with_unnamed_option() -> Format:
    def write(
        model: Document, /, *, allow_loss: bool = False, **options: object
    ) -> Written:
        return YAML.write(model, allow_loss=allow_loss)

    return replace(YAML, write=write)


@pytest.mark.one_in(6)
@pytest.mark.parametrize(
    ("broken", "sentence"),
    [
        (_counting(), "tree: writing twice gives different bytes, losses or remarks"),
        (
            _losing_in_silence(),
            "relative rules: read back, rules 'grip' is another model, "
            "and no loss was reported",
        ),
        (
            _renaming_in_silence(),
            "tree: read back, names or notes differ, and no remark was made",
        ),
        (
            _losing_without_asking(),
            "tree: it loses all: lost without being allowed to",
        ),
        (
            _breaking_its_offer(),
            "tree: it offers allow_loss=True and then raises LossError: no; "
            "pass allow_loss=True to write it all the same",
        ),
        (
            _hiding_losses(),
            "tree: its refusal does not list a loss: rule 7: is left out",
        ),
        (_raising(ValueError("no")), "tree: writing raises ValueError in write"),
        (_raising(LossError("")), "tree: it refuses without a reason"),
        (_reading_badly(), "reading NUL bytes raises KeyError in read"),
        (
            _reading_without_a_name(),
            "reading an empty file: the error does not begin with the file's name",
        ),
        (
            _reading_carriage_returns_as_another(),
            "a file with lines that end in CR and LF is read as another model",
        ),
        (
            _with_unnamed_option(),
            "its writer takes any 'options'; options are named one by one",
        ),
        (replace(YAML, name="Yaml!"), "the name 'Yaml!' must be small letters"),
        (replace(YAML, suffixes=("yaml",)), "the suffix 'yaml' must be a dot"),
        (replace(YAML, carries=()), "'carries' must be some of"),
    ],
    ids=lambda one: one[:40] if isinstance(one, str) else "",
)
def test_a_broken_promise_is_a_sentence(broken: Format, sentence: str) -> None:
    with pytest.raises(DisagreementError) as caught:
        check_exporter(broken, rounds=0)
    assert sentence in str(caught.value)
    count = len(str(caught.value).splitlines()) - 1
    assert re.match(rf"\S+ fails in {count} points:\n", str(caught.value))


@pytest.mark.heavy
def test_a_format_that_cannot_carry_something_may_refuse_it() -> None:
    def write(model: Document, /, *, allow_loss: bool = False) -> Written:
        if isinstance(model, RuleBase) and model.semantics.conjunction == "product":
            if not allow_loss:
                raise LossError("AND: becomes min; pass allow_loss=True to write it")
            meant = replace(model.semantics, conjunction="minimum")
            written = YAML.write(replace(model, semantics=meant))
            return replace(written, losses=(Loss("AND", "becomes min"),))
        return YAML.write(model, allow_loss=allow_loss)

    check_exporter(replace(YAML, write=write), rounds=1)


def test_a_format_that_is_not_there_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="no format 'turtle'"):
        check_exporter("turtle")
