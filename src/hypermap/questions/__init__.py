"""Questions about a map as values, in plain English, and their answers."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.questions.answer import Answer, ask
    from hypermap.questions.asking import ask_map
    from hypermap.questions.english import NotUnderstood, understand
    from hypermap.questions.model import LanguageModel
    from hypermap.questions.query import Condition, Measured, Number, Query, Reference, When
    from hypermap.questions.schema import QUERY_SCHEMA
    from hypermap.questions.taxonomy import Taxonomy, load_taxonomy

_HOMES = {
    "Answer": "hypermap.questions.answer",
    "Condition": "hypermap.questions.query",
    "LanguageModel": "hypermap.questions.model",
    "Measured": "hypermap.questions.query",
    "NotUnderstood": "hypermap.questions.english",
    "Number": "hypermap.questions.query",
    "QUERY_SCHEMA": "hypermap.questions.schema",
    "Query": "hypermap.questions.query",
    "Reference": "hypermap.questions.query",
    "Taxonomy": "hypermap.questions.taxonomy",
    "When": "hypermap.questions.query",
    "ask": "hypermap.questions.answer",
    "ask_map": "hypermap.questions.asking",
    "load_taxonomy": "hypermap.questions.taxonomy",
    "understand": "hypermap.questions.english",
}

__all__ = [
    "QUERY_SCHEMA",
    "Answer",
    "Condition",
    "LanguageModel",
    "Measured",
    "NotUnderstood",
    "Number",
    "Query",
    "Reference",
    "Taxonomy",
    "When",
    "ask",
    "ask_map",
    "load_taxonomy",
    "understand",
]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
