"""Names that a package offers, imported when they are first used, so that it imports at once."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from typing import Any


def attribute(package: str, name: str, homes: Mapping[str, str]) -> Any:
    """Return what a package offers under a name; for its `__getattr__`.

    Args:
        package: the package's name.
        name: of the attribute that was asked for.
        homes: the module in which each name is defined.

    Raises:
        AttributeError: If the package does not offer the name.
    """
    if name not in homes:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(homes[name]), name)
    setattr(sys.modules[package], name, value)
    return value
