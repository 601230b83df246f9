"""Collects the messages of planned frames while a bag streams by."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from hypermap.core.errors import FormatError
from hypermap.recordings.bag.contents import stamp_of
from hypermap.recordings.bag.file import BagFile

MAX_WAITING = 300  # frames waiting for another message, or for an earlier frame


def stream_frames(
    bag: BagFile, topics: Sequence[str], wanted: Sequence[Sequence[int]]
) -> Iterator[list[Any]]:
    """Yield the messages of each wanted frame, in the order of `wanted`.

    A message is kept only until its frame is complete and next.

    Args:
        bag: contains the messages.
        topics: the topics from which a frame takes one message each.
        wanted: for each frame the stamps [ns] of its messages, one for each topic. Damaged messages
            have none: they were left out before.

    Raises:
        FormatError: If the bag is damaged, or messages of a frame are too far apart in it.
    """
    frame_of = [{stamps[k]: i for i, stamps in enumerate(wanted)} for k in range(len(topics))]
    waiting: dict[int, dict[int, Any]] = {}
    turn = 0
    for name, log_time, message in bag.messages(topics, _ignore):
        k = topics.index(name)
        frame = frame_of[k].pop(stamp_of(message, log_time), None)  # a stamp counts only once
        if frame is None:
            continue
        waiting.setdefault(frame, {})[k] = message
        while len(waiting.get(turn, ())) == len(topics):
            parts = waiting.pop(turn)
            yield [parts[k] for k in range(len(topics))]
            turn += 1
        if len(waiting) > MAX_WAITING:
            raise FormatError(
                f"the messages of {' and '.join(topics)} that belong together are more than "
                f"{MAX_WAITING} frames apart; sort the bag by the messages' stamps",
                path=bag.path,
            )


def _ignore(_log_time: int, _error: FormatError) -> None:
    pass
