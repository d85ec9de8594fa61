"""The C of a frame, through other people's compilers: every bit, and its size."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from fuzzytree.tactile.exporters.c_frames import write_frames_c
from fuzzytree.tactile.features.names import PAPER
from fuzzytree.tactile.sensor import Sensor
from tests.tactile.frame_models import PLAIN, SMALL, WIDE, learnt_tree, raw_rules

pytestmark = pytest.mark.heavy

MIXED = (
    *("force", "area", "peak", "angle", "log S1", "cell r1 c3"),
    *("block r1 c0 of 2x2", "Re C30 / force"),
)
DEEP = Sensor(16, 16, full=65535, threshold=100)
MODELS = {
    "paper": (PLAIN, PAPER, 0.0),
    "two": (PLAIN, ("S1", "S9"), 0.0),
    "wide": (WIDE, MIXED, 0.0),
    "rules": (SMALL, MIXED, 0.4),
    "parts": (PLAIN, ("cell r3 c5", "block r1 c0 of 2x2"), 0.0),
    "deep": (DEEP, ("S10", "angle"), 0.0),
}
STRICT = (
    *("-Wall", "-Wextra", "-pedantic", "-Werror", "-Wconversion", "-Wshadow"),
    *("-Wundef", "-Wmissing-prototypes", "-Wstrict-prototypes"),
)
COMPILERS = (
    ("gcc", "-O3", *STRICT),
    ("gcc", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover"),
    ("clang", "-O2", *STRICT),
    ("tcc",),
)


def written(case: str) -> bytes:
    sensor, names, reject = MODELS[case]
    tree = learnt_tree(sensor, names, 7)
    model = raw_rules(tree) if reject else tree
    return write_frames_c(model, sensor, name="pad", reject=reject).content


@pytest.mark.parametrize("compiler", COMPILERS, ids=lambda words: " ".join(words[:2]))
@pytest.mark.parametrize("case", MODELS)
def test_every_compiler_gives_every_bit(
    case: str, compiler: tuple[str, ...], program: Callable[[str], str], tmp_path: Path
) -> None:
    source, made = tmp_path / "pad.c", tmp_path / "pad"
    source.write_bytes(written(case))
    words = [program(compiler[0]), *compiler[1:], "-std=c99", "-DPAD_SELFTEST"]
    subprocess.run([*words, "-o", made, source, "-lm"], check=True)
    done = subprocess.run([made], capture_output=True, text=True, check=False)
    right, _, every = done.stdout.split()[:3]
    assert (done.returncode, right) == (0, every), done.stdout
    assert int(every) > 20


@pytest.mark.parametrize(
    ("case", "most"), [("paper", 18_000), ("two", 9_000), ("parts", 1_000)]
)
def test_a_microcontroller_holds_it(
    case: str, most: int, program: Callable[[str], str], tmp_path: Path
) -> None:
    source, made = tmp_path / "pad.c", tmp_path / "pad.o"
    source.write_bytes(written(case))
    gcc, size = program("arm-none-eabi-gcc"), program("arm-none-eabi-size")
    words = [gcc, "-Os", "-mcpu=cortex-m4", "-mthumb", "-std=c99", "-c"]
    subprocess.run([*words, "-o", made, source], check=True)
    stated = subprocess.run([size, made], capture_output=True, text=True, check=True)
    text, data, bss = map(int, stated.stdout.splitlines()[1].split()[:3])
    assert (data, bss) == (0, 0)
    assert text < most
