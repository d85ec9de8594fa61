"""A membership function and a T-norm are added to a copy of the sources.

Each touches two files. All else follows:
every runtime evaluates both, formats write and read them, or refuse them by name.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CLASS = '''class Cauchy(MembershipFunction, frozen=True, tag="cauchy"):
    """`1 / (1 + ((x - center) / width)^2)`."""

    center: float
    width: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the degree."""
        return 1.0 / (1.0 + square((x - self.center) / self.width))

    def knots(self) -> tuple[float, ...]:
        """Return the center, and where it bends the other way."""
        reach = self.width / math.sqrt(3.0)
        ends = (*around(self.center - reach), *around(self.center + reach))
        return tuple(sorted({self.center, *ends}))


'''
FUNCTION = {
    "fuzzytree/model/curves.py": {
        "SystemCurve = (\n": CLASS,
        "    | Cosine\n": "    | Cauchy\n",
    },
    "fuzzytree/formats/words.py": {
        "    Cosine: Words(": '    curves.Cauchy: Words(fll="Cauchy center width"),\n',
        "    TwoGaussians,\n)\n": "    curves,\n",
    },
}
NORM = {
    "fuzzytree/model/norms.py": {
        '    "nilpotent minimum",\n]': '    "cubic product",\n',
        '    "nilpotent minimum": lambda': '    "cubic product": '
        "lambda n, a, b: n.divide(a * b, 3.0 - (a + b)),\n",
    },
    "fuzzytree/formats/words.py": {
        '    "nilpotent minimum": Words(': '    "cubic product": '
        'Words(fll="CubicProduct", fis="cubic_product", fml="CUBIC"),\n',
    },
}
START = """
import contextlib, io
import numpy as np
import fuzzytree as ft
from fuzzytree.cli import main
from fuzzytree.errors import LossError
from fuzzytree.exporters.table import all_formats
from fuzzytree.model import *
from fuzzytree.model import curves
from fuzzytree.semantics import error_bounds, from_system, infer, system_probes
far = Term("far", Points((2.0, 5.0), (0.0, 1.0)))
small = Term("small", Points((0.0, 1.0, 2.0), (0.0, 1.0, 0.0)))
low = Term("low", Points((0.0, 4.0), (1.0, 0.0)))
near, norm = low, "product"
"""
TRY = """
system = FuzzySystem(
    "toy",
    (Variable("dirt", (near, far), "", 0.0, 9.0),
     Variable("load", (low,), "", 0.0, 9.0)),
    (SystemOutput("y", (small, far), 0.0, 5.0, Defuzzifier("centroid"), "maximum"),),
    (RuleBlock(
        (SystemRule(And((Proposition("dirt", (near.name,)),
                         Proposition("load", ("low",)))),
                    (Conclusion("y", "small"),)),
         SystemRule(Proposition("dirt", ("far",)), (Conclusion("y", "far"),))),
        norm, "maximum", "minimum",
    ),),
)
rows = system_probes(system, limit=50)
for form in all_formats():
    path = f"toy{form.suffixes[0]}"
    try:
        ft.save(system, path, to=form.name, allow_loss=True)
    except LossError as error:
        print(" ".join(str(error).split()))
        continue
    if form.read is None:
        print(form.name, "written")
        continue
    back = ft.load(path)
    has_curve = near.function in [label.function for label in back.variables[0].terms]
    has_norm = back.blocks[0].conjunction == norm
    if has_curve and has_norm and form.name in ("yaml", "fll"):
        answers = [infer(back, row).outputs for row in rows]
        assert answers == [infer(system, row).outputs for row in rows], form.name
    print(form.name, "curve" if has_curve else "points", back.blocks[0].conjunction)
for one in ft.check(system).comparisons:
    print(one.representation, one.verdict)
table = np.array([[row["dirt"], row["load"]] for row in rows]).T
assert (error_bounds(from_system(system), table) < 1e-12).all()
ft.save(system, "toy.yaml")
assert main(["audit", "toy.yaml", "--json", "--output", "audit.json"]) < 2
text = open("audit.json").read()
print("audit names it:", "its curve (cauchy)" in text or "is the cubic product" in text)
with contextlib.redirect_stdout(io.StringIO()):
    code = main(["recheck", "audit.json", "toy.yaml"])
print("rechecked:", code)
"""


def _edited(tmp_path: Path, change: dict[str, dict[str, str]]) -> Path:
    """Return a copy of the sources in which pieces stand before what they precede."""
    copy = tmp_path / "copy"
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("fuzzytree", "exporters", "schemas"):
        shutil.copytree(ROOT / name, copy / name, symlinks=True, ignore=ignored)
    for name, pieces in change.items():
        path = copy / name
        text = path.read_text("utf-8")
        for before, piece in pieces.items():
            assert before in text, before
            text = text.replace(before, piece + before, 1)
        path.write_text(text, "utf-8")
    return copy


def _run(*words: str, folder: Path, path: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(path)}
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment,
        text=True, capture_output=True, check=False,
    )  # fmt: skip


COMMON = """\
onnx written
pmml written
c written
sql written
python written
javascript written
structured-text written
{smt}
native agrees
reference agrees
native agrees
onnxruntime float64 agrees
onnxruntime float64 agrees
python agrees
python agrees
c agrees
c agrees
audit names it: True
"""
AND = (
    "cannot write toy as smt-lib: rule 1: not a minimum, product or maximum: AND is "
    "cubic product and OR is maximum"
)


def _tried(tmp_path: Path, copy: Path, change: str) -> tuple[str, str]:
    done = _run("-c", START + change + TRY, folder=tmp_path, path=copy)
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


@pytest.mark.heavy
def test_a_membership_function_is_added_in_two_files(tmp_path: Path) -> None:
    assert len(FUNCTION) == 2
    copy = _edited(tmp_path, FUNCTION)
    near = 'near = Term("near", curves.Cauchy(2.0, 1.5))'
    result, _ = _tried(tmp_path, copy, near)
    assert (
        result
        == f"""\
yaml curve product
cannot write toy as fcl: output 'y': the dialect portable has no centroid: fuzzylite \
and jFuzzyLogic read no file with curves of outputs alike; pass dialect=fuzzylite, \
jfuzzylogic or iec
fll curve product
fis points product
fml points product
{COMMON.format(smt="smt-lib written")}rechecked: 0
"""
    )


@pytest.mark.heavy
def test_a_t_norm_is_added_in_two_files(tmp_path: Path) -> None:
    assert len(NORM) == 2
    copy = _edited(tmp_path, NORM)
    result, _ = _tried(tmp_path, copy, 'norm = "cubic product"')
    assert (
        result
        == f"""\
yaml curve cubic product
cannot write toy as fcl: output 'y': the dialect portable has no centroid: fuzzylite \
and jFuzzyLogic read no file with curves of outputs alike; pass dialect=fuzzylite, \
jfuzzylogic or iec rule block 1: the dialect portable has no AND 'cubic product'
fll curve cubic product
fis points cubic product
fml curve cubic product
{COMMON.format(smt=AND)}rechecked: 0
"""
    )
