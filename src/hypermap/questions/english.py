"""From a question in plain English to a `Query`, without a language model.

Words become tokens (`words`), of which a grammar (`grammar`) makes the query. Nothing is guessed:
what cannot be read, or has two meanings, is an error that says so.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import replace
from datetime import datetime

from hypermap.core.errors import HypermapError
from hypermap.questions.foreign import is_foreign
from hypermap.questions.grammar import query_of
from hypermap.questions.keywords import KEYWORDS
from hypermap.questions.query import Query
from hypermap.questions.times import Span, find_times, without_as_of
from hypermap.questions.vocabulary import Vocabulary
from hypermap.questions.words import TIME_MARKS, tokens_of

EXAMPLES = (
    "where is the nearest cup, and in which room?",
    "which chairs are within 1 m of a table in room 2?",
    "how many chairs are in the kitchen?",
    "is there a sofa in the meeting room?",
    "what is on the table?",
    "what is in the kitchen?",
    "how far is the printer from the door?",
    "which room is the printer in?",
    "which rooms have a printer?",
    "which rooms are there?",
    "which is the largest table?",
    "where are the cups that are not in the kitchen?",
    "when did you last see the cup?",
    "what is new since yesterday?",
    "which chairs have not been seen for 7 days?",
)
LONGEST = 500
"""Characters of a question."""

_OTHER_COMMANDS = {
    re.compile(
        r"\b(?:changed?|changes|moved|gone|removed|vanished|disappeared|missing)\b", re.IGNORECASE
    ): "`hypermap changes` lists what was added, moved, reshaped and is gone",
    re.compile(r"\b(?:get|go|drive|walk|route|way)\b.*\b(?:to|there)\b", re.IGNORECASE): (
        "`hypermap path` finds the way to a place, an object or a room"
    ),
}
_MOST_COMPARED = 2000  # names, with one that is not known
_ADDRESS = re.compile(r"\s*(?:(?:hey|hi|hello|ok|okay|dear)\s+)?robot\s*[,:!]", re.IGNORECASE)


class NotUnderstood(HypermapError):
    """A question that could not be read, or that has two meanings.

    Attributes:
        nearest: questions like it that can be answered.
    """

    def __init__(self, message: str, nearest: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.nearest = nearest


def check_length(text: str) -> None:
    """Raise NotUnderstood if a question is too long to be looked at."""
    if len(text) > LONGEST:
        raise NotUnderstood(f"a question has at most {LONGEST} characters, not {len(text)}")


def understand(text: str, vocabulary: Vocabulary, now: datetime | None = None) -> Query:
    """Return the query that a question asks.

    Args:
        text: the question, in English.
        vocabulary: what nouns mean.
        now: the time, with its zone, for times such as "yesterday"; None for the present, in the
            zone of this computer.

    Raises:
        NotUnderstood: If it cannot be read, or has two meanings.
    """
    check_length(text)
    if (address := _ADDRESS.match(text)) is not None:
        text = text[address.end() :]
    text, as_of = without_as_of(text, now)
    query = _understood(text, vocabulary, now)
    return query if as_of is None else replace(query, as_of=as_of)


def _understood(text: str, vocabulary: Vocabulary, now: datetime | None) -> Query:
    marked, times = _marked(text, now)
    tokens = tokens_of(marked, vocabulary)
    for token in tokens:
        if token.type == "AMBIGUOUS":
            raise NotUnderstood(_two_meanings(str(token), vocabulary))
    unknown = [str(token) for token in tokens if token.type == "UNKNOWN"]
    if unknown:
        words = ", ".join(map(repr, unknown[:5]))
        if is_foreign(unknown, len(unknown) < len(tokens)):
            raise NotUnderstood(f"cannot read {words}: questions are read in English", EXAMPLES[:3])
        for clue, command in _OTHER_COMMANDS.items():
            if clue.search(text):
                raise NotUnderstood(f"cannot read {words}; {command}")
        close = [one for word in unknown[:5] if (one := _similar(word, vocabulary))]
        hint = f"; did you mean {', '.join(map(repr, close))}?" if close else ""
        raise NotUnderstood(f"cannot read {words}{hint}", _nearest(text))
    try:
        return query_of(tokens, times)
    except ValueError as error:
        raise NotUnderstood(str(error), _nearest(text)) from None


def _marked(text: str, now: datetime | None) -> tuple[str, list[Span]]:
    """Return a question with a mark instead of each time, and the times."""
    text = "".join(character for character in text if character not in TIME_MARKS)
    found = find_times(text, now)[: len(TIME_MARKS)]
    for number, (start, end, _) in reversed([*enumerate(found)]):
        text = f"{text[:start]} {TIME_MARKS[number]} {text[end:]}"
    return text, [span for _, _, span in found]


def _two_meanings(word: str, vocabulary: Vocabulary) -> str:
    meanings = vocabulary.phrases[word]
    if len({token for token, _ in meanings}) > 1:
        return (
            f'{word!r} is both a room and a thing here; write "{word}" in quotation marks for the '
            "thing, or 'room' and its number for the room"
        )
    return f"{word!r} may mean {' or '.join(repr(name) for _, name in meanings)}; say which"


def _similar(word: str, vocabulary: Vocabulary) -> str | None:
    """Return the most similar word that is known; None if there is none."""
    known = (*vocabulary.phrases, *KEYWORDS)
    if word in known:
        return None
    like = [one for one in known if one[0] == word[0] and abs(len(one) - len(word)) < 4]
    close = difflib.get_close_matches(word, like[:_MOST_COMPARED], n=1, cutoff=0.75)
    return close[0] if close else None


def _nearest(text: str) -> tuple[str, ...]:
    """Return the examples that share most with a question."""
    words = set(text.lower().rstrip("?").split())
    return tuple(sorted(EXAMPLES, key=lambda one: -len(words & set(one.rstrip("?").split())))[:3])
