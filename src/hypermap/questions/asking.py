"""From the text of a question to its answer, for command line and shell."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hypermap.core.arguments import check_kind
from hypermap.core.embeddings import TextEncoder
from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.questions.answer import Answer, ask
from hypermap.questions.departed import names_before
from hypermap.questions.query import Query
from hypermap.questions.taxonomy import Taxonomy, load_taxonomy
from hypermap.questions.times import without_as_of
from hypermap.questions.value_questions import value_query
from hypermap.rooms.kinds import load_kinds
from hypermap.rooms.rooms import rooms_on

if TYPE_CHECKING:
    from hypermap.questions.model import LanguageModel
    from hypermap.questions.vocabulary import Vocabulary

_LOOKS_LIKE = re.compile(
    r"\s*(?:(?:what|which (?:things|objects)) looks? )?like:?\s+(\S.*)", re.IGNORECASE | re.DOTALL
)


def answer_to(
    hypermap: Hypermap,
    question: str,
    asker: Pose2D | None = None,
    taxonomy: str | Path | None = None,
    robot_radius: float = 0.0,
    model: LanguageModel | None = None,
    encoder: TextEncoder | None = None,
) -> Answer:
    """Return the answer to a question in English, or to a query as JSON, which begins with "{".

    Args:
        hypermap: the map.
        question: the text.
        asker: where the asker is, in the base frame.
        taxonomy: a file of more names of objects.
        robot_radius: of the robot that distances by path are for [m].
        model: reads what the grammar cannot; None for none.
        encoder: as `ask` takes it.

    Raises:
        NotUnderstood: If the question cannot be read, and there is no model.
        HypermapError: If it cannot be answered.
    """
    names = load_taxonomy(taxonomy)
    notes: tuple[str, ...] = ()
    looks = _LOOKS_LIKE.fullmatch(question)
    if question.lstrip().startswith("{"):
        query = Query.from_json(_parsed(question))
    elif looks is not None:
        query = Query.from_json({"like": looks[1].strip(" ?")})
    else:
        # With a parser that takes time to load.
        from hypermap.questions.english import NotUnderstood, check_length

        vocabulary = vocabulary_of(hypermap, names)
        try:
            check_length(question)
            text, moment = without_as_of(question)
            about_values = value_query(text, hypermap, vocabulary)
            query = about_values or _understood(text, hypermap, vocabulary, moment)
            query = replace(query, as_of=moment)
        except NotUnderstood:
            if model is None:
                raise
            query = model.read(question, vocabulary)
            notes = (f"the language model {model.name} read the question",)
    radius = robot_radius
    answer = ask(hypermap, query, asker=asker, taxonomy=names, robot_radius=radius, encoder=encoder)
    return replace(answer, notes=(*notes, *answer.notes))


def _understood(
    text: str, hypermap: Hypermap, vocabulary: Vocabulary, now: datetime | None
) -> Query:
    """Return the query that a text asks, also about names that are not on the map any more."""
    from hypermap.questions.english import NotUnderstood, understand

    try:
        return understand(text, vocabulary, now)
    except NotUnderstood:
        gone = names_before(hypermap).difference(vocabulary.objects)
        if not gone:
            raise
        known = replace(vocabulary, objects=(*vocabulary.objects, *sorted(gone)))
        return understand(text, known, now)


def ask_map(
    hypermap: Hypermap,
    question: Query | Mapping[str, Any] | str,
    pose: Pose2D | tuple[float, float] | None = None,
    *,
    taxonomy: str | Path | None = None,
    robot_radius: float = 0.0,
    encoder: TextEncoder | None = None,
) -> Answer:
    """Return the answer to a question; `Hypermap.ask`.

    Args:
        hypermap: the map.
        question: a query, JSON values of one, or a text in English.
        pose: where the asker is in the base frame: a pose, or (x, y) [m]; None if unknown.
        taxonomy: a file of more names of objects.
        robot_radius: of the robot that distances by path are for [m].
        encoder: as `ask` takes it.

    Raises:
        NotUnderstood: If the text cannot be read.
        HypermapError: If the question cannot be answered.
        ValueError: If the pose is no place.
        TypeError: If it is not a map.
    """
    check_kind(hypermap, Hypermap)
    asker = pose if pose is None or isinstance(pose, Pose2D) else _pose_of(pose)
    if isinstance(question, str):
        return answer_to(hypermap, question, asker, taxonomy, robot_radius, encoder=encoder)
    query = question if isinstance(question, Query) else Query.from_json(question)
    names, radius = load_taxonomy(taxonomy), robot_radius
    return ask(hypermap, query, asker=asker, taxonomy=names, robot_radius=radius, encoder=encoder)


def _pose_of(place: Sequence[float]) -> Pose2D:
    if len(place) not in (2, 3):  # with a yaw [rad] it is a pose
        raise ValueError(f"pose must be (x, y) or a Pose2D, got {place!r}")
    return Pose2D(*place)


def vocabulary_of(hypermap: Hypermap, taxonomy: Taxonomy) -> Vocabulary:
    """Return what nouns mean in questions about a map."""
    from hypermap.questions.vocabulary import Vocabulary

    layers = [layer for layer in hypermap.layers if isinstance(layer, SemanticLayer)]
    things = {n for layer in layers if layer.name != ROOMS for n in layer.table.names_in_use}
    rooms = rooms_on(hypermap) or ()
    return Vocabulary(
        taxonomy,
        tuple(sorted(things)),
        tuple(dict.fromkeys(room.name for room in rooms)),
        tuple(dict.fromkeys([*_kinds(), *(room.kind for room in rooms if room.kind)])),
    )


@cache
def _kinds() -> tuple[str, ...]:
    """Return the kinds of rooms that every map knows."""
    return tuple(load_kinds().votes)


def parse_pose(text: str, option: str = "--pose") -> Pose2D:
    """Return a pose from "X,Y" or "X,Y,YAW", in meters and degrees.

    Raises:
        HypermapError: If it is neither.

    >>> parse_pose("1, 2, 90").yaw == math.pi / 2
    True
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
        raise HypermapError(f"{option} {text!r}: expected X,Y or X,Y,YAW, as 1.5,-2,90")
    x, y, *yaw = numbers
    return Pose2D(x, y, math.radians(yaw[0]) if yaw else 0.0)


def _parsed(text: str) -> object:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"the query is not JSON: {error}") from None
