"""YAML as nodes: what words mean, what is refused, and that limits hold."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from fuzzytree.errors import ReadError
from fuzzytree.formats.yaml import nodes
from fuzzytree.formats.yaml.nodes import ListNode, Scalar, compose, meaning
from tests.work import at_most


@pytest.mark.parametrize(
    ("kind", "texts"),
    [
        (
            "text",
            "no yes off on y n NO tRue 12:30 1_000 2026-11-21 0b1 +0o7 0o8 1e .e5 e5 "
            "- + . .. .INf +.nan << = 1.2.3 ١٢ nulL 0x 1e5.0",
        ),
        ("an integer", "0 01 -1 +12 0o17 0xFf 123456789012345678901234567890"),
        ("a number", "1e-05 1. .5 -.5e3 1E5 +1.5e+0 .inf -.INF .NaN .nan 09.5"),
        ("a truth value", "true True TRUE false False FALSE"),
        ("nothing", "null Null NULL ~"),
    ],
)
def test_a_word_means_what_yaml_1_2_says(kind: str, texts: str) -> None:
    for text in texts.split():
        assert meaning(Scalar(text, True, 1, 1)) == kind, text
        assert meaning(Scalar(text, False, 1, 1)) == "text", text


def test_nodes_know_their_line_and_column() -> None:
    root, found = compose(b"- a\n-  - 'b'\n   - c\n", "x.yaml")
    assert root == ListNode(
        (
            Scalar("a", True, 1, 3),
            ListNode((Scalar("b", False, 2, 6), Scalar("c", True, 3, 6)), 2, 4),
        ),
        1,
        1,
    )
    assert found == []


def test_a_byte_order_mark_of_utf_8_is_no_character() -> None:
    assert compose(b"\xef\xbb\xbfa", "x.yaml") == compose(b"a", "x.yaml")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "x.yaml:1:1: the file is empty"),
        (b"# only this\n", "x.yaml:1:1: the file is empty"),
        (
            "a: 1\nb: é\n".encode("utf-16"),
            "x.yaml:1:1: byte 0xff is not UTF-8; the file must be saved as UTF-8",
        ),
        (
            b"a: 1\nb: \x1b[0m\n",
            "x.yaml:2:4: the character U+001B is not allowed here; "
            "the file may be damaged",
        ),
        (b"a: " + b"[" * 33, "x.yaml:1:35: more than 32 levels of nesting"),
        (b"- " * 33 + b"a", "x.yaml:1:65: more than 32 levels of nesting"),
        (b"a\n---\nb\n", "x.yaml:2:1: a second document; a file holds one model"),
    ],
)
def test_what_is_no_single_document_of_text_is_refused(
    content: bytes, message: str
) -> None:
    with pytest.raises(ReadError) as caught:
        compose(content, "x.yaml")
    assert str(caught.value) == message


@pytest.mark.parametrize("mark", ["\x85", "\u2028", "\u2029"])
@pytest.mark.parametrize("text", ["# reviewed{}- if: []", "'a{}b'", "a{}b"])
def test_a_line_end_of_yaml_1_1_alone_is_refused_wherever_it_stands(
    text: str, mark: str
) -> None:
    with pytest.raises(ReadError) as caught:
        compose(f"# é\r\n{text.format(mark)}\n- c".encode(), "x.yaml")
    assert str(caught.value) == (
        f"x.yaml:2:{text.index('{') + 1}: the character U+{ord(mark):04X} ends a line "
        "in YAML 1.1 and not in YAML 1.2; leave it out, or write it as an escape in "
        "double quotes"
    )


def test_an_escaped_line_end_of_yaml_1_1_is_text() -> None:
    root, _ = compose(rb'"a\u2028b\x85\u2029"', "x.yaml")
    assert root == Scalar("a\u2028b\x85\u2029", False, 1, 1)


def test_a_file_beyond_a_limit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nodes, "MOST_BYTES", 10)
    with pytest.raises(ReadError) as caught:
        compose(b"a: bcdefghi", "x.yaml")
    assert str(caught.value) == "x.yaml: 11 bytes are more than the 10 that are read"
    monkeypatch.setattr(nodes, "MOST_NODES", 3)
    with pytest.raises(ReadError) as caught:
        compose(b"[1, 2, 3]", "x.yaml")
    assert str(caught.value) == "x.yaml:1:8: more than 3 entries"


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    "content",
    [
        b"[" * 1_000_000,
        b"- " * 1_000_000,
        b"{a: " * 300_000,
        b"a: &a [*a]\n" * 20_000,
        b"? " * 500_000,
        b"'" + b"a" * 5_000_000,
        b'"' + b"\\x41" * 500_000,
        b"&a " * 200_000,
        b"#" * 5_000_000,
    ],
    ids=lambda content: content[:8].decode(),
)
def test_a_hostile_file_is_refused_after_bounded_work(content: bytes) -> None:
    with at_most(2_000_000):
        try:
            _, mistakes = compose(content, "x.yaml")
        except ReadError:
            mistakes = [(1, 1, "refused")]
    assert mistakes


def test_nodes_are_the_same_without_libyaml(monkeypatch: pytest.MonkeyPatch) -> None:
    folder = Path(__file__).parents[1] / "example-files" / "positive"
    contents = [path.read_bytes() for path in sorted(folder.iterdir())]
    fast = [compose(content, "x.yaml") for content in contents]
    monkeypatch.delattr(yaml, "CSafeLoader")
    assert [compose(content, "x.yaml") for content in contents] == fast
