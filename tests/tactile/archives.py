"""Archives of frames that tests read."""

from __future__ import annotations

from fuzzytree.files import PathLike, write_atomically
from fuzzytree.tactile.link.recording import Recording
from fuzzytree.tactile.presses import presses_content


def write_presses(path: PathLike, presses: Recording) -> None:
    """Write an archive of frames."""
    write_atomically(path, presses_content(presses))
