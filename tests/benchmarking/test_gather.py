"""A module that the user names adds candidates to a study, or is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fuzzytree.benchmarking.candidates import gather, load_peers
from fuzzytree.testing import random_tree

PEERS = """
from fuzzytree.benchmarking.records import Candidate

def peers(model, bounds):
    return [Candidate("a peer", "tree", "peer", lambda threads: None)], []
"""


@pytest.mark.parametrize("name", ["some_peers.py", "more_peers/__init__.py"])
def test_a_module_or_a_package_adds_candidates(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(PEERS, "utf-8")
    place = path.parent if path.stem == "__init__" else path
    tree = random_tree(1)
    values = np.zeros((len(tree.inputs), 1))
    names = [one.name for one in gather(tree, values, str(place))[0]]
    names.remove("a peer")
    assert names == [one.name for one in gather(tree, values, None)[0]]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("absent", None, "is not a Python module or package"),
        ("text.txt", "", "is not a Python module or package"),
        ("blank_peers.py", "", "has no function 'peers'"),
        ("wrong_peers.py", "1 / 0", "cannot be run: division by zero"),
    ],
)
def test_a_path_without_peers_is_refused(
    tmp_path: Path, name: str, text: str | None, message: str
) -> None:
    path = str(tmp_path / name)
    if text is not None:
        Path(path).write_text(text, "utf-8")
    with pytest.raises(ValueError, match=r"^peers: ") as caught:
        load_peers(path)
    assert str(caught.value) == f"peers: {path!r} {message}"


def test_a_module_whose_name_is_taken_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "json.py"
    path.write_text(PEERS, "utf-8")
    with pytest.raises(ValueError, match=r"^peers: another module 'json' is loaded"):
        load_peers(str(path))
