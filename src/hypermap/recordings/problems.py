"""Lists all problems of a recording at once, not only the first one."""

from __future__ import annotations

from hypermap.core.errors import HypermapError


def problems_of(recording: object, *needs: str) -> list[str]:
    """Return why attributes of an object are not available, each reason once.

    Args:
        recording: an object whose properties raise a HypermapError if something is missing.
        needs: names of such properties; later ones may depend on earlier ones.

    >>> problems_of("text", "isalpha")
    []
    """
    found = (_problem_of(recording, need) for need in needs)
    return list(dict.fromkeys(problem for problem in found if problem is not None))


def _problem_of(recording: object, need: str) -> str | None:
    try:
        getattr(recording, need)
    except HypermapError as error:
        return str(error)
    return None
