"""Questions in English to the server of the page."""

from __future__ import annotations

import contextlib
import io
import json
import shlex
from pathlib import Path

import pytest

from hypermap.cli.main import main

from .live_tools import saved, serving


def asked(path: Path, status: int = 200, **values: object) -> dict:
    with serving(path) as client:
        reply = client.get("/api/ask", params=values)
    assert reply.status_code == status, reply.text
    return reply.json()


def run(text: str) -> str:
    """Run the Python that the page shows."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(text, "<page>", "exec"), {"__name__": "__main__"})
    return said.getvalue()


def test_a_question_is_answered_with_objects_and_the_code_that_asks_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = saved(tmp_path)
    reply = asked(path, **{"question": "where is the nearest table?", "from": "9,1"})
    (row,) = reply["rows"]
    assert (row["name"], reply["total"]) == ("table", 1)
    assert row["distance"] >= 0
    assert [meaning for _, meaning in reply["understood"][:2]] == ["which objects", "table"]
    assert reply["words"] == []
    assert run(reply["python"]) == f"1 [{row['id']}]\n"
    program, *arguments = shlex.split(reply["command"])
    assert program == "hypermap"
    with pytest.raises(SystemExit):
        main([*arguments, "--json"])
    (item,) = json.loads(capsys.readouterr().out)["objects"]
    assert item["id"] == row["id"]


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ("how many tables are there?", ["1"]),
        ("is there a piano?", ["no", "there is no piano in the map"]),
        ("is there a table?", ["yes"]),
    ],
)
def test_what_no_object_says_is_said_in_words(
    tmp_path: Path, question: str, words: list[str]
) -> None:
    assert asked(saved(tmp_path), question=question)["words"] == words


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, "question: missing"),
        ({"question": "sing me a song"}, "sing"),
        ({"question": "is there a frobnicator?"}, "frobnicator"),
        ({"question": "where is the table of the"}, "You can ask: "),
        ({"question": "where is the nearest table?", "from": "here"}, "from"),
        ({"question": "where is the nearest table?"}, "depends on where you are"),
        ({"question": "where " * 2000}, ""),
        ({"question": '{"names": 3}'}, "names"),
    ],
)
def test_what_cannot_be_answered_is_refused(
    tmp_path: Path, values: dict[str, str], words: str
) -> None:
    assert words in asked(saved(tmp_path), 400, **values)["error"]
