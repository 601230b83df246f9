"""Maps over time: what changed, and how a map was."""

from hypermap.history.differences import differences
from hypermap.history.expiry import EXPIRES, expiry_of, in_force, next_expiry
from hypermap.history.grown import begin_history, begun, grown, keeps_history, version_of
from hypermap.history.past import (
    as_of,
    at_version,
    check_version,
    is_known_from_the_beginning,
    time_of_version,
)
from hypermap.history.placed import placed
from hypermap.history.policy import POLICY, HistoryPolicy

__all__ = [
    "EXPIRES",
    "POLICY",
    "HistoryPolicy",
    "as_of",
    "at_version",
    "begin_history",
    "begun",
    "check_version",
    "differences",
    "expiry_of",
    "grown",
    "in_force",
    "is_known_from_the_beginning",
    "keeps_history",
    "next_expiry",
    "placed",
    "time_of_version",
    "version_of",
]
