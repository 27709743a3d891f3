"""Stand-ins for libraries that PyPI does not have for every machine."""

from __future__ import annotations

import sys
from types import ModuleType

import pytest


def provide_torchvision(monkeypatch: pytest.MonkeyPatch) -> None:
    """Provide torchvision's version, the only part of it that ART reads (PyPI has no CPU build of torchvision)."""
    try:
        import torchvision  # noqa: F401
    except (ImportError, RuntimeError):
        stand_in = ModuleType("torchvision")
        stand_in.__dict__["__version__"] = "0.28.0"
        monkeypatch.setitem(sys.modules, "torchvision", stand_in)
