"""`hypermap ask`: a question in plain English."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.negative_points import PointsCommand
from hypermap.cli.options import AsJson, TaxonomyFile, name_of
from hypermap.cli.terminal import note, say, say_json

COMMAND_CLASS = PointsCommand

if TYPE_CHECKING:
    from hypermap.questions.model import LanguageModel


def command(
    path: Annotated[
        Path | None,
        typer.Argument(metavar="MAP", readable=False, show_default=False, help="A map."),
    ] = None,
    question: Annotated[
        str | None,
        typer.Argument(
            metavar="QUESTION",
            show_default=False,
            help="A question in English, or a query as JSON, which begins with {.",
        ),
    ] = None,
    asker: Annotated[
        str | None,
        typer.Option(
            "--pose",
            metavar="X,Y[,YAW]",
            show_default=False,
            help="Your position, in meters, and heading, in degrees, in the base frame.",
        ),
    ] = None,
    taxonomy: TaxonomyFile = None,
    robot_radius: Annotated[
        float,
        typer.Option(
            "--robot-radius",
            metavar="METERS",
            min=0.0,
            help="Radius of the robot: for distances by path.",
        ),
    ] = 0.0,
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            metavar="NAME",
            show_default="none",
            help="Language model for questions that the grammar cannot read; see docs/ask.md.",
        ),
    ] = None,
    model_url: Annotated[
        str | None,
        typer.Option(
            "--model-url",
            metavar="URL",
            envvar="HYPERMAP_MODEL_URL",
            show_default=False,
            help="Its OpenAI-compatible endpoint, such as http://localhost:11434/v1.",
        ),
    ] = None,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of queries and exit.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Ask a question about a map in plain English.

    This shows how it understood the question, and then the answer. It knows synonyms and kinds of
    objects: a couch is a sofa, and seating. A question that it cannot read, or that has two
    meanings, is an error: it never guesses. A language model is optional (--model).

    Examples:
        hypermap ask office.hmap "where is the nearest cup?" --pose 1,2
        hypermap ask office.hmap "which chairs are within 1 m of a table in room 2?"
        hypermap ask office.hmap "how many chairs are in the kitchen?"
        hypermap ask office.hmap "which rooms have a printer?" --json
        hypermap ask office.hmap '{"names": ["seating"], "give": "count"}'
        hypermap ask office.hmap "I could do with a coffee" --model NAME --model-url URL
        hypermap ask --schema
    """
    from hypermap.console.asked import document, lines, understood
    from hypermap.core.errors import HypermapError
    from hypermap.formats import open_map
    from hypermap.questions.asking import answer_to, parse_pose
    from hypermap.questions.english import NotUnderstood
    from hypermap.questions.schema import QUERY_SCHEMA

    if schema:
        say_json(QUERY_SCHEMA)
        return
    if path is None or question is None:
        raise HypermapError('give a map and a question, as "where is the nearest cup?"')
    reader = None if model is None else _language_model(model, model_url)
    hypermap = open_map(path)
    pose = None if asker is None else parse_pose(asker)
    try:
        answer = answer_to(hypermap, question, pose, taxonomy, robot_radius, reader)
    except NotUnderstood as error:
        for one in error.nearest:
            note(f"you can ask: {one}")
        raise
    if as_json:
        say_json({"map": name_of(path), **document(hypermap, answer)})
        return
    for part, text in understood(answer.query):
        note(f"{part}: {text}")
    for line in lines(hypermap, answer):
        say(line)


def _language_model(name: str, url: str | None) -> LanguageModel:
    from hypermap.core.errors import HypermapError
    from hypermap.questions.model import LanguageModel

    if url is None:
        raise HypermapError("--model needs --model-url, or HYPERMAP_MODEL_URL in the environment")
    return LanguageModel(url, name, os.environ.get("HYPERMAP_MODEL_KEY", ""))
