"""How much of the package an audit of a small rule base walks through."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

GOAL = 600
"""The number of functions that such an audit should enter at most."""

MOST = 680
"""What it may enter today: 651 were measured."""

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
    main(["audit", sys.argv[1]])
finally:
    sys.setprofile(None)
    print(len(entered))
"""


def test_an_audit_of_four_rules_enters_few_functions() -> None:
    model = Path(__file__).parents[2] / "examples" / "grip.yaml"
    command = [sys.executable, "-c", COUNT, str(model)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    entered = int(result.stdout.splitlines()[-1])
    assert GOAL // 2 < entered <= MOST
