"""`python -m fuzzytree.rechecking AUDIT MODEL`: check, print, exit 0, 1 or 2."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from fuzzytree.rechecking import CannotRunError, recheck_files


def main(arguments: Sequence[str]) -> int:
    """Check the files that are named, and print the report."""
    names, solver = [*arguments], ""
    if names[:1] == ["--solver"]:
        names, solver = names[2:], "".join(names[1:2])
    if len(names) not in (2, 3):
        start = "python -m fuzzytree.rechecking [--solver PROGRAM]"
        sys.stderr.write(
            f"usage: {start} AUDIT.json MODEL.yaml\n"
            f"       {start} DIFF.json OLD.yaml NEW.yaml\n"
        )
        return 2
    try:
        report = recheck_files(*names, solver=solver)
    except CannotRunError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write("\n".join(report.lines()) + "\n")
    return report.exit_code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
