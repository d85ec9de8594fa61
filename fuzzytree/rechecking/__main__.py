"""`python -m fuzzytree.rechecking AUDIT MODEL`: check, print, exit 0, 1 or 2."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from fuzzytree.rechecking import CannotRunError, recheck_files


def main(arguments: Sequence[str]) -> int:
    """Check the files that are named, and print the report."""
    if len(arguments) not in (2, 3):
        sys.stderr.write(
            "usage: python -m fuzzytree.rechecking AUDIT.json MODEL.yaml\n"
            "       python -m fuzzytree.rechecking DIFF.json OLD.yaml NEW.yaml\n"
        )
        return 2
    try:
        report = recheck_files(*arguments)
    except CannotRunError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write("\n".join(report.lines()) + "\n")
    return 1 if report.wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
