"""What objects are called: synonyms, plurals, and kinds of objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from hypermap.core.errors import NOT_UTF8, FileMissing, FormatError
from hypermap.simple_yaml import parse_simple_yaml

OURS = Path(__file__).with_name("taxonomy.yaml")

EVERYTHING = "thing"  # the kind of all objects
_LISTS = ("also", "plural", "includes")


@dataclass(frozen=True)
class Taxonomy:
    """Names of objects.

    Attributes:
        kinds: for each usual name, the usual name of its kind, if it has one.
        usual: for each name in the singular, the usual one.
        plurals: for each plural, the usual name.
    """

    kinds: Mapping[str, str | None]
    usual: Mapping[str, str]
    plurals: Mapping[str, str]

    def usual_name(self, name: str) -> str | None:
        """Return the usual name of an object, given in the singular or plural; None if unknown.

        >>> load_taxonomy().usual_name("Couches"), load_taxonomy().usual_name("flubber")
        ('sofa', None)
        """
        key = as_key(name)
        return self.usual.get(key) or self.plurals.get(key)

    def is_a(self, name: str, kind: str) -> bool:
        """Return whether an object is of a kind, or is that; both by their usual names.

        >>> load_taxonomy().is_a("mug", "cup"), load_taxonomy().is_a("cup", "mug")
        (True, False)
        """
        current: str | None = name
        while current is not None:
            if current == kind:
                return True
            current = self.kinds.get(current)
        return False

    def matching(self, asked: str, names: Iterable[str]) -> list[str]:
        """Return the names of objects that a name means: the name itself, and objects of that kind.

        >>> load_taxonomy().matching("seating", ["couch", "cup", "chair"])
        ['couch', 'chair']
        """
        usual = self.usual_name(asked)
        if usual == EVERYTHING:
            return list(names)
        return [name for name in names if as_key(name) == as_key(asked) or self._means(usual, name)]

    def _means(self, usual: str | None, name: str) -> bool:
        own = self.usual_name(name)
        return usual is not None and own is not None and self.is_a(own, usual)

    def related(self, asked: str, names: Iterable[str]) -> list[str]:
        """Return the names of objects that share the nearest kind with a name.

        >>> load_taxonomy().related("mug", ["cup", "chair"]), load_taxonomy().related("tv", ["cup"])
        (['cup'], [])
        """
        kind = self.kinds.get(self.usual_name(asked) or "")
        while kind is not None and kind != EVERYTHING:
            if found := [name for name in names if self._means(kind, name)]:
                return found
            kind = self.kinds.get(kind)
        return []

    @cached_property
    def known(self) -> list[str]:
        """All names in the singular."""
        return sorted(self.usual)


def as_key(name: str) -> str:
    """Return a name as it is compared: in lower case, with single blanks, as "dining table".

    >>> as_key("First-aid_kit")
    'first aid kit'
    """
    return " ".join(name.lower().replace("_", " ").replace("-", " ").split())


def load_taxonomy(path: str | Path | None = None) -> Taxonomy:
    """Return the taxonomy that comes with the program, extended by a user's file.

    Args:
        path: a YAML file like `taxonomy.yaml`: for each name a mapping with `is` (its kind), `also`
            (other names), `plural`, and `includes` (names of objects of that kind). It adds to
            ours, and replaces the entries it repeats.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is not as described; it names the entry.
    """
    if path is None:
        return _ours()
    return _of_entries({**_entries(OURS), **_entries(Path(path))}, path)


@cache
def _ours() -> Taxonomy:
    return _of_entries(_entries(OURS), OURS)


def _entries(path: Path) -> dict[str, dict[str, Any]]:
    try:
        parsed = parse_simple_yaml(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FileMissing(f"{path}: no such file") from None
    except UnicodeDecodeError:
        raise FormatError(NOT_UTF8, path=path) from None
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise FormatError(f"{path}: not a taxonomy: {reason}") from None
    if not isinstance(parsed, dict) or not all(isinstance(name, str) for name in parsed):
        raise FormatError(f"{path}: expected names of things, each with `is`, `also` or `plural`")
    entries = {as_key(name): _entry(path, name, values) for name, values in parsed.items()}
    return entries | _included(path, entries)


def _included(path: Path, entries: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the entries of objects that their kinds include."""
    included: dict[str, dict[str, Any]] = {}
    for kind, entry in entries.items():
        for name in entry["includes"]:
            if name in entries or name in included:
                raise FormatError(f"{path}: {kind}: includes {name!r}, which already exists")
            included[name] = {"is": kind, "also": [], "plural": [], "includes": []}
    return included


def _entry(path: Path, name: str, values: Any) -> dict[str, Any]:
    values = {} if values is None else values
    if not isinstance(values, dict) or set(values) - {"is", *_LISTS}:
        raise FormatError(
            f"{path}: {name}: expected a mapping with `is`, `also`, `plural` and `includes`"
        )
    kind, lists = values.get("is"), {key: values.get(key, []) for key in _LISTS}
    if isinstance(lists["plural"], str):
        lists["plural"] = [lists["plural"]]
    if not (kind is None or isinstance(kind, str)):
        raise FormatError(f"{path}: {name}: `is` is a name")
    for key, names in lists.items():
        if not isinstance(names, list) or not all(isinstance(one, str) for one in names):
            raise FormatError(f"{path}: {name}: `{key}` is a list of names")
    keys = {key: [*map(as_key, names)] for key, names in lists.items()}
    return {"is": None if kind is None else as_key(kind), **keys}


def _of_entries(entries: Mapping[str, Mapping[str, Any]], path: str | Path) -> Taxonomy:
    kinds = {name: entry["is"] for name, entry in entries.items()}
    for name, kind in kinds.items():
        seen = {name}
        while kind is not None:
            if kind not in kinds:
                raise FormatError(f"{path}: {name}: its kind {kind!r} is not in the taxonomy")
            if kind in seen:
                raise FormatError(f"{path}: {name}: is its own kind, through {kind!r}")
            seen.add(kind)
            kind = kinds[kind]
    usual = {other: name for name, entry in entries.items() for other in entry["also"]}
    usual |= {name: name for name in entries}
    plurals = {_plural(one): name for one, name in usual.items()}
    plurals |= {one: name for name, entry in entries.items() for one in entry["plural"]}
    return Taxonomy(kinds, usual, plurals)


def _plural(name: str) -> str:
    """Return the regular plural of a name: buses, batteries, cups."""
    if name.endswith(("s", "x", "ch", "sh")):
        return f"{name}es"
    if name.endswith("y") and name[-2:-1] not in "aeiou":
        return f"{name[:-1]}ies"
    return f"{name}s"
