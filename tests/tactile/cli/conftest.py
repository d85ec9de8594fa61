"""The fixtures of the command line, for the verbs of the tactile system."""

from __future__ import annotations

from tests.cli.conftest import call, folder, heard

__all__ = ["call", "folder", "heard"]
