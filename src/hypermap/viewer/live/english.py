"""Questions in English on the page, answered in words and as rows of objects."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from hypermap.console.asked import lines, understood
from hypermap.core.arrays import as_objects
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.questions.answer import Answer
from hypermap.questions.asking import answer_to
from hypermap.viewer.live.object_search import MOST_FOUND, rows_of
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.requests import point_in, text_in
from hypermap.viewer.live.shapes import Polygons, polygons_in_base
from hypermap.viewer.live.snippets import AskedMap, snippets_for_question


def answer_in_words(
    hypermap: Hypermap, asked: AskedMap, values: Mapping[str, Any]
) -> dict[str, Any]:
    """Return what the page shows of a question in English, and the code that asks the same.

    Args:
        hypermap: the map.
        asked: its file and version, for that code.
        values: `question`; `from`, where the asker is, as X,Y in the base frame.

    Raises:
        Refused: If the request is wrong.
        HypermapError: If the question cannot be read or answered.
    """
    # With a parser that takes time to load.
    from hypermap.questions.english import NotUnderstood

    question = text_in(values, "question")
    if question is None:
        raise Refused("question: missing")
    place = point_in(values, "from") if values.get("from") else None
    try:
        answer = answer_to(hypermap, question, None if place is None else Pose2D(*place))
    except NotUnderstood as error:
        others = [f"You can ask: {other}" for other in error.nearest]
        raise Refused("\n".join([str(error), *others])) from None
    found = () if answer.query.asks_rooms else answer.first(MOST_FOUND)
    return {
        "question": question,
        "understood": [list(part) for part in understood(answer.query)],
        "words": _words(hypermap, answer),
        "rows": rows_of(hypermap, found),
        "rooms": _outlines(answer),
        "total": answer.count,
        **snippets_for_question(asked, question, place),
    }


def _outlines(answer: Answer) -> Polygons:
    """Return the polygons of the rooms that are the answer, in the base frame."""
    rooms = {room.id: room.outline for room in answer.rooms if room is not None}
    shapes = polygons_in_base(as_objects([*rooms.values()]), Pose2D(), decimals=None)
    return list(itertools.chain.from_iterable(shapes))


def _words(hypermap: Hypermap, answer: Answer) -> list[str]:
    """Return what is said in words, next to the rows of the objects."""
    said = list(lines(hypermap, answer))
    give = answer.query.give
    in_words = ("count", "room", "last_seen", "places", "value")
    if answer.query.asks_rooms or answer.measured or not answer.exists or give in in_words:
        return said
    return [*(said[:1] if give == "exists" else []), *answer.notes]
