"""How much of the package an audit and a check of small rule bases walk through."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import fuzzytree as ft

GOAL = 600
"""The number of functions that either should enter at most."""

EXAMPLES = Path(__file__).parents[1] / "examples"

COUNT = """
import inspect, sys
from pathlib import Path
import fuzzytree
from fuzzytree.cli import main

folder, entered = str(Path(fuzzytree.__file__).parent), set()

def note(frame, event, argument):
    code = frame.f_code
    is_function = code.co_flags & inspect.CO_NEWLOCALS and code.co_name[0] != "<"
    if event == "call" and is_function and code.co_filename.startswith(folder):
        entered.add(code)

sys.setprofile(note)
try:
    main(sys.argv[1:])
finally:
    sys.setprofile(None)
    print(len(entered))
"""


def functions_entered(verb: str, model: Path) -> int:
    command = [sys.executable, "-c", COUNT, verb, str(model)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    return int(result.stdout.splitlines()[-1])


def test_an_audit_of_four_rules_enters_few_functions() -> None:
    entered = functions_entered("audit", EXAMPLES / "grip.yaml")
    assert GOAL // 2 < entered <= 680  # 651 were measured


def test_a_check_of_the_wine_rules_enters_few_functions(tmp_path: Path) -> None:
    tree = ft.learn(EXAMPLES / "wine" / "wine.csv", target="cultivar")
    ft.save(ft.rules_from_tree(tree), tmp_path / "rules.yaml")
    entered = functions_entered("check", tmp_path / "rules.yaml")
    assert GOAL // 2 < entered <= 640  # 617 were measured
