"""Pages judged by libraries of the extra "test": skips where it is not installed, but fails so where ``CI`` is set."""

import importlib
import os
from pathlib import Path
from types import ModuleType

import pytest


def library(name: str) -> ModuleType:
    """A module of the extra; CI services set ``CI`` and install it, so that nothing is left out there unseen."""
    if os.environ.get("CI"):
        return importlib.import_module(name)
    return pytest.importorskip(name, reason='the extra "test" is not installed: pages are not judged')


def check_html(page: Path) -> None:
    """Raise the first fault of a page by the rules of HTML 5."""
    library("html5lib").HTMLParser(strict=True).parse(page.read_text(encoding="utf-8"))
