"""The map at the time that a question asks for, and what changed since."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Sequence
from datetime import datetime

from hypermap.core.errors import HypermapError
from hypermap.core.history import Change, History, Revision
from hypermap.core.hypermap import Hypermap
from hypermap.history import as_of, at_version, check_version, is_known_from_the_beginning
from hypermap.questions.departed import departed, when
from hypermap.questions.times import parse_moment


def version_in(text: str) -> int | None:
    """Return the version that a text names; None if it names none.

    >>> version_in("v12"), version_in("monday")
    (12, None)
    """
    found = re.fullmatch(r"v(\d{1,9})", text.strip())
    return None if found is None else int(found[1])


def map_at(hypermap: Hypermap, moment: str | None) -> tuple[Hypermap, float]:
    """Return the map that a question asks, and the time that is now for it, since 1970 [s].

    Args:
        hypermap: the map.
        moment: a time or a version, as a user writes it; None for now.

    Raises:
        HypermapError: If it is not a time, or one that the map does not know.
    """
    if moment is None:
        return hypermap, time.time()
    version = version_in(moment)
    if version is not None:
        return at_version(hypermap, version), -math.inf
    stamp = parse_moment(moment, "--as-of").timestamp()
    return as_of(hypermap, stamp), stamp


def changes_since(
    hypermap: Hypermap, moment: str | None, option: str = "--since"
) -> list[tuple[Revision, Change]]:
    """Return what changed in a map after a time or a version, oldest first.

    Args:
        hypermap: the map.
        moment: as a user writes it; None for all that is known.
        option: what it was given for, in messages.

    Raises:
        HypermapError: If the map keeps no history, or it is not a time.
    """
    if hypermap.history is None:
        raise HypermapError("this map keeps no history; `hypermap history --keep 90d` starts one")
    if moment is not None and (version := version_in(moment)) is not None:
        check_version(hypermap, version)
    later = _later(hypermap.history, moment, option)
    return [(revision, change) for revision in later for change in revision.changes]


def _later(history: History, moment: str | None, option: str) -> list[Revision]:
    """Return the revisions after a time or a version; see `changes_since`."""
    dated = list(history.dated())
    version = None if moment is None else version_in(moment)
    if moment is None:
        return [revision for _, revision in dated]
    if version is not None:
        return [revision for _, revision in dated if revision.version > version]
    begin = parse_moment(moment, option).timestamp()
    if dated and all(revision.time is None for _, revision in dated):
        raise HypermapError(
            f"{option} {moment}: the clocks of the recordings give no dates; "
            "give a version, such as v1"
        )
    return [revision for stamp, revision in dated if stamp >= begin]


def worth_showing(
    found: Sequence[tuple[Revision, Change]],
) -> list[tuple[Revision, Change]]:
    """Return the changes that people are shown: without doubtful ones."""
    return [(revision, change) for revision, change in found if revision.is_worth_showing(change)]


def unknown_since(hypermap: Hypermap, moment: str | None) -> str | None:
    """Return what a map's history does not know of the time since then; None if it knows all.

    Args:
        hypermap: a map with a history.
        moment: as `changes_since` takes it.
    """
    assert hypermap.history is not None
    said = [] if moment is None else _before_the_first(hypermap, moment)
    if hypermap.history.is_end_lost:
        said.append("the newest changes are not known: the end of the history is lost")
    revisions = hypermap.history.revisions()
    told = {revisions[0].version} if revisions else set()  # of the first one, that it is the first
    if moment is not None and (version := version_in(moment)) is not None:
        told.add(version + 1)
    later = _later(hypermap.history, moment, "--since")
    gaps = [one.version for one in later if one.follows_loss and one.version not in told]
    if gaps:
        listed = ", ".join(f"v{one}" for one in gaps)
        said.append(f"changes right before {listed} are not known: they are lost")
    return "; ".join(said) or None


def _before_the_first(hypermap: Hypermap, moment: str) -> list[str]:
    """Return a sentence if a map's history begins after a time or a version; else none."""
    assert hypermap.history is not None
    first_stamp, first = next(iter(hypermap.history.dated()), (0.0, None))
    if first is None or is_known_from_the_beginning(hypermap):
        return []
    version = version_in(moment)
    if version is not None:
        is_known = version >= first.version - 1
    else:
        is_known = parse_moment(moment, "").timestamp() >= first_stamp
    begins = f"the history begins with v{first.version}, {when(first)}"
    return [] if is_known else [f"earlier changes are not known: {begins}"]


def left_the_map(hypermap: Hypermap, name: str) -> str | None:
    """Return when the last object of a name left a map, and how to ask for it.

    None if none did, as far as the map's history knows.
    """
    last = departed(hypermap, name.__eq__)
    if last is None:
        return None
    return last.sentence("" if last.version is None else f" (--as-of v{last.version})")


def iso_of(stamp: float) -> str:
    """Return a time in the form of ISO 8601, in the zone of this computer."""
    try:
        return datetime.fromtimestamp(stamp).astimezone().isoformat(timespec="seconds")
    except (ValueError, OverflowError, OSError):  # beyond the year 9999
        return f"{stamp:.0f} s"
