"""From English text to tokens: keywords, numbers, and what the map and the taxonomy know."""

from __future__ import annotations

import re
from collections.abc import Sequence

from lark import Token

from hypermap.questions.keywords import (
    NOT_THOSE,
    NUMBER_OF,
    OF_CONDITIONS,
    PARTS,
    PHRASES,
    PLACED,
    UNIT_OF,
)
from hypermap.questions.taxonomy import as_key
from hypermap.questions.vocabulary import Vocabulary

TIME_MARKS = "".join(map(chr, range(0xE000, 0xE008)))
"""Characters for private use, which stand for the times in a question."""

_CONTRACTED = {
    "what's": "what is",
    "whats": "what is",
    "wheres": "where is",
    "where's": "where is",
    "where're": "where are",
    "who's": "who is",
    "how's": "how is",
    "there's": "there is",
    "isn't": "is not",
    "can't": "can not",
    "doesn't": "does not",
    "aren't": "are not",
    "i'm": "i am",
    "i'd": "i would",
    "that's": "that is",
    "don't": "do not",
    "haven't": "have not",
    "hasn't": "has not",
    "wasn't": "was not",
    "weren't": "were not",
    "didn't": "did not",
    "it's": "it is",
    "with nothing": "without anything",
    "has nothing": "has no thing",
    "have nothing": "have no things",
}
_NUMBER = r"\d+(?:\.\d+)?"
_POINT = rf"(?:\(\s*)?-?{_NUMBER}\s*,\s*-?{_NUMBER}\s*\)?"
_PIECES = re.compile(
    rf'"[^"]*"|{_POINT}|\d+(?:nd|rd|th)\b|{_NUMBER}|[^\W\d]+(?:[\'_-][^\W\d]+)*|\S'
)
_LONGEST = 7  # words of a phrase
_ASKED_TO = ("can you", "could you", "would you", "will you")


def tokens_of(text: str, vocabulary: Vocabulary) -> list[Token]:
    """Return the tokens of a question; what no one knows is an UNKNOWN.

    A character of `TIME_MARKS` is the TIME of that number.
    """
    for short, long in _CONTRACTED.items():
        text = re.sub(rf"\b{short}\b", long, text.replace("’", "'"), flags=re.IGNORECASE)
    pieces = [piece for piece in _PIECES.findall(text) if re.match(rf'[\w"(,{TIME_MARKS}-]', piece)]
    words = [as_key(piece) if piece[0].isalpha() else piece for piece in pieces]
    tokens: list[Token] = []
    at = 0
    while at < len(words):
        token, used = _next(words, at, vocabulary)
        if token is not None:
            if token.type == "NOT" and token in NOT_THOSE and PLACED & {t.type for t in tokens}:
                tokens.append(Token("AND", token))
            tokens.append(token)
        at += used
    return [
        token for i, token in enumerate(tokens) if token != "," or _lists(tokens[i - 1 : i + 2])
    ]


def _lists(tokens: list[Token]) -> bool:
    """Return whether there is a comma between the names of two things."""
    return [token.type for token in tokens] == ["THING", "OR", "THING"]


def _next(words: list[str], at: int, vocabulary: Vocabulary) -> tuple[Token | None, int]:
    """Return the token at a word, None for one that says nothing, and how many words it takes."""
    word = words[at]
    if word == ",":
        return Token("OR", word), 1
    if word in TIME_MARKS:
        return Token("TIME", str(TIME_MARKS.index(word))), 1
    if word.startswith('"'):
        return Token("THING", word.strip('"')), 1
    if re.fullmatch(_POINT, word):
        return Token("POINT", word.strip("( )")), 1
    if word == "room" and at + 1 < len(words) and words[at + 1].isdigit():
        return Token("ROOM_NAME", f"room {words[at + 1]}"), 2
    if word in ("a", "an") and words[at + 1 : at + 2] and words[at + 1] in UNIT_OF:
        return Token("NUMBER", "1"), 1
    for length in range(min(_LONGEST, len(words) - at), 0, -1):
        phrase = " ".join(words[at : at + length])
        if meanings := vocabulary.phrases.get(phrase):
            return _noun(words, at, length, meanings)
        if phrase in PARTS:
            return Token("NUMBER", str(PARTS[phrase])), length
        if phrase in PHRASES:
            token = PHRASES[phrase]
            after = words[at + length] if at + length < len(words) else ""
            if phrase in _ASKED_TO and after in vocabulary.phrases:  # "can you drill"
                return Token("UNKNOWN", after), length + 1
            if token == "TAG":
                return _tag(words, at, length), length + 1
            return _keyword(token, phrase, words[at + length :]), length
    if re.fullmatch(_NUMBER, word):
        return Token("NUMBER", word), 1
    if word in NUMBER_OF:
        return Token("NUMBER", str(NUMBER_OF[word])), 1
    if word in UNIT_OF:
        return Token("UNIT", word), 1
    return Token("UNKNOWN", word), 1


def _tag(words: list[str], at: int, length: int) -> Token:
    """Return the token of the tag after "tagged": one word, or what is in quotation marks."""
    if at + length == len(words):
        return Token("UNKNOWN", words[at])
    return Token("TAG", words[at + length].strip('"'))


def _keyword(token: str, phrase: str, rest: list[str]) -> Token | None:
    """Return the token of a keyword, by what follows it where it has two meanings."""
    following = rest[0] if rest else ""
    is_number = following in (*NUMBER_OF, "a", "half") or bool(re.fullmatch(_NUMBER, following))
    if phrase in ("but", "but not"):
        content = next((word for word in rest if PHRASES.get(word) != ""), "")
        if PHRASES.get(content) in OF_CONDITIONS:
            return Token("AND" if phrase == "but" else "NOT", phrase)
        return Token("BUT", phrase)
    if phrase == "both":
        return None if "and" in rest else Token("UNKNOWN", phrase)
    is_count = is_number and not any(word in UNIT_OF for word in rest[1:4])
    if phrase in ("exactly", "just", "only") and not is_count:
        return Token("UNKNOWN", phrase) if phrase == "only" else None
    if phrase in ("approximately", "roughly") and is_count:
        return Token("UNKNOWN", phrase)
    if phrase == "within" and not is_number:
        return Token("IN", phrase)
    if phrase == "under" and is_number and any(word in UNIT_OF for word in rest[1:3]):
        return Token("WITHIN", phrase)
    return Token(token, phrase) if token else None


def _noun(
    words: list[str], at: int, length: int, meanings: Sequence[tuple[str, str]]
) -> tuple[Token, int]:
    """Return the token of a thing or room, with the number after it, as of "chair 14".

    A word with several meanings is AMBIGUOUS.
    """
    if len(meanings) > 1:
        return Token("AMBIGUOUS", " ".join(words[at : at + length])), length
    token, value = meanings[0]
    after = words[at + length] if at + length < len(words) else ""
    unit = words[at + length + 1] if at + length + 1 < len(words) else ""
    if after.isdigit() and unit not in UNIT_OF:
        return Token(token, f"{value} {after}"), length + 1
    return Token(token, value), length
