"""Classes of ROS 1 messages and services, generated where their package is not built.

Source: the generators of genpy, which catkin runs too, so the md5 sums are the same.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from hypermap.core.errors import HypermapError, MissingExtra
from hypermap.ros.definitions import PACKAGE, package_folder


def message_class(type_name: str) -> type[Any]:
    """Return the class of a message, as of "nav_msgs/OccupancyGrid".

    Raises:
        MissingExtra: If its package is not installed.
    """
    return _class(type_name, "msg")


def service_class(type_name: str) -> type[Any]:
    """Return the class of a service, as of "nav_msgs/GetMap"; raises like `message_class`."""
    return _class(type_name, "srv")


@cache
def _class(type_name: str, kind: str) -> type[Any]:
    package, _, name = type_name.partition("/")
    if package == PACKAGE:
        make_importable()
    try:
        found: type[Any] = getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError):
        raise HypermapError(
            f"the ROS 1 type {type_name} is missing; install its package, on Debian: "
            f"apt-get install python3-{package.replace('_', '-')}"
        ) from None
    return found


@cache
def make_importable() -> Path | None:
    """Make the package `hypermap_msgs` importable; return its generated folder, if it is one.

    A package that catkin has built is used as it is.
    """
    try:
        importlib.import_module(f"{PACKAGE}.msg")
        return None
    except ImportError:
        folder = generate()
        sys.path.append(str(folder))
        importlib.invalidate_caches()
        return folder


def generate() -> Path:
    """Generate the Python package once per version of the definitions; return its parent folder."""
    source = package_folder()
    files = sorted([*source.glob("msg/*.msg"), *source.glob("srv/*.srv")])
    digest = hashlib.sha256(b"".join(f.name.encode() + f.read_bytes() for f in files)).hexdigest()
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    target = caches / "hypermap" / "ros1" / digest[:16]
    if not target.is_dir():
        target.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(dir=target.parent))
        _generate(files, work / PACKAGE, source)
        try:
            work.rename(target)
        except OSError:  # another node was faster
            shutil.rmtree(work)
    return target


def _generate(files: list[Path], package: Path, source: Path) -> None:
    try:
        import genmsg
        import rospkg
        from genpy.generate_initpy import write_modules
        from genpy.generator import MsgGenerator, SrvGenerator
    except ImportError:
        raise MissingExtra("ROS 1", "ros1") from None
    known = rospkg.RosPack()
    search = {
        name: [str(Path(known.get_path(name)) / "msg")] for name in ("std_msgs", "geometry_msgs")
    }
    search[PACKAGE] = [str(source / "msg")]
    for kind, generator in (("msg", MsgGenerator()), ("srv", SrvGenerator())):
        own = [str(file) for file in files if file.suffix == f".{kind}"]
        (package / kind).mkdir(parents=True)
        if generator.generate_messages(PACKAGE, own, str(package / kind), search):
            raise HypermapError(f"the ROS 1 classes of {PACKAGE} could not be generated")
        write_modules(str(package / kind))
    (package / "__init__.py").touch()
