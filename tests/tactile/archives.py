"""Archives of frames that tests read."""

from __future__ import annotations

from fuzzytree.files import PathLike, write_atomically
from fuzzytree.tactile.presses import Presses, presses_content


def write_presses(path: PathLike, presses: Presses) -> None:
    """Write an archive of frames."""
    write_atomically(path, presses_content(presses))
