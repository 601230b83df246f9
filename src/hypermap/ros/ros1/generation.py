"""ROS 1 packages of messages, generated in the user's cache from their definitions.

A generated package is laid out as catkin would install it: `python` belongs on PYTHONPATH and
`share` on ROS_PACKAGE_PATH.

Source: the generators of genpy, which catkin runs too, so the md5 sums are the same.
"""

from __future__ import annotations

import atexit
import compileall
import hashlib
import importlib
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from hypermap.core.errors import HypermapError
from hypermap.ros.ros1.definitions import definitions

_LAYOUT = 2  # counts up when what is generated changes for the same definitions
_USED_PACKAGES = ("std_msgs", "geometry_msgs", "sensor_msgs")
_NEXT_TYPE = "\n" + "=" * 80 + "\n"  # separates the types in the full text of a message class


def generate(package: str) -> Path:
    """Generate a package, once for each version of its definitions; return its folder.

    Raises:
        HypermapError: If its definitions are unknown, the generators are missing or the cache
            cannot be written.
    """
    try:
        return _generated(package)
    except OSError as error:
        raise HypermapError(
            f"the ROS 1 messages of {package} cannot be generated: {error}; "
            "XDG_CACHE_HOME may name another folder"
        ) from None


def generate_for_now(package: str) -> Path:
    """Do the same, for this process alone where the cache cannot be written.

    Raises:
        HypermapError: If its definitions are unknown, or the generators are missing.
    """
    try:
        return _generated(package)
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="hypermap-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        _write(package, definitions(package), folder)
        return folder


def _generated(package: str) -> Path:
    texts = definitions(package)
    digest = hashlib.sha256(repr((_LAYOUT, sorted(texts.items()))).encode()).hexdigest()
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    target = caches / "hypermap" / "ros1" / f"{package}-{digest[:16]}"
    if target.is_dir():
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=target.parent))
    try:
        _write(package, texts, work)
        # Who may not write into the cache later would compile at each start, for 0.2 s.
        compileall.compile_dir(work, quiet=2, stripdir=str(work), prependdir=str(target))
        work.rename(target)
    except OSError:
        if not target.is_dir():  # otherwise another node was faster
            raise
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return target


def _write(package: str, texts: Mapping[str, str], folder: Path) -> None:
    try:
        from genpy.generate_initpy import write_modules
        from genpy.generator import MsgGenerator, SrvGenerator
    except ImportError:
        raise HypermapError(
            f"the ROS 1 messages of {package} are neither installed nor can they be generated; "
            "on Debian: apt-get install python3-genpy"
        ) from None
    share, python = folder / "share" / package, folder / "python" / package
    for name, text in texts.items():
        file = share / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, "utf-8")
    (share / "package.xml").write_text(_PACKAGE_XML.format(package=package), "utf-8")
    used = _write_used(folder / "used")
    search = {
        package: [str(share / "msg")],
        **{name: [str(used / name)] for name in _USED_PACKAGES},
    }
    for kind, generator in (("msg", MsgGenerator()), ("srv", SrvGenerator())):
        files = [str(share / name) for name in texts if name.startswith(kind)]
        if not files:
            continue
        (python / kind).mkdir(parents=True)
        if generator.generate_messages(package, files, str(python / kind), search):
            raise HypermapError(f"the ROS 1 messages of {package} could not be generated")
        write_modules(str(python / kind))
    (python / "__init__.py").touch()
    shutil.rmtree(used)


def _write_used(folder: Path) -> Path:
    """Write the definitions that ours use, as the installed message classes contain them."""
    for package in _USED_PACKAGES:
        (folder / package).mkdir(parents=True)
        for name, kind in vars(importlib.import_module(f"{package}.msg")).items():
            if hasattr(kind, "_full_text"):
                text = kind._full_text.partition(_NEXT_TYPE)[0]
                (folder / package / f"{name}.msg").write_text(text, "utf-8")
    return folder


_PACKAGE_XML = """<?xml version="1.0"?>
<package format="2">
  <name>{package}</name>
  <version>0.0.0</version>
  <description>Generated from its definitions.</description>
  <maintainer email="nobody@example.com">Hypermap</maintainer>
  <license>BSD</license>
</package>
"""
