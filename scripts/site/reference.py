"""The reference of the Python interface: one page for each public module.

A module is public if it says in `__all__` what it offers, or if a document or an example imports
from it. Each name has its place on the first page that offers it; `hypermap` comes first.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import griffe

IMPORT = re.compile(r"^(?:>>> )?from (hypermap[\w.]*) import", re.MULTILINE)
PRIVATE = ("hypermap.ros.", "hypermap.cli")  # reached by commands and nodes, not from Python


def pages(root: Path, folder: str) -> dict[str, str | bytes]:
    """Return the page of each public module, by its place in the site."""
    package = griffe.load("hypermap", search_paths=[root / "src"])
    assert isinstance(package, griffe.Module)
    shown: dict[str, str] = {}  # where each object is defined -> the page that shows it
    made: dict[str, str | bytes] = {}
    for name in public_modules(root, package):
        module = package if name == "hypermap" else package[name.removeprefix("hypermap.")]
        made[f"{folder}{name}.md"] = _page(name, module, shown)
    return made


def public_modules(root: Path, package: griffe.Module) -> list[str]:
    """Return the names of all public modules, the package itself first."""
    named = {name for text in _texts(root) for name in IMPORT.findall(text)}
    for module in _modules(package):
        if module.exports and module.is_init_module:
            named.add(module.path)
    return sorted(name for name in named if not name.startswith(PRIVATE))


def _texts(root: Path) -> Iterator[str]:
    for pattern in ("README.md", "docs/**/*.md", "examples/*.py", "examples/*/src/**/*.py"):
        for path in sorted(root.glob(pattern)):
            yield path.read_text(encoding="utf-8")


def _modules(module: griffe.Module) -> Iterator[griffe.Module]:
    yield module
    for inner in module.modules.values():
        if not inner.is_alias:
            yield from _modules(inner)


def _page(name: str, module: griffe.Module, shown: dict[str, str]) -> str:
    parts = [f"# {name}"]
    if module.docstring:
        parts.append(module.docstring.value)
    elsewhere = []
    for member in _offered(module):
        target = member.final_target if isinstance(member, griffe.Alias) else member
        if target.path in shown:
            page = shown[target.path]
            elsewhere.append(f"[`{member.name}`]({page}.md#{page}.{member.name})")
        else:
            shown[target.path] = name
            parts.append(f"::: {name}.{member.name}")
    if elsewhere:
        parts.insert(2, "Also here: " + ", ".join(elsewhere) + ".")
    return "\n\n".join(parts) + "\n"


def _offered(module: griffe.Module) -> Iterator[griffe.Object | griffe.Alias]:
    """Yield what a module offers: what `__all__` names, else its own public names."""
    names = [str(name) for name in module.exports or ()]
    own = (name for name, member in module.members.items() if not member.is_alias)
    for name in names or own:
        member = module.members[name]
        if name.startswith("_") or member.is_module or (member.is_attribute and not names):
            continue
        yield member
