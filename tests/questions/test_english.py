"""Questions in English become the queries that they mean, or are refused."""

from __future__ import annotations

import json
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.questions import NotUnderstood, Query, load_taxonomy, understand
from hypermap.questions.english import EXAMPLES
from hypermap.questions.vocabulary import Vocabulary
from hypermap.rooms.kinds import load_kinds

NOW = datetime(2026, 11, 23, 14, 30, tzinfo=timezone(timedelta(hours=1)))  # a Monday
VOCABULARY = Vocabulary(load_taxonomy(), kinds=tuple(load_kinds().votes))


def read(name: str) -> list[tuple[str, Any]]:
    """Return the questions of a file, each with its query as JSON, None if it is not to be read."""
    lines = (Path(__file__).parent / name).read_text(encoding="utf-8").splitlines()
    pairs = (line.split("\t") for line in lines if not line.startswith("#"))
    return [(question, json.loads(query)) for question, query in pairs]


def query_of(question: str) -> Any:
    try:
        return understand(question, VOCABULARY, NOW).to_json()
    except NotUnderstood:
        return None


@pytest.mark.parametrize(("question", "query"), read("grown.tsv"))
def test_a_question_is_understood(question: str, query: Any) -> None:
    assert query_of(question) == query


def test_of_the_questions_set_aside_none_is_misunderstood() -> None:
    answers = [(question, query, query_of(question)) for question, query in read("set_aside.tsv")]
    wrong = [one for one in answers if one[2] is not None and one[1] != one[2]]
    right = [one for one in answers if one[1] == one[2]]
    assert wrong == []
    assert len(right) >= 0.95 * len(answers)


@pytest.mark.parametrize("question", EXAMPLES)
def test_the_examples_can_be_asked(question: str) -> None:
    assert isinstance(understand(question, VOCABULARY), Query)


@pytest.mark.parametrize(
    ("question", "message"),
    [
        ("", "cannot read this question"),
        ("where is the zorblax", "cannot read 'zorblax'"),
        ("where is the refigerator", "cannot read 'refigerator'; did you mean 'refrigerator'"),
        ("what has moved since monday", "cannot read 'moved'; `hypermap changes` lists what was"),
        ("how do I get to the kitchen?", "cannot read 'how', 'i', 'get'; `hypermap path` finds"),
        ("chairs within 3 furlongs of the table", "cannot read 'furlongs'"),
        ("wo ist die Tasse?", "'wo', 'ist', 'die', 'tasse': questions are read in English$"),
        ("¿cuántas sillas hay?", "questions are read in English$"),
        ("где чашка?", "'где', 'чашка': questions are read in English$"),
        ("rooms with chairs and cups or tables", '"and" may mean both or either'),
        ("rooms with chairs but no cups and tables", '"and" may mean both or either'),
        ("is there a room with two chairs and tables", '"and" may mean both or either'),
        ("rooms with the nearest chair and a cup", "one at a time"),
        ("rooms with one bed", "one or more\\? say 'exactly one' or 'at least one'"),
        ("is there a toilet here", "here\\? say 'in this room', 'near me'"),
        ("is there a printer in every office", "cannot read this question from 'every' on"),
        ("is there a printer in all offices", '"all" may mean each of them'),
        ("how many cups are on each table", "cannot read this question from 'each' on"),
        ("which rooms have more than 1 m chairs", "cannot read this question"),
        ("which room has the most nearest chairs", "how many, or the nearest"),
        ("are there one and a half chairs", "1.5 objects cannot be counted"),
        ("what is tagged", "cannot read 'tagged'"),
        ("which cups are where", "cannot read this question from 'where' on"),
        ("two cups", "2 of how many"),
        ("what have you not seen yesterday", "not seen yesterday: say since when"),
        ("which cups were there on 2026-11-20", "from 'on 2026-11-20' on; .*as of Monday"),
        ("what is new since 2026-13-01", "cannot read 'since'"),
        ("what did you see yesterday at 3 pm", "cannot read 'pm'"),
        ("what is new", "cannot read this question"),
        (f"what is at {'9' * 400}, 2", "a point is farther away than 1e"),
        ("0 nearest cups", "0 objects cannot be listed"),
        ("cup " * 25_000, "a question has at most 500 characters, not 100000"),
    ],
)
def test_what_cannot_be_read_is_named(question: str, message: str) -> None:
    with pytest.raises(NotUnderstood, match=message):
        understand(question, VOCABULARY)


def test_marks_of_times_cannot_be_typed() -> None:
    assert query_of("what is new \ue000") is None
    assert query_of("cups \ue000") == query_of("cups")


def test_what_is_not_understood_names_questions_that_are() -> None:
    with pytest.raises(NotUnderstood) as error:
        understand("how far is the nearest printer by teleportation", VOCABULARY)
    assert "how far is the printer from the door?" in error.value.nearest


def test_what_the_map_alone_knows_is_read() -> None:
    vocabulary = Vocabulary(load_taxonomy(), objects=("Zorblax_3000",), rooms=("Aunt May",))
    query = understand("how many zorblax 3000 are in aunt may?", vocabulary)
    assert query.to_json() == {
        "give": "count",
        "names": ["Zorblax_3000"],
        "where": [{"relation": "in", "what": {"rooms": ["Aunt May"]}}],
    }


def test_a_word_with_two_meanings_is_asked_back() -> None:
    vocabulary = Vocabulary(load_taxonomy(), rooms=("Printer",))
    with pytest.raises(NotUnderstood, match="'printer' is both a room and a thing here"):
        understand("what is near the printer", vocabulary)
    assert understand('what is near the "printer"', vocabulary).where[0].reference.names


WORDS = [*VOCABULARY.phrases, "where", "is", "the", "nearest", "in", "2", "m", "of"]


@given(st.lists(st.sampled_from(WORDS)))
def test_any_words_are_read_or_refused(words: list[str]) -> None:
    text = " ".join(words)[:500]
    query = query_of(text)
    assert query is None or Query.from_json(query) == understand(text, VOCABULARY)


def test_things_that_are_called_like_keywords_spoil_no_question() -> None:
    vocabulary = Vocabulary(load_taxonomy(), objects=("in", "Where", "2", "", "the nearest"))
    query = understand("where is the nearest cup in room 2?", vocabulary)
    assert query == understand("where is the nearest cup in room 2?", VOCABULARY)
    assert understand('how many "in" are there', vocabulary).names == ("in",)


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text: str) -> None:
    query_of(text)
