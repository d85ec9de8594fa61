"""The page on frames: its commands run, and its Python answers what it says."""

import re
import shlex
from pathlib import Path

import numpy as np
import numpy.typing as npt
import press
import pytest
from commands import run
from tactile_bench import command

from fuzzytree.cli.program import main

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "frames.md"


@pytest.mark.heavy
def test_the_commands_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text("utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    lines += re.findall(r"`(fuzzytree convert [^`]+)`", text)
    assert len(lines) == 10
    for line in lines:
        words = shlex.split(line)[1:]
        if "tactile_bench.py" in line:
            few = ["--rounds", "6", "--quiet"]
            assert run(command, [*words[1:], *few]) == 0, line
        elif "press.py" in line:
            press.main(words[1:])
        else:
            assert main(words) == 0, line
    (code,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    names: dict[str, npt.NDArray[np.generic]] = {}
    exec(code, names)  # our own page
    label, state, rule = (names[name] for name in ("label", "state", "rule"))
    assert state.tolist() == [1, 0]
    assert "# state is [1, 0]" in code
    assert label.tolist()[0] == "" != label.tolist()[1]
    assert rule.tolist()[0] == 0 < rule.tolist()[1]
