"""Classes of ROS 1 messages and services, generated where their package is not built."""

from __future__ import annotations

import importlib
import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from hypermap.core.errors import HypermapError
from hypermap.ros.definitions import PACKAGE
from hypermap.ros.ros1.definitions import PACKAGES, definitions
from hypermap.ros.ros1.generation import generate, generate_for_now


def message_class(type_name: str) -> type[Any]:
    """Return the class of a message, as of "nav_msgs/OccupancyGrid".

    An installed package is used as it is. What it lacks is generated, if we know its definition.

    Raises:
        HypermapError: If it is neither installed nor known to us.
    """
    return _class(type_name, "msg")


def service_class(type_name: str) -> type[Any]:
    """Return the class of a service, as of "nav_msgs/GetMap"; raises like `message_class`."""
    return _class(type_name, "srv")


def environment() -> dict[str, list[Path]]:
    """Return the folders that show our messages to the tools of ROS 1, by environment variable.

    Empty where the package is installed with all that this version needs.
    """
    folder = generate(PACKAGE)
    installed = [
        Path(module.__file__).parent
        for module in (_module(PACKAGE, kind) for kind in ("msg", "srv"))
        if module is not None and module.__file__ is not None
    ]
    names = {
        file.stem
        for package in installed
        if folder not in package.parents
        for file in package.glob("_*.py")
    }
    if all(f"_{Path(file).stem}" in names for file in definitions(PACKAGE)):
        return {}
    return {"PYTHONPATH": [folder / "python"], "ROS_PACKAGE_PATH": [folder / "share"]}


@cache
def _class(type_name: str, kind: str) -> type[Any]:
    package, _, name = type_name.partition("/")
    found = getattr(_module(package, kind), name, None)
    if found is None and f"{kind}/{name}.{kind}" in _known(package):
        _provide(package)
        found = getattr(_module(package, kind), name, None)
    if found is None:
        raise HypermapError(
            f"the ROS 1 type {type_name} is missing; install its package, on Debian: "
            f"apt-get install python3-{package.replace('_', '-')}"
        )
    kind_found: type[Any] = found
    return kind_found


def _known(package: str) -> dict[str, str]:
    return definitions(package) if package in PACKAGES else {}


def _module(package: str, kind: str) -> ModuleType | None:
    try:
        return importlib.import_module(f"{package}.{kind}")
    except ImportError:
        return None


@cache
def _provide(package: str) -> None:
    """Make a generated package importable, or what an installed one lacks of it."""
    python = generate_for_now(package) / "python"
    try:
        installed = importlib.import_module(package)
    except ImportError:
        sys.path.append(str(python))
        importlib.invalidate_caches()
        return
    installed.__path__.append(str(python / package))
    importlib.invalidate_caches()
    for kind in ("msg", "srv"):
        module = _module(package, kind)
        if module is None or str(python / package / kind) in module.__path__:
            continue
        module.__path__.append(str(python / package / kind))
        for file in sorted((python / package / kind).glob("_[A-Z]*.py")):
            if not hasattr(module, file.stem[1:]):
                _add_classes(module, importlib.import_module(f"{module.__name__}.{file.stem}"))


def _add_classes(package: ModuleType, module: ModuleType) -> None:
    for name, value in vars(module).items():
        if isinstance(value, type) and value.__module__ == module.__name__:
            setattr(package, name, value)
