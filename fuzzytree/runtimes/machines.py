"""What a file of C takes on small machines, as their compilers say."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import msgspec

_CORTEX = "arm-none-eabi-gcc -mthumb -std=c99 -Os"
MACHINES: Final = {
    "Cortex-M4": f"{_CORTEX} -mcpu=cortex-m4 -mfloat-abi=hard -mfpu=fpv4-sp-d16",
    "Cortex-M0": f"{_CORTEX} -mcpu=cortex-m0",
    "ATmega328P": "avr-gcc -mmcu=atmega328p -std=c99 -Os",
}
"""How a file is compiled for each machine."""

_LONGEST_WAIT = 600.0  # seconds


class MachineSize(msgspec.Struct, frozen=True):
    """What a file takes on a machine, in bytes, without the compiler's libraries.

    Attributes:
        machine: A key of `MACHINES`.
        flash: Code and constants.
        ram: Variables that stand beside the stack.
        stack: The frames of all functions together, which is enough for any call.
    """

    machine: str
    flash: int
    ram: int
    stack: int


def machine_sizes(content: bytes) -> Iterator[MachineSize | str]:
    """Yield what a file of C takes on each machine, or why that is not known."""
    for machine, command in MACHINES.items():
        words = command.split()
        if shutil.which(words[0]) is None:
            yield f"{machine}: {words[0]} is not installed"
            continue
        with tempfile.TemporaryDirectory(prefix="fuzzytree-") as place:
            source, target = Path(place, "model.c"), Path(place, "model.o")
            source.write_bytes(content)
            words += ["-fstack-usage", "-c", str(source), "-o", str(target)]
            done = subprocess.run(
                words, capture_output=True, text=True, timeout=_LONGEST_WAIT
            )
            if done.returncode:
                lines = [*re.findall(r"error: (.*)", done.stderr), "it fails"]
                yield f"{machine}: {words[0]} refuses the file: {lines[0][:200]}"
                continue
            tool = words[0].replace("-gcc", "-size")
            sizes = subprocess.run(
                [tool, str(target)], capture_output=True, text=True, check=True
            ).stdout
            text, data, bss = map(int, sizes.splitlines()[1].split()[:3])
            usage = target.with_suffix(".su").read_text("utf-8")
            stack = sum(map(int, re.findall(r"\t(\d+)\t", usage)))
        yield MachineSize(machine, text + data, data + bss, stack)
