"""The third-party engines that tests of the tactile system use."""

from __future__ import annotations

from tests.interop.conftest import browser, library, missing, opened, program

__all__ = ["browser", "library", "missing", "opened", "program"]
