"""Octave's fuzzy-logic-toolkit as an engine: one start for any number of files."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

DISCRETEMF = """\
function y = discretemf (x, params)
  a = params(1:2:end);
  p = params(2:2:end);
  y = zeros (size (x));
  for k = 1:numel (x)
    j = find (a >= x(k), 1);
    if (isempty (j))
      y(k) = p(end);
    elseif (j == 1 || a(j) == x(k))
      y(k) = p(j);
    elseif (p(j-1) == 0)
      y(k) = (x(k) - a(j-1)) / (a(j) - a(j-1)) * p(j);
    else
      y(k) = p(j) + (x(k) - a(j)) / (a(j-1) - a(j)) * (p(j-1) - p(j));
    endif
  endfor
endfunction
"""
"""`docs/reference/fis.md` shows this function; a test compares the two."""

_SCRIPT = """\
pkg load fuzzy-logic-toolkit
function show (values)
  printf ("%.17g ", values);
  printf ("\\n");
endfunction
"""

_RUN = """\
fis = readfis ("{name}.fis");
show ([numel(fis.rule) numel(fis.input) numel(fis.output)]);
rows = dlmread ("{name}.txt", " ");
for k = 1:rows(1, 1)
  try
    show (evalfis (rows(k + 1, 1:numel (fis.input)), fis));
  catch
    show (NaN (1, numel (fis.output)));
  end_try_catch
endfor
"""


class Answers(msgspec.Struct, frozen=True):
    """What Octave makes of a file: loaded rules, and each row's outputs.

    A row that Octave cannot answer, as none fires or a value is outside its range, is
    NaN.
    """

    rules: int
    inputs: int
    rows: tuple[tuple[float, ...], ...]


def answers(
    program: str,
    folder: Path,
    files: Mapping[str, tuple[bytes, Sequence[Sequence[float]]]],
) -> dict[str, Answers]:
    """Return what Octave answers to the rows of each file, by its name."""
    (folder / "discretemf.m").write_text(DISCRETEMF)
    script = [_SCRIPT]
    for name, (content, rows) in files.items():
        (folder / f"{name}.fis").write_bytes(content)
        lines = [" ".join(map(repr, row)) for row in rows]
        width = max((len(row) for row in rows), default=1)
        head = " ".join([str(len(rows)), *["0"] * (width - 1)])
        (folder / f"{name}.txt").write_text("\n".join([head, *lines]) + "\n")
        script.append(_RUN.format(name=name))
    (folder / "run.m").write_text("\n".join(script))
    done = subprocess.run(
        [program, "--no-gui", "--quiet", "run.m"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    found_lines = done.stdout.splitlines()
    numbers = [[*map(float, line.split())] for line in found_lines if line]
    found: dict[str, Answers] = {}
    place = 0
    for name, (_, rows) in files.items():
        if place >= len(numbers):
            raise AssertionError(f"Octave stopped at {name}: {done.stderr[-2000:]}")
        rules, inputs, _ = numbers[place]
        answered = tuple(map(tuple, numbers[place + 1 : place + 1 + len(rows)]))
        found[name] = Answers(int(rules), int(inputs), answered)
        place += 1 + len(rows)
    return found
