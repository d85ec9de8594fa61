"""The fixtures of the command line, for the verbs of the tactile system."""

from __future__ import annotations

from tests.cli.conftest import call, folder, heard, originals

__all__ = ["call", "folder", "heard", "originals"]
