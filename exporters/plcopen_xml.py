"""A function block as PLCopen XML, which tools for controllers import.

It is a project of the schema TC6 2.01 that holds one block and no configuration. Its
interface is XML, its statements are the text of `<ST>`, in a paragraph of XHTML as
Beremiz reads it.
"""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.exporters.st_text import Block, Declaration
from fuzzytree.exporters.xml_text import XmlElement, element, text_element, text_of

_SECTIONS = {
    "VAR_INPUT": "inputVars",
    "VAR_OUTPUT": "outputVars",
    "VAR CONSTANT": "localVars",
    "VAR": "localVars",
}
_CREATED = "1970-01-01T00:00:00"  # the same model gives the same bytes


def plcopen_text(block: Block) -> str:
    """Return a project with a function block, in ASCII."""
    pou = element(
        "pou",
        element("interface", *_interface(block)),
        element("body", element("ST", text_element("xhtml:p", "".join(block.body)))),
        name=block.name,
        pouType="functionBlock",
    )
    scales = [
        element(one, element("scaling", x="1", y="1")) for one in ("fbd", "ld", "sfc")
    ]
    project = element(
        "project",
        element(
            "fileHeader",
            companyName="fuzzytree",
            productName="fuzzytree",
            productVersion="1",
            creationDateTime=_CREATED,
        ),
        element("contentHeader", element("coordinateInfo", *scales), name=block.name),
        element("types", element("dataTypes"), element("pous", pou)),
        element("instances", element("configurations")),
        **{
            "xmlns": "http://www.plcopen.org/xml/tc6_0201",
            "xmlns:xhtml": "http://www.w3.org/1999/xhtml",
        },
    )
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text_of(project)}\n'


def _interface(block: Block) -> Iterator[XmlElement]:
    for section, declarations in block.sections.items():
        if declarations:
            constant = "true" if section.endswith("CONSTANT") else None
            variables = map(_variable, declarations)
            yield element(_SECTIONS[section], *variables, constant=constant)
    yield _documentation("\n".join(block.remarks()))


def _variable(declaration: Declaration) -> XmlElement:
    kind = element(declaration.kind)
    if declaration.bounds is not None:
        lower, upper = map(str, declaration.bounds)
        dimension = element("dimension", lower=lower, upper=upper)
        kind = element("array", dimension, element("baseType", kind))
    parts = [element("type", kind)]
    if declaration.entries:
        values = [
            element("value", element("simpleValue", value=entry))
            for entry in declaration.entries
        ]
        parts.append(element("initialValue", element("arrayValue", *values)))
    if declaration.about:
        parts.append(_documentation("\n".join(declaration.about)))
    return element("variable", *parts, name=declaration.name)


def _documentation(text: str) -> XmlElement:
    return element("documentation", text_element("xhtml:p", text))
